"""One random robot through psdmc, against Pinocchio and MuJoCo: errors relative to each joint's largest torque."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from campaign_lowered import lowered_errors
from campaign_oracles import MuJoCo, Pinocchio, Textbook
from campaign_reference import Reference, States, random_states
from campaign_robots import RandomRobot, random_robot

from psdmc.derivation.certify import certificate
from psdmc.derivation.derive import derive_model
from psdmc.errors import DerivationError, InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import DEFAULT_SNAP, load_robot_text
from psdmc.robot.mechanism import Mechanism

Array = np.ndarray

EXPANDED_JOINTS = 7
"""E and P are made for robots up to this length."""

VALUES = 3_000_000
"""Values of functions that E and P may take per robot and comparison: with 30,000 functions, 100 states instead of all."""

MUJOCO_LIMIT, LIMIT, SINGLE_LIMIT = 1e-10, 1e-11, 1e-3
"""Errors that pass: against MuJoCo, which makes each inertia tensor diagonal by iteration until it is so to 1e-12; against
Pinocchio; of code in float32."""


@dataclass(slots=True)
class Found:
    """What one robot showed.

    errors    by what was compared with what
    states    states at which torques were compared: of base parameters, and of E and P, of every chain made of the robot
    refused   by chain: psdmc's own words, where the robot's numbers are beyond double precision
    """

    errors: dict[str, float] = field(default_factory=dict)
    states: dict[str, int] = field(default_factory=lambda: {"base parameters": 0, "E and P": 0})
    refused: dict[str, str] = field(default_factory=dict)


def measured(seed: int, count: int, *, lowered: bool) -> Found:
    """The robot of a seed at `count` random states, lowered and compiled as well where asked. Raises whatever psdmc does:
    nothing is expected to, but refusals of robots of many scales."""
    robot = random_robot(seed)
    states = random_states(seed, len(robot.joints), count)
    found = Found()
    as_written = _reference(robot, Pinocchio.of_text(robot.text), states)
    if not robot.is_mixed:
        _of_mujoco(robot, as_written, found)
    try:
        exact, snapped = (load_robot_text(robot.text, "urdf", snap=snap) for snap in (0.0, DEFAULT_SNAP))
    except InputError as refusal:
        if not robot.is_mixed:
            raise
        found.refused["file"] = str(refusal)
        return found
    chains = {"snap 0": (exact.chain, as_written)}
    if snapped.snap_report:
        chains["snapped"] = (snapped.chain, _reference(robot, Pinocchio.of_chain(snapped.chain), states))
    turn = _turn(seed)
    for k, (name, (chain, reference)) in enumerate(chains.items()):
        try:
            _of_chain(chain, name, reference, found, turn if lowered and k == turn % len(chains) else None)
        except DerivationError as refusal:
            if not robot.is_mixed:
                raise
            found.refused[name] = str(refusal)
    return found


def _reference(robot: RandomRobot, oracle: Pinocchio, states: States) -> Reference:
    return Reference.of(Textbook(oracle) if robot.is_mixed else oracle, states)


def failures(errors: dict[str, float]) -> dict[str, float]:
    """The errors that do not pass, NaN included."""
    return {what: e for what, e in errors.items() if not e <= limit_of(what)}


def limit_of(what: str) -> float:
    if what.startswith("MuJoCo"):
        return MUJOCO_LIMIT
    return SINGLE_LIMIT if "float32" in what else LIMIT


def _turn(seed: int) -> int:
    """Which chain of a lowered robot is lowered and with which options: each in turn, whatever seeds are lowered."""
    return int(np.random.default_rng([40, seed]).integers(1_000_000))


def _of_mujoco(robot: RandomRobot, reference: Reference, found: Found) -> None:
    """Not of robots of many scales: MuJoCo refuses masses and inertias below 1e-15."""
    mujoco = MuJoCo(robot.text)
    q, qd, _ = reference.few
    found.errors |= {
        "MuJoCo, Pinocchio inverse_dynamics": reference.torque_error(
            mujoco.torques(*reference.states), reference.tau
        ),
        "MuJoCo, Pinocchio mass_matrix": reference.mass_error(mujoco.mass_matrix(q)),
        "MuJoCo, Pinocchio nonlinear_effects": reference.torque_error(
            mujoco.nonlinear_effects(q, qd), reference.nonlinear
        ),
    }


def _of_chain(chain: Mechanism, name: str, reference: Reference, found: Found, turn: int | None) -> None:
    expands = len(chain) <= EXPANDED_JOINTS
    model = derive_model(chain, expand=expands)
    plain = replace(model, expansion=None) if expands else model
    plain = replace(plain, certificate=certificate(plain))
    kinds = {"base parameters": plain} | ({"E and P": model} if expands else {})
    for kind, one in kinds.items():
        errors, states = _of_model(one, reference)
        found.errors |= {f"{name}, {kind} {what}": e for what, e in errors.items()}
        found.states[kind] += states
    if turn is not None:
        found.errors |= {f"{name}, {what}": e for what, e in lowered_errors(model, reference, turn)}


def _of_model(model: DynamicsModel, reference: Reference) -> tuple[dict[str, float], int]:
    """Errors in NumPy, and at how many states torques were compared."""
    count = len(reference.tau) if model.p is None else max(1, min(len(reference.tau), VALUES // model.p))
    torques = model.inverse_dynamics(*(vector[:count] for vector in reference.states))
    q, qd, _ = reference.few
    return {
        "inverse_dynamics": reference.torque_error(torques, reference.tau[:count]),
        "mass_matrix": reference.mass_error(model.mass_matrix(q)),
        "nonlinear_effects": reference.torque_error(model.nonlinear_effects(q, qd), reference.nonlinear),
        "gravity": reference.torque_error(model.gravity(q), reference.gravity),
        "certificate": float(model.certificate.max()),
    }, count


def described(robot: RandomRobot) -> str:
    tilts = f", tilts {min(robot.tilts):.1g} to {max(robot.tilts):.1g} rad" if robot.tilts else ""
    mixed = ", of many scales" if robot.is_mixed else ""
    return f"{len(robot.joints)} joints, {robot.style}{tilts}{mixed}"
