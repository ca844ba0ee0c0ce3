"""A finished model compared with other readers of the robot's source. Nothing of the derivation is used, and of the
chain only names.

Pinocchio reads the file as it is written, MuJoCo too where it is installed and reads such files. Where rotations were
snapped, the file has no such robot. Then torques are compared with Pinocchio's bodies on joints placed as the chain's
are, and the change by snapping is compared with the file's robot separately.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.recipes.recipe import Needs
from psdmc.robot.coordinates import Following
from psdmc.robot.load import LoadedRobot
from psdmc.robot.mechanism import Array, Mechanism
from psdmc.robot.mujoco_reading import NotCompared, mujoco_torques, mujoco_version
from psdmc.robot.reference import Reference, pinocchio_version, reference
from psdmc.robot.reference_followers import OnCoordinates
from psdmc.robot.snap_bound import angles_by_segment, torque_bound
from psdmc.verification.functions import function_errors
from psdmc.verification.placements import chain_poses, frames_above, gravity_error, placement_errors, reach_of
from psdmc.verification.relative_errors import NO_TORQUE, relative_error, worst
from psdmc.verification.source import compared_parameters, require_same_robot, source_of

STATES = 200
SEED = 14_630
TORQUE_LIMIT = 1e-10
"""Largest relative error that passes: a hundred times what rounding leaves, a million times less than any mistake."""

CONDITION_LIMIT = 1e-12
"""Forward dynamics passes within this times the mass matrix's condition number, and always within TORQUE_LIMIT."""

SINGULAR = 1e15
"""Condition number from which a mass matrix cannot be inverted: that of a last link without inertia, for example."""

PLACEMENT_LIMIT = 1e-11
"""rad, or share of the robot's reach: rounding leaves 1e-15, and what snapping cleans as noise 1e-13."""

MUJOCO_LIMIT = 1e-9
"""MuJoCo keeps inertias as principal moments and axes, found to 1e-12 or so."""

MUJOCO_ROUNDING = 1e-10
"""A further allowance, as a share of the robot's largest torque: MuJoCo works about the whole robot's centre of mass,
where a small joint's torque is a difference of large ones (2e-11 at most in robots whose lengths are 1e-3 to 1e3 m)."""

ANGLES_ACTED_ON = 2.0
"""Factor: an axis snapped by an angle turns what moves about it by up to twice that."""

MUJOCO = "MuJoCo's mj_inverse"
"""Text for what rows of the second reader are compared with."""


@dataclass(frozen=True, slots=True)
class CheckRow:
    """One comparison.

    name     what was compared
    against  the function of Pinocchio, or other reference, that it was compared with
    error    largest difference, relative to the largest magnitude (per joint where there is one per joint)
    limit    largest error that passes; None where nothing could be compared
    remark   why not, or what the limit allows for
    """

    name: str
    against: str
    error: float
    limit: float | None
    remark: str = ""

    @property
    def passed(self) -> bool:
        return self.limit is None or self.error <= self.limit


def check_model(model: DynamicsModel, source: LoadedRobot | None = None) -> tuple[CheckRow, ...]:
    """Every function of the model compared with Pinocchio's; `source` None: the source embedded in the model.

    A model with other parameters than its source is compared under its own where its chain has them (a payload), and
    under random physical ones where no standard parameters are known (unknown or calibrated theta_b). InputError where
    the source is another robot.
    """
    loaded = source_of(model) if source is None else source
    require_same_robot(model, loaded)
    theta, parameters = compared_parameters(model, loaded)
    written = reference(loaded, snapped=False, parameters=parameters)
    snapped = bool(loaded.snap_report)
    free = reference(loaded, parameters=parameters) if snapped else written
    robot = OnCoordinates.of(free, model.mechanism)
    angles = angles_by_segment(loaded.snap_report, model.n, loaded.options.snap)
    condition = _condition(model, robot)
    rows = (*_compared(model, theta, robot, condition), *_functions(model, theta, robot, condition))
    rows += _placements(model, written, angles)
    if snapped:
        rows += (_snapping(model, theta, written, angles),)
    return (*rows, _against_mujoco(model, loaded, angles))


def readers(rows: Sequence[CheckRow]) -> str:
    """Which readers of the source the rows come from, in words."""
    words = f"compared with Pinocchio {pinocchio_version()}'s reading of the source"
    if any(row.against == MUJOCO and row.limit is not None for row in rows):
        return f"{words} and with MuJoCo {mujoco_version()}'s"
    return words


def _states(robot: Mechanism) -> tuple[Array, Array, Array]:
    """q (STATES, nq), qd and qdd (STATES, nv)."""
    return states_of(robot, np.random.default_rng(SEED), STATES)


def _condition(model: DynamicsModel, robot: OnCoordinates) -> float:
    """The largest condition number of the mass matrix at the states that are compared."""
    return float(np.linalg.cond(robot.mass_matrix(_states(model.mechanism)[0])).max())


def _compared(
    model: DynamicsModel, theta: Array, robot: OnCoordinates, condition: float
) -> tuple[CheckRow, ...]:
    q, qd, qdd = _states(model.mechanism)
    rest = np.zeros_like(qd)
    tau = model.torques_for(theta, q, qd, qdd)
    mass = np.stack([model.torques_for(theta, q, rest, rest + unit) for unit in np.eye(model.nv)], axis=-1)
    gravity = model.torques_for(theta, q, rest, rest)
    mass = mass - gravity[..., None]
    rows = model.regressor(q, qd, qdd)
    pairs = (
        ("inverse dynamics", "rnea", tau, robot.inverse_dynamics(q, qd, qdd)),
        ("regressor times theta_b", "rnea", rows @ theta, robot.inverse_dynamics(q, qd, qdd)),
        ("mass matrix", "crba", mass, robot.mass_matrix(q)),
        (
            "nonlinear effects",
            "nonLinearEffects",
            model.torques_for(theta, q, qd, rest),
            robot.nonlinear_effects(q, qd),
        ),
        ("gravity", "computeGeneralizedGravity", gravity, robot.gravity(q)),
    )
    least = NO_TORQUE * float(np.abs(pairs[0][-1]).max(initial=0.0))
    checked = [
        CheckRow(name, against, relative_error(a, b, least), TORQUE_LIMIT) for name, against, a, b in pairs
    ]
    return (*checked, _forward(robot, q, qd, qdd, tau, condition))


def _functions(
    model: DynamicsModel, theta: Array, robot: OnCoordinates, condition: float
) -> Iterator[CheckRow]:
    """Rows of functions that are not part of the expansion."""
    if not model.is_reduced:
        remark = "a base parameter has no standard parameter of its own"
        yield CheckRow("base parameters", "their equations", np.inf, TORQUE_LIMIT, remark)
        return
    for recipe, error, lack in function_errors(model, theta, robot, condition < SINGULAR):
        limit = _solved_limit(condition) if recipe.needs is Needs.POSITIVE_MASS else TORQUE_LIMIT
        remark = lack and f"not compared: {lack}"
        yield CheckRow(recipe.title, recipe.against, error, None if lack else limit, remark)


def _solved_limit(condition: float) -> float:
    """Limit for functions that divide by the mass matrix, which lose digits with its condition number."""
    return max(TORQUE_LIMIT, CONDITION_LIMIT * condition)


def _forward(robot: OnCoordinates, q: Array, qd: Array, qdd: Array, tau: Array, condition: float) -> CheckRow:
    """Whether Pinocchio's forward dynamics gives back the accelerations that the torques were computed from."""
    name = "forward dynamics of these torques"
    if not condition < SINGULAR:
        return CheckRow(name, "aba", np.nan, None, "not compared: the mass matrix is singular")
    error = relative_error(robot.forward_dynamics(q, qd, tau), qdd)
    return CheckRow(name, "aba", error, _solved_limit(condition))


def _placements(model: DynamicsModel, written: Reference, angles: Array) -> tuple[CheckRow, ...]:
    """Rows for the placements of links and tip and for gravity, within the angles that snapping reports."""
    chain = model.mechanism
    q = Following.of(chain.coordinates, chain.types).positions(_states(model.mechanism)[0])
    links = [joint.link_name for joint in chain.joints]
    expected = written.poses(q, links)
    above = frames_above(chain)
    errors = placement_errors(chain_poses(chain, q), expected, above)
    lever = max(1.0, written.path_length / reach_of(expected, above))
    beyond = errors - ANGLES_ACTED_ON * lever * angles[:-1]
    gravity = gravity_error(chain.gravity, written.gravity_vector) - ANGLES_ACTED_ON * angles[-1]
    remark = f"beyond the {angles.sum():.2g} rad of snapping" if angles.any() else ""
    found = (
        ("placements of links and tip", "framesForwardKinematics", float(beyond.max())),
        ("gravity in the base frame", "model.gravity", gravity),
    )
    return tuple(
        CheckRow(name, against, max(0.0, error), PLACEMENT_LIMIT, remark) for name, against, error in found
    )


def _snapping(model: DynamicsModel, theta: Array, written: Reference, angles: Array) -> CheckRow:
    """The row for snapping: torques compared with the file's own rotations, within the change that its angles allow."""
    states, robot = _states(model.mechanism), OnCoordinates.of(written, model.mechanism)
    expected = robot.inverse_dynamics(*states)
    bound = _bound(robot, angles, states)
    error, limit = worst(model.torques_for(theta, *states), expected, bound, TORQUE_LIMIT)
    return CheckRow(
        "effect of snapped rotations", "rnea", error, limit, "the limit is what the angles can do"
    )


def _against_mujoco(model: DynamicsModel, loaded: LoadedRobot, angles: Array) -> CheckRow:
    """The row for torques of the source's own bodies, compared with MuJoCo's."""
    states = _states(model.mechanism)
    try:
        following = Following.of(loaded.mechanism.coordinates, loaded.mechanism.types)
        free = (following.positions(states[0]), *map(following.rates, states[1:]))
        expected = following.summed(mujoco_torques(loaded, *free))
    except NotCompared as reason:
        return CheckRow("inverse dynamics", MUJOCO, np.nan, None, f"not compared: {reason}")
    tau = model.torques_for(model.B @ loaded.mechanism.parameters.reshape(-1), *states)
    bound = np.full(model.nv, MUJOCO_ROUNDING * float(np.abs(expected).max(initial=0.0)))
    if not angles.any():
        return CheckRow("inverse dynamics", MUJOCO, *worst(tau, expected, bound, MUJOCO_LIMIT))
    written = OnCoordinates.of(reference(loaded, snapped=False), loaded.mechanism)
    bound += _bound(written, angles, states)
    figures = worst(tau, expected, bound, MUJOCO_LIMIT)
    return CheckRow("inverse dynamics", MUJOCO, *figures, "the limit is what snapping can do")


def _bound(robot: OnCoordinates, angles: Array, states: tuple[Array, Array, Array]) -> Array:
    """(nv,) what the angles can change of each coordinate's torque."""
    bound = torque_bound(robot.free, angles, *robot.on_joints(*states))
    return np.asarray(bound @ np.abs(robot.following.ratios))
