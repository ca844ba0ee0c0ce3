"""Torques of an MJCF file as MuJoCo has them, which reads it by itself: rigid bodies alone."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from oracle import SEED, STATES

from psdmc.model.dynamics_model import DynamicsModel

FORCES = ("dof_damping", "dof_dampingpoly", "dof_frictionloss", "jnt_stiffness", "jnt_stiffnesspoly", "body_gravcomp",
          "actuator_damping", "actuator_dampingpoly")  # fmt: skip
"""Arrays of what is no inertia, and noted by name; older MuJoCos have not all of them."""


def mujoco_error(path: Path, model: DynamicsModel) -> float | None:
    """Largest difference at three states over the largest torque; None where there is nothing to compare: a free root,
    equality constraints, other joints, or numbers that overflow."""
    import mujoco

    robot = mujoco.MjModel.from_xml_path(str(path))
    numbers = [mujoco.mj_name2id(robot, mujoco.mjtObj.mjOBJ_JOINT, name) for name in model.joint_names]
    if robot.neq or -1 in numbers or len(numbers) != robot.nv or model.theta_b is None:
        return None
    for name in FORCES:
        if hasattr(robot, name):
            getattr(robot, name)[:] = 0.0
    robot.opt.density = robot.opt.viscosity = 0.0
    bits = mujoco.mjtDisableBit
    robot.opt.disableflags = int(robot.opt.disableflags) | int(bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT)
    q, qd, qdd = np.random.default_rng(SEED).uniform(-2.0, 2.0, (3, STATES, model.n))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = _torques(mujoco, robot, robot.jnt_dofadr[numbers], q, qd, qdd)
        largest = float(np.abs(expected).max())
        if not 1e-200 < largest < 1e200:
            return None
        return float(np.abs(model.inverse_dynamics(q, qd, qdd) - expected).max()) / largest


def _torques(mujoco: Any, robot: Any, order: Any, *states: NDArray[np.float64]) -> NDArray[np.float64]:
    q, qd, qdd = states
    data, found = mujoco.MjData(robot), np.zeros_like(q)
    for k in range(len(q)):
        data.qpos[order], data.qvel[order], data.qacc[order] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(robot, data)
        found[k] = data.qfrc_inverse[order]
    return found
