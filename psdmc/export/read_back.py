"""Compares the torques that Pinocchio and MuJoCo compute from a written URDF or MJCF file with those of the model. The
result is the largest difference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.robot.coordinates import MimicMap
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.mechanism import DRIVE, PARAMETERS_PER_LINK, Array
from psdmc.robot.mjcf.mujoco_model import kept_warnings
from psdmc.robot.mujoco_reading import NotCompared, force_from_mujoco, mujoco_torques, to_mujoco
from psdmc.robot.reference import OnCoordinates, reference

STATES, SEED = 200, 77_029
NO_TORQUE = 1e-9
"""Share of the largest torque below which a joint's torque is rounding, and its error is measured against the largest."""
LIMIT = 1e-9
"""Largest error, as a share of the joint's largest torque: what is promised of a written file."""


@dataclass(frozen=True, slots=True)
class Reading:
    """The comparison of the torques that another program computes with the model's torques, at random states.

    reader  name of the program, such as Pinocchio
    error   largest torque difference, divided by the joint's largest torque; NaN if torques were not compared
    reason  why torques were not compared, in words
    """

    reader: str
    error: float
    reason: str = ""


def read_urdf_back(model: DynamicsModel, text: str, drives: Array, gravity: Array) -> tuple[Reading, ...]:
    """Compare the torques that Pinocchio and MuJoCo compute from a URDF with those of the model without its drive
    inertias.

    drives   (n,) drive inertias of the links that were written, which a URDF cannot hold
    gravity  (3,) m/s^2 along the axes of the file's root link
    """
    floating = not model.mechanism.types[0].about_z
    loaded = load_robot_text(
        text, "urdf", source_name="the URDF", snap=0.0, gravity=gravity.tolist(), floating=floating
    )
    states, expected = _expected(model, drives)
    order = [loaded.mechanism.joint_names.index(name) for name in model.joint_names]
    found = OnCoordinates.of(reference(loaded, snapped=False), loaded.mechanism)
    theirs = _their_states(model, loaded, order, states)
    rows = [
        Reading(
            "Pinocchio", _error(_our_torques(model, loaded, order, found.inverse_dynamics(*theirs)), expected)
        )
    ]
    try:
        torques = _mujoco(loaded, theirs)
        rows.append(Reading("MuJoCo", _error(_our_torques(model, loaded, order, torques), expected)))
    except NotCompared as error:
        rows.append(Reading("MuJoCo", float("nan"), str(error)))
    return tuple(rows)


def _mujoco(loaded: LoadedRobot, states: tuple[Array, Array, Array]) -> Array:
    mimic_map = MimicMap.of(loaded.mechanism.coordinates, loaded.mechanism.types)
    free = (mimic_map.positions(states[0]), *map(mimic_map.rates, states[1:]))
    return mimic_map.summed(mujoco_torques(loaded, *free))


def read_mjcf_back(model: DynamicsModel, text: str) -> Reading:
    """Compare MuJoCo's torques of an MJCF, without friction, with those of the model with drive inertias."""
    try:
        import mujoco
    except ImportError:
        return Reading("MuJoCo", float("nan"), "MuJoCo is not installed")
    try:
        with kept_warnings(mujoco):
            found = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        return Reading("MuJoCo", float("nan"), " ".join(str(error).split())[:REASON])
    found.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    found.dof_damping[:] = 0.0
    (q, qd, qdd), expected = _expected(model, np.zeros(model.n))
    mimic_map = MimicMap.of(model.mechanism.coordinates, model.mechanism.types)
    q, qd, qdd = mimic_map.positions(q), mimic_map.rates(qd), mimic_map.rates(qdd)
    floating = not model.mechanism.types[0].about_z
    if floating:
        q, qd, qdd = to_mujoco(q, qd, qdd)
    torques = _inverse(mujoco, found, model, q, qd, qdd)
    if floating:
        torques = force_from_mujoco(q, torques)
    return Reading("MuJoCo", _error(mimic_map.summed(torques), expected))


REASON = 160
"""Characters of MuJoCo's own message that are repeated."""


def _inverse(mujoco: Any, found: Any, model: DynamicsModel, q: Array, qd: Array, qdd: Array) -> Array:
    """(states, all rates) MuJoCo's torques, joints found by name."""
    ids = [mujoco.mj_name2id(found, mujoco.mjtObj.mjOBJ_JOINT, name) for name in model.joint_names]
    types = model.mechanism.types
    places = [
        int(found.jnt_qposadr[j]) + k for j, kind in zip(ids, types, strict=True) for k in range(kind.nq)
    ]
    rates = [int(found.jnt_dofadr[j]) + k for j, kind in zip(ids, types, strict=True) for k in range(kind.nv)]
    data = mujoco.MjData(found)
    torques = np.zeros_like(qd)
    for row in range(len(q)):
        data.qpos[places], data.qvel[rates], data.qacc[rates] = q[row], qd[row], qdd[row]
        mujoco.mj_inverse(found, data)
        torques[row] = data.qfrc_inverse[rates]
    return torques


def _expected(model: DynamicsModel, drives: Array) -> tuple[tuple[Array, Array, Array], Array]:
    """Random states, and the torques (states, nv) of theta_b less those drive inertias."""
    states = states_of(model.mechanism, np.random.default_rng(SEED), STATES)
    x = np.zeros((model.n, PARAMETERS_PER_LINK))
    x[:, DRIVE] = drives
    theta = model.known_theta_b() - model.B @ x.reshape(-1)
    return states, model.torques_for(theta, *states)


def _their_states(
    model: DynamicsModel, loaded: LoadedRobot, order: list[int], states: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """The states with their entries in the order of the written file's joints."""
    positions, rates = _entries(model, loaded, order)
    q, qd, qdd = states
    return q[:, np.argsort(positions)], qd[:, np.argsort(rates)], qdd[:, np.argsort(rates)]


def _our_torques(model: DynamicsModel, loaded: LoadedRobot, order: list[int], torques: Array) -> Array:
    return torques[:, _entries(model, loaded, order)[1]]


def _entries(model: DynamicsModel, loaded: LoadedRobot, order: list[int]) -> tuple[list[int], list[int]]:
    """For each entry of the model's q, and of its rates, the place of the same joint's entry in the file's."""
    there = loaded.mechanism
    own = there.own_joints
    first_q = dict(zip(own, np.cumsum([0, *(there.types[i].nq for i in own)]), strict=False))
    first_v = dict(zip(own, np.cumsum([0, *(there.types[i].nv for i in own)]), strict=False))
    mine = [order[i] for i in model.mechanism.own_joints]
    positions = [int(first_q[i]) + k for i in mine for k in range(there.types[i].nq)]
    return positions, [int(first_v[i]) + k for i in mine for k in range(there.types[i].nv)]


def _error(found: Array, expected: Array) -> float:
    """Largest difference of any joint, as a share of its largest torque."""
    largest = np.abs(expected).max(axis=0)
    overall = max(float(largest.max(initial=0.0)), float(np.finfo(float).tiny))
    scale = np.where(largest > NO_TORQUE * overall, largest, overall)
    return float((np.abs(found - expected).max(axis=0) / scale).max())
