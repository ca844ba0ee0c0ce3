"""Torques of an MJCF file as MuJoCo has them, which reads it by itself: rigid bodies alone, standing or on a free joint."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from oracle import SEED, STATES
from scipy.spatial.transform import Rotation

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mjcf.mujoco_model import kept_warnings

FORCES = ("dof_damping", "dof_dampingpoly", "dof_frictionloss", "jnt_stiffness", "jnt_stiffnesspoly", "body_gravcomp",
          "actuator_damping", "actuator_dampingpoly")  # fmt: skip
"""Arrays of what is no inertia, and noted by name; older MuJoCos have not all of them."""


def mujoco_error(path: Path, model: DynamicsModel) -> float | None:
    """Largest difference at three states over the largest torque; None where there is nothing to compare: moving bodies
    without mass, which MuJoCo refuses, equality constraints, other joints, or numbers that overflow."""
    import mujoco

    with kept_warnings(mujoco):
        try:
            robot = mujoco.MjModel.from_xml_path(str(path))
        except ValueError:
            return None
    is_free = robot.njnt > 0 and robot.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    names = model.joint_names[1:] if is_free else model.joint_names
    numbers = [mujoco.mj_name2id(robot, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
    if robot.neq or -1 in numbers or model.nv != robot.nv or model.nq != robot.nq or model.theta_b is None:
        return None
    for name in FORCES:
        if hasattr(robot, name):
            getattr(robot, name)[:] = 0.0
    robot.opt.density = robot.opt.viscosity = 0.0
    bits = mujoco.mjtDisableBit
    robot.opt.disableflags = int(robot.opt.disableflags) | int(bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT)
    q = np.random.default_rng(SEED).uniform(-2.0, 2.0, (STATES, model.nq))
    qd, qdd = np.random.default_rng(SEED + 1).uniform(-2.0, 2.0, (2, STATES, model.nv))
    if is_free:
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = _torques(mujoco, robot, numbers, is_free, q, qd, qdd)
        largest = float(np.abs(expected).max())
        if not 1e-200 < largest < 1e200:
            return None
        return float(np.abs(model.inverse_dynamics(q, qd, qdd) - expected).max()) / largest


def _torques(
    mujoco: Any, robot: Any, numbers: list[int], is_free: bool, *states: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Of a free joint, MuJoCo has the position and its rate in the world, and the quaternion's real part first."""
    q, qd, qdd = states
    data, found = mujoco.MjData(robot), np.zeros_like(qd)
    places, dofs = robot.jnt_qposadr[numbers], robot.jnt_dofadr[numbers]
    own = slice(6 if is_free else 0, None)
    for k in range(len(q)):
        data.qpos[places], data.qvel[dofs], data.qacc[dofs] = (
            q[k, 7 if is_free else 0 :],
            qd[k, own],
            qdd[k, own],
        )
        if is_free:
            axes = Rotation.from_quat(q[k, 3:7]).as_matrix()
            data.qpos[:3], data.qpos[3], data.qpos[4:7] = q[k, :3], q[k, 6], q[k, 3:6]
            data.qvel[:3], data.qvel[3:6] = axes @ qd[k, :3], qd[k, 3:6]
            data.qacc[:3] = axes @ (qdd[k, :3] + np.cross(qd[k, 3:6], qd[k, :3]))
            data.qacc[3:6] = qdd[k, 3:6]
        mujoco.mj_inverse(robot, data)
        found[k, own] = data.qfrc_inverse[dofs]
        if is_free:
            found[k, :3], found[k, 3:6] = axes.T @ data.qfrc_inverse[:3], data.qfrc_inverse[3:6]
    return found
