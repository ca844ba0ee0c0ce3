"""One random robot through psdmc, against Pinocchio and MuJoCo: errors relative to each joint's largest torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from campaign_contacts import STATES, ContactRobot, contact_errors
from campaign_draw import robot_of
from campaign_lowered import lowered_errors
from campaign_oracles import MuJoCo, Pinocchio, Textbook
from campaign_reference import Reference, States, random_states
from campaign_robots import RandomRobot

from psdmc.derivation.certify import certificate
from psdmc.derivation.derive import derive_model
from psdmc.derivation.scaled import has_small_entries, scaled
from psdmc.dynamics.forward_dynamics import forward_dynamics
from psdmc.errors import DerivationError, InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.recipes.on_arrays import RobotOnArrays, columns
from psdmc.robot.load import DEFAULT_SNAP, load_robot_text
from psdmc.robot.mechanism import Mechanism

Array = np.ndarray

EXPANDED_JOINTS, EXPANDED_BODIES = 7, 5
"""E and P are made for chains up to this length, and for trees of so many bodies that stand and have no mimic joints."""

VALUES = 3_000_000
"""Values of functions that E and P may take per robot and comparison: with 30,000 functions, 100 states instead of all."""

MUJOCO_LIMIT, LIMIT, SINGLE_LIMIT = 1e-10, 1e-11, 1e-3
"""Errors that pass: against MuJoCo, which makes each inertia tensor diagonal by iteration until it is so to 1e-12; against
Pinocchio; of code in float32."""

CLEAR, UNCLEAR = 1e-7, 1e-11
"""Singular values of a regressor with columns of length one, relative to the largest: the rank is told where none is
between these."""

SPAN_ROUNDING = 1e-14
"""Part of a regressor, relative to its largest column, that double precision does not tell from zero."""

COLUMN_SIZE = 1e-12
"""Smallest column of a regressor, relative to the largest, that is more than rounding."""


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
    robot = robot_of(seed)
    if isinstance(robot, ContactRobot):
        return Found(contact_errors(robot), {"contacts and loops": STATES})
    oracle = Pinocchio.of_robot(robot)
    coordinates = oracle.joints.coordinates
    states = random_states(seed, len(coordinates), count, robot.is_floating)
    found = Found()
    as_written = _reference(robot, oracle, states)
    if not robot.is_mixed and not robot.is_light:
        _of_mujoco(MuJoCo(robot, coordinates), as_written, found)
    try:
        exact, snapped = (
            load_robot_text(robot.text, "urdf", snap=snap, **robot.options) for snap in (0.0, DEFAULT_SNAP)
        )
    except InputError as refusal:
        if not robot.is_mixed:
            raise
        found.refused["file"] = str(refusal)
        return found
    _same_coordinates(exact.mechanism, coordinates)
    chains = {"snap 0": (exact.mechanism, oracle, as_written)}
    if snapped.snap_report:
        exactly = Pinocchio.of_chain(snapped.mechanism, robot)
        chains["snapped"] = (snapped.mechanism, exactly, _reference(robot, exactly, states))
    turn = _turn(seed)
    for k, (name, (chain, own, reference)) in enumerate(chains.items()):
        try:
            plain = _of_chain(
                chain, name, reference, found, turn if lowered and k == turn % len(chains) else None
            )
            if not robot.is_mixed:
                found.errors |= _of_parameters(plain, name, own, reference)
        except (
            DerivationError,
            InputError,
        ) as refusal:  # the latter where double precision has no accelerations
            if not robot.is_mixed:
                raise
            found.refused[name] = str(refusal)
    return found


def _same_coordinates(chain: Mechanism, expected: Sequence[str]) -> None:
    """q is in Pinocchio's order."""
    own = [chain.joints[k].name for k in chain.own_joints if chain.joints[k].type.about_z]
    if own != list(expected):
        raise AssertionError(f"coordinates {own}, Pinocchio has {list(expected)}")


def _reference(robot: RandomRobot, oracle: Pinocchio, states: States) -> Reference:
    return Reference.of(Textbook(oracle) if robot.is_mixed else oracle, states)


def failures(errors: dict[str, float]) -> dict[str, float]:
    """The errors that do not pass, NaN included."""
    return {what: e for what, e in errors.items() if not e <= limit_of(what)}


def limit_of(what: str) -> float:
    if what.startswith("MuJoCo"):
        return MUJOCO_LIMIT
    if what.startswith("contacts"):
        return 1.0  # of the bound of each state
    return SINGLE_LIMIT if "float32" in what else LIMIT


def _turn(seed: int) -> int:
    """Which chain of a lowered robot is lowered and with which options: each in turn, whatever seeds are lowered."""
    return int(np.random.default_rng([40, seed]).integers(1_000_000))


def _of_mujoco(mujoco: MuJoCo, reference: Reference, found: Found) -> None:
    """Not of robots of many scales, or with links that have no body: MuJoCo refuses masses and inertias below 1e-15."""
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


def _of_chain(
    chain: Mechanism, name: str, reference: Reference, found: Found, turn: int | None
) -> DynamicsModel:
    """Without E and P."""
    expands = _expands(chain)
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
    return plain


def _expands(chain: Mechanism) -> bool:
    if chain.has_mimic_joints or not all(kind.about_z for kind in chain.types):
        return False
    return len(chain) <= (EXPANDED_JOINTS if chain.is_serial else EXPANDED_BODIES)


def _of_parameters(
    model: DynamicsModel, name: str, oracle: Pinocchio, reference: Reference
) -> dict[str, float]:
    """Of base parameters by themselves: the regressor, which columns it can tell apart, and accelerations.

    Not of robots of many scales, whose mass matrices NumPy does not solve with to all digits.
    """
    rows = model.regressor(*reference.few)
    tau = reference.tau[: len(rows)]
    errors = {
        "regressor": reference.torque_error(rows @ model.known_theta_b(), tau),
        **_of_rank(rows, oracle.regressor(*reference.few), has_small_entries(scaled(model.mechanism))),
    }
    if not reference.is_singular_in("float32").any():
        errors |= _of_accelerations(model, reference, tau)
    return {f"{name}, base parameters {what}": error for what, error in errors.items()}


def _of_accelerations(model: DynamicsModel, reference: Reference, tau: Array) -> dict[str, float]:
    """By the mass matrix, and by articulated bodies where no joint follows another; of mass matrices that are well away from
    singular: links without bodies may leave none to speak of."""
    q, qd, _ = reference.few
    robot = RobotOnArrays.of(model, model.known_theta_b())
    errors = {"forward_dynamics": reference.acceleration_error(robot.accelerations(q, qd, tau))}
    if not model.mechanism.has_mimic_joints:
        given = (list(vectors.T) for vectors in (q, qd, tau))
        found = forward_dynamics(robot.frames, robot.bodies, robot.drives, *given, robot.base_acceleration)
        errors["articulated bodies"] = reference.acceleration_error(columns(found[0], len(q)))
    return errors


def _of_rank(rows: Array, standard: Array, is_fine: bool) -> dict[str, float]:
    """Base parameters too many or too few, where the rank of the standard parameters' regressor is clear; and what of that
    regressor theirs does not span, relative to its largest column.

    rows     (count, nv, l), standard (count, nv, 10 bodies)
    is_fine  whether angles or lengths are so small that a parameter's effect may be less than rounding: more of them than
             doubles can tell apart are right then, and fewer where what these leave out is rounding (seed 7624: 27 of 29,
             1.4e-15 of the largest column)
    """
    own, every = (matrix.reshape(-1, matrix.shape[-1]) for matrix in (rows, standard))
    triangle = np.linalg.qr(np.hstack([_unit_columns(own), every]), mode="r")
    left, every = triangle[own.shape[1] :, own.shape[1] :], triangle[:, own.shape[1] :]
    values = np.linalg.svd(_unit_columns(every), compute_uv=False)
    rank, most = (int((values > share * values[0]).sum()) for share in (CLEAR, UNCLEAR))
    found = {"span": _longest(left) / _longest(every)}
    more = own.shape[1] - rank
    is_rounding = is_fine and (more > 0 or found["span"] <= SPAN_ROUNDING)
    return found if most > rank or is_rounding else found | {"number": float(abs(more))}


def _longest(matrix: Array) -> float:
    """Length of the longest column."""
    return float(np.linalg.norm(matrix, axis=0).max())


def _unit_columns(matrix: Array) -> Array:
    """Columns that are more than rounding, of length one; others zero."""
    sizes = np.linalg.norm(matrix, axis=0)
    kept = sizes > COLUMN_SIZE * sizes.max()
    return np.asarray(matrix * kept / np.where(kept, sizes, 1.0))


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
