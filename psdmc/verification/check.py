"""Compares a model with other programs' dynamics of the same robot file. It uses no code of the derivation.

Pinocchio reads the original file, and so does MuJoCo if it is installed and reads this format. Snapped rotations were
replaced by near ones with exact zeros. For a model with snapped rotations, Pinocchio's joints are placed as in the
model. The change of torques by snapping is checked separately, against the original file.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import random_parameters, states_of
from psdmc.robot.coordinates import MimicMap
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.mechanism import BASE, PARAMETERS_PER_LINK, Array, Mechanism, Placement
from psdmc.robot.mujoco_reading import NotCompared, mujoco_torques, mujoco_version
from psdmc.robot.reference import OnCoordinates, Reference, pinocchio_version, reference
from psdmc.robot.snap_bound import angles_by_segment, torque_bound
from psdmc.verification.functions import SINGULAR, TORQUE_LIMIT, function_errors, solved_limit

STATES = 200
SEED = 14_630
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
    """The result of one comparison between the model and a reference.

    name     what was compared
    against  the function of Pinocchio, or other reference, that it was compared with
    error    largest difference, divided by the largest magnitude; for values per joint, divided joint by joint
    limit    largest error that passes; None if nothing could be compared
    remark   why nothing could be compared, or what the limit allows for
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
    """Compare every function of the model with Pinocchio and return one CheckRow for each comparison.

    source  the robot to compare with; None: the robot in the source text that the model contains

    If the model's parameters differ from those of the source, the model's standard parameters are used if they are
    known (after a payload was added). Else random physically possible parameters are used (theta_b unknown or
    calibrated). Raises InputError if the source is another robot.
    """
    loaded = source_of(model) if source is None else source
    require_same_robot(model, loaded)
    loaded = with_passive_joints(model, loaded)
    theta, parameters = compared_parameters(model, loaded)
    written = reference(loaded, snapped=False, parameters=parameters)
    snapped = bool(loaded.snap_report)
    free = reference(loaded, parameters=parameters) if snapped else written
    robot = OnCoordinates.of(free, model.mechanism)
    angles = angles_by_segment(loaded.snap_report, model.n, loaded.options.snap)
    condition = float(np.linalg.cond(robot.mass_matrix(_states(model.mechanism)[0])).max())
    rows = (*_compared(model, theta, robot, condition), *_functions(model, theta, robot, condition))
    rows += _placements(model, written, angles)
    if snapped:
        rows += (_snapping(model, theta, written, angles),)
    return (*rows, _against_mujoco(model, loaded, angles))


def readers(rows: Sequence[CheckRow]) -> str:
    """Return in words which programs the results were compared with, and their versions."""
    words = f"compared with Pinocchio {pinocchio_version()}'s reading of the source"
    if any(row.against == MUJOCO and row.limit is not None for row in rows):
        return f"{words} and with MuJoCo {mujoco_version()}'s"
    return words


def _states(robot: Mechanism) -> tuple[Array, Array, Array]:
    """q (STATES, nq), qd and qdd (STATES, nv)."""
    return states_of(robot, np.random.default_rng(SEED), STATES)


def _compared(
    model: DynamicsModel, theta: Array, robot: OnCoordinates, condition: float
) -> tuple[CheckRow, ...]:
    q, qd, qdd = _states(model.mechanism)
    rest = np.zeros_like(qd)
    tau = model.torques_for(theta, q, qd, qdd)
    gravity = model.torques_for(theta, q, rest, rest)
    along = q[:, None].repeat(model.nv, axis=1)
    still = np.zeros((STATES, model.nv, model.nv))
    mass = (
        np.swapaxes(model.torques_for(theta, along, still, still + np.eye(model.nv)), 1, 2)
        - gravity[..., None]
    )
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
    for recipe, error, limit, remark in function_errors(model, theta, robot, condition):
        yield CheckRow(recipe.title, recipe.against, error, limit, remark)


def _forward(robot: OnCoordinates, q: Array, qd: Array, qdd: Array, tau: Array, condition: float) -> CheckRow:
    """Whether Pinocchio's forward dynamics gives back the accelerations that the torques were computed from."""
    name = "forward dynamics of these torques"
    if not condition < SINGULAR:
        return CheckRow(name, "aba", np.nan, None, "not compared: the mass matrix is singular")
    error = relative_error(robot.forward_dynamics(q, qd, tau), qdd)
    return CheckRow(name, "aba", error, solved_limit(condition))


def _placements(model: DynamicsModel, written: Reference, angles: Array) -> tuple[CheckRow, ...]:
    """Rows for the placements of links and tip and for gravity, within the angles that snapping reports."""
    chain = model.mechanism
    q = MimicMap.of(chain.coordinates, chain.types).positions(_states(model.mechanism)[0])
    links = [joint.link_name for joint in chain.joints]
    expected = written.poses(q, links)
    above = (*chain.parents, chain.tip_body)
    errors = placement_errors(_poses(chain, q), expected, above)
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
        mimic_map = MimicMap.of(loaded.mechanism.coordinates, loaded.mechanism.types)
        free = (mimic_map.positions(states[0]), *map(mimic_map.rates, states[1:]))
        expected = mimic_map.summed(mujoco_torques(loaded, *free))
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
    return np.asarray(bound @ np.abs(robot.mimic_map.ratios))


def placement_errors(found: Array, expected: Array, above: Sequence[int]) -> Array:
    """Return the largest errors (n + 1,) of poses. These are the poses of n links relative to their parent links, and
    of the tip relative to its link.

    found, expected   (k, n + 1, 4, 4), poses in the base frame at k states
    above             parents of the n + 1 frames: index or BASE

    An error is the larger of the angle (rad) and the distance divided by the robot's reach.
    """
    reach = reach_of(expected, above)
    own, other = _in_the_one_above(found, above), _in_the_one_above(expected, above)
    chord = np.linalg.norm((own - other)[..., :3, :3], axis=(-2, -1)) / np.sqrt(8.0)
    angle = 2.0 * np.arcsin(np.minimum(1.0, chord))
    distance = np.linalg.norm((own - other)[..., :3, 3], axis=-1) / reach
    return np.asarray(np.maximum(angle, distance).max(axis=0))


def gravity_error(found: Array, expected: Array) -> float:
    """Return the distance between two gravity vectors (3,), divided by the length of the larger one."""
    size = max(float(np.linalg.norm(found)), float(np.linalg.norm(expected)), np.finfo(float).tiny)
    return float(np.linalg.norm(found - expected)) / size


def reach_of(poses: Array, above: Sequence[int]) -> float:
    """Return the reach of a robot in m: the length of the longest path from the base outward. The length of a path is
    the sum of the largest distances between neighbouring frames. If all are zero, the reach is 1."""
    steps = np.linalg.norm(_in_the_one_above(poses, above)[..., :3, 3], axis=-1).max(axis=0)
    far: list[float] = []
    for step, outer in zip(steps.tolist(), above, strict=True):
        far.append(step + (0.0 if outer == BASE else far[outer]))
    return max(far) or 1.0


def _in_the_one_above(poses: Array, above: Sequence[int]) -> Array:
    base = np.broadcast_to(np.eye(4), (len(poses), 1, 4, 4))
    return np.linalg.inv(np.concatenate([poses, base], axis=1)[:, list(above)]) @ poses


def _poses(chain: Mechanism, q: Array) -> Array:
    """(k, n + 1, 4, 4) poses of the links and of the tip in the base frame, at k states."""
    frames: list[Array] = []
    values = np.split(q, np.cumsum([kind.nq for kind in chain.types])[:-1], axis=1)
    for joint, parent, value in zip(chain.joints, chain.parents, values, strict=True):
        moved = np.array([_matrix(joint.type.transform(row)) for row in value.tolist()])
        placed = _matrix(joint.placement) @ moved
        frames.append(placed if parent == BASE else frames[parent] @ placed)
    links = [frame @ _matrix(joint.link_frame) for frame, joint in zip(frames, chain.joints, strict=True)]
    return np.stack([*links, frames[chain.tip_body] @ _matrix(chain.tip)], axis=1)


def _matrix(place: Placement) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = place.rotation, place.translation
    return matrix


# Differences relative to the size of torques and matrices, joint by joint.
NO_TORQUE = 1e-9
"""Share of the largest torque below which a joint's torque is rounding."""


def worst(values: Array, expected: Array, bound: Array, share: float) -> tuple[float, float]:
    """Return the error and the limit of the joint whose error is closest to the limit. Both are relative to the joint's
    largest torque.

    values, expected  torques (states, nv)
    bound             (nv,) errors that are allowed in addition to the fraction `share` of the joint's largest torque
    """
    scale = _scales(expected)
    error = np.abs(values - expected).max(axis=0)
    joint = int(np.argmax(error / (bound + share * scale)))
    return float(error[joint] / scale[joint]), float(bound[joint] / scale[joint]) + share


def relative_error(values: Array, expected: Array, least: float = 0.0) -> float:
    """Return the largest difference, divided joint by joint by the joint's largest magnitude. A matrix counts as one
    quantity and is divided by its largest entry.

    A joint's torques can be below NO_TORQUE of the largest torque, as for a vertical axis under gravity. The joint's
    error is then relative to the largest torque of all joints. If all torques are below `least`, errors are relative to
    `least` / NO_TORQUE.
    """
    if expected.ndim == 3:
        return float(np.abs(values - expected).max()) / _largest(expected)
    return float((np.abs(values - expected).max(axis=0) / _scales(expected, least)).max())


def _largest(expected: Array) -> float:
    """The largest magnitude, never zero."""
    return max(float(np.abs(expected).max(initial=0.0)), float(np.finfo(float).tiny))


def _scales(expected: Array, least: float = 0.0) -> Array:
    """(nv,) scale that each joint's error is relative to."""
    overall = _largest(expected)
    if overall < least:
        return np.full(expected.shape[-1], least / NO_TORQUE)
    largest = np.abs(expected).max(axis=0)
    return np.where(largest > NO_TORQUE * overall, largest, overall)


# The robot with which a model is compared
#
# It is read from the file of which the model was derived. Its parameters are those that both it and the
# model can have.


def source_of(model: DynamicsModel) -> LoadedRobot:
    """Return the robot from which the model was derived, read again from the source text that the model contains."""
    kept = model.provenance
    if not {"source_text", "source_format", "options"} <= set(kept):
        raise InputError(f"the model of '{model.mechanism.name}' holds no source", "give the robot's file")
    name = str(kept.get("source_name", "robot"))
    return load_robot_text(kept["source_text"], kept["source_format"], source_name=name, **kept["options"])


def with_passive_joints(model: DynamicsModel, loaded: LoadedRobot) -> LoadedRobot:
    """Return the source with the passive joints of the model, which `derive` may have chosen."""
    pairs = zip(loaded.mechanism.loops, model.mechanism.loops, strict=False)
    loops = tuple(replace(loop, passive=own.passive) for loop, own in pairs)
    return replace(loaded, mechanism=replace(loaded.mechanism, loops=loops)) if loops else loaded


def require_same_robot(model: DynamicsModel, loaded: LoadedRobot) -> None:
    """Raise InputError if the joints or links of the source differ from those of the model."""
    found, expected = loaded.mechanism, model.mechanism
    for what, there, here in (
        ("joints", found.joint_names, expected.joint_names),
        ("links", _links(found), _links(expected)),
    ):
        if there != here:
            raise InputError(
                f"{loaded.source_name} has {what} {', '.join(there)}, the model has {', '.join(here)}",
                "give the file, base and tip that the model was derived from",
            )


def _links(mechanism: Mechanism) -> tuple[str, ...]:
    return tuple(joint.link_name for joint in mechanism.joints)


def compared_parameters(model: DynamicsModel, loaded: LoadedRobot) -> tuple[Array, Array | None]:
    """Return the base parameters theta_b (l,) and the standard parameters (n, 11) with which the model and Pinocchio
    are compared. None instead of the standard parameters means those of the source."""
    if model.theta_b is not None:
        theta = np.asarray(model.theta_b)
        for known in (loaded.mechanism.parameters, model.mechanism.parameters):
            if _gives(theta, model.B, known):
                return theta, None if known is loaded.mechanism.parameters else known
    x = random_parameters(model.mechanism)
    return model.B @ x, x.reshape(model.n, PARAMETERS_PER_LINK)


def _gives(theta: Array, B: Array, parameters: Array) -> bool:
    """Whether standard parameters (n, 11) are known and have these base parameters."""
    if np.isnan(parameters).any():
        return False
    return bool(np.allclose(B @ parameters.reshape(-1), theta, rtol=1e-9, atol=1e-12))
