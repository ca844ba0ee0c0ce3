"""Checks of what a model's parameters suffice for: forward dynamics, functions of single links, gravity as an input.

A measured or published theta_b may belong to no possible bodies. Some accelerations then have negative kinetic energy,
and a controller that divides by the mass matrix acts in the wrong direction. So the mass matrix is tested in random
poses within the joint limits.

Torques determine only combinations of the links' masses, centres and inertias, the base parameters. Gravity along an
axis or a plane of the robot hides more of them. The first joint of a SCARA robot is vertical, so its weight exerts no
torque on it. Base parameters for a general direction of gravity suffice for every direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.coordinates import positions
from psdmc.dynamics.frames import frames_of
from psdmc.errors import InputError
from psdmc.model import evaluate
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints, random_parameters, states_of
from psdmc.reproducible import times
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Joint, Mechanism

POSES = 2000
"""Number of poses, each joint drawn evenly within its limits."""
SEED = 88_061
STACK = 1 << 24
"""Bytes of mass matrices that are factorised at once: their factors take as much again."""
ROUNDING = 64 * float(np.finfo(float).eps)
"""Share below which a number is rounding and counts as zero: of the magnitudes that are summed in an inertia, and of a
matrix's largest eigenvalue, every joint in its own unit."""

BELONGS = 1e-9
"""Share of the largest base parameter by which B x may differ from theta_b: both were rounded."""

DIRECTION = (4.27, -3.19, -8.23)
"""m/s^2, along no axis, plane or diagonal that robots have."""

OTHERS = ((9.1, 2.3, 1.7), (-1.9, 8.7, 3.1))
"""m/s^2, for which the base parameters are tested."""

GRAVITY_STATES, GRAVITY_SEED = 8, 20_261_128

HIDDEN = 1e-9
"""Torque, as a share of a joint's largest one, beyond which a model lacks a parameter. Rounding leaves less than 1e-12."""


@dataclass(frozen=True, slots=True, eq=False)
class MassCheck:
    """Result of a test of whether the mass matrix is positive definite in `poses` poses within the joint limits.

    failing   number of poses in which the mass matrix is not positive definite
    smallest  smallest eigenvalue of all poses, kg m^2 (kg if only sliding joints take part)
    pose      (nq,) pose with the smallest eigenvalue, rad or m
    joint     name of the joint with the largest entry in the eigenvector
    """

    poses: int
    failing: int
    smallest: float
    pose: Array
    joint: str

    @property
    def passed(self) -> bool:
        return self.failing == 0

    @property
    def reason(self) -> str:
        """Return a sentence on in how many poses the mass matrix is positive definite, and its least eigenvalue."""
        pose = ", ".join(f"{value:.3g}" for value in self.pose)
        found = f"smallest eigenvalue {self.smallest:.3g} at q = [{pose}], mostly joint {self.joint!r}"
        if self.passed:
            return f"the mass matrix is positive definite in {self.poses:,} of {self.poses:,} poses; {found}"
        return (
            f"the mass matrix is not positive definite in {self.failing:,} of {self.poses:,} poses within the joint "
            f"limits; {found}"
        )


def check_mass_matrix(model: DynamicsModel) -> MassCheck | None:
    """Return the result of a test of the mass matrix M(q) in POSES random poses within the joint limits. The poses are
    equal in each call. The result is None if the base parameters are unknown."""
    if model.theta_b is None:
        return None
    poses, mass, rounding = _drawn(model)
    failing = ~_is_definite(mass, rounding)
    smallest = np.linalg.eigvalsh(mass)[:, 0]
    worst = int(np.argmin(np.where(failing == failing.any(), smallest, np.inf)))
    moved = int(np.argmax(np.abs(np.linalg.eigh(mass[worst]).eigenvectors[:, 0])))
    joint = model.joint_names[model.mechanism.rate_joints[moved]]
    return MassCheck(POSES, int(failing.sum()), float(smallest[worst]), poses[worst], joint)


def is_surely_positive(model: DynamicsModel) -> bool:
    """Return True if a fast test shows that M(q) is positive definite in all poses of `check_mass_matrix`. Return False
    if eigenvalues have to decide, or if the base parameters are unknown.

    The test uses Cholesky factors, which take a fraction of the time of eigenvalues. Each mass matrix is scaled to an n
    x n matrix A with ones on the diagonal. A - s I has a Cholesky factor only if A's least eigenvalue is above s, up to
    the error of the factor, n (n + 1) eps. Source: Higham, Accuracy and Stability of Numerical Algorithms, theorem
    10.3.
    """
    if model.theta_b is None:
        return False
    _, mass, rounding = _drawn(model)
    n = mass.shape[-1]
    shift = n * (ROUNDING + (n + 1) * float(np.finfo(float).eps))
    for part in np.array_split(mass, max(1, mass.nbytes // STACK)):
        inertias = np.einsum("pii->pi", part)
        if not np.all(inertias > np.maximum(rounding, 0.0)):
            return False
        try:
            np.linalg.cholesky(_in_own_units(part) - shift * np.eye(n))
        except np.linalg.LinAlgError:
            return False
    return True


def _drawn(model: DynamicsModel) -> tuple[Array, Array, Array]:
    """(POSES, nq) poses within the joint limits, (POSES, nv, nv) their mass matrices, and (nv,) the inertia of each rate
    that is rounding."""
    own = [model.mechanism.joints[i] for i in model.mechanism.own_joints]
    ranges = [_range(joint) for joint in own for _ in range(joint.type.nq)]
    low, high = (np.array(bound) for bound in zip(*ranges, strict=True))
    drawn = np.random.default_rng(SEED).uniform(low, high, size=(POSES, model.nq))
    poses = on_joints(model.mechanism, drawn)
    mass = evaluate.mass_matrix(model.mechanism, model.equivalent_parameters(), poses)
    return poses, mass, ROUNDING * _magnitudes(model, np.abs(poses).max(axis=0))


def _is_definite(mass: Array, smallest: Array) -> NDArray[np.bool_]:
    """Return (poses,) whether M is positive definite. Each joint is in the unit in which its own inertia is one, so that a
    finger's inertia does not count as rounding of its arm's. `smallest` (nv,) is the inertia below which a rate has
    none."""
    inertias = np.einsum("pii->pi", mass)
    values = np.linalg.eigvalsh(_in_own_units(mass))
    sound: NDArray[np.bool_] = np.all(inertias > smallest, axis=1) & (values[:, 0] > ROUNDING * values[:, -1])
    return sound


def _in_own_units(mass: Array) -> Array:
    """M of poses, each joint in the unit in which its own inertia is one, if it has any."""
    inertias = np.einsum("pii->pi", mass)
    roots = np.sqrt(np.where(inertias > 0.0, inertias, 1.0))
    scaled: Array = mass / roots[:, :, None]
    scaled /= roots[:, None, :]
    return scaled


def _magnitudes(model: DynamicsModel, travel: Array) -> Array:
    """(nv,) sum of the magnitudes that the parameters contribute to the inertia of each rate. `travel` (nq,) is how far
    sliding joints move."""
    mechanism = model.mechanism
    x = np.abs(model.equivalent_parameters()).reshape(model.n, PARAMETERS_PER_LINK)
    masses, firsts, seconds = x[:, 0], x[:, 1:4].sum(axis=1), x[:, 4:10].sum(axis=1)
    slides = [[not any(angular) for _, angular in joint.type.twists] for joint in mechanism.joints]
    result = [[drive] * len(rates) for drive, rates in zip(x[:, 10].tolist(), slides, strict=True)]
    steps = [
        math.hypot(*joint.placement.translation) + _distance(joint, own)
        for joint, own in zip(mechanism.joints, _travels(mechanism, travel), strict=True)
    ]
    for body, joint in enumerate(mechanism.joints):
        far = math.hypot(*joint.link_frame.translation)
        for i in reversed(mechanism.path_to(body)):
            turned = seconds[body] + 2.0 * far * firsts[body] + far**2 * masses[body]
            for k, along in enumerate(slides[i]):
                result[i][k] += masses[body] if along else turned
            far += steps[i]
    for i, coordinate in enumerate(mechanism.coordinates):
        for leader, ratio in coordinate.shares if coordinate.leader != i else ():
            result[leader][0] += ratio**2 * result[i][0]
    return np.array([own for i in mechanism.own_joints for own in result[i]])


def _travels(mechanism: Mechanism, travel: Array) -> list[Any]:
    """Return how far each joint's own coordinates go. A mimic joint has its leader's, times its ratio, and its offset."""
    own = dict(zip(mechanism.own_joints, positions(frames_of(mechanism), travel.tolist()), strict=True))
    return [
        own[i]
        if i in own
        else sum(abs(ratio) * own[leader] for leader, ratio in other.shares) + abs(other.offset)
        for i, other in enumerate(mechanism.coordinates)
    ]


def _distance(joint: Joint, travel: Any) -> float:
    """How far a joint goes."""
    if joint.type.about_z:
        return abs(float(joint.type.slide(travel) or 0.0))
    return math.hypot(*(joint.type.displacement(travel) or (0.0,)))


def _range(joint: Joint) -> tuple[float, float]:
    free = joint.type.free_range
    low, high = joint.limits.lower, joint.limits.upper
    return (low if np.isfinite(low) else -free, high if np.isfinite(high) else free)


def lack_of_standard_parameters(model: DynamicsModel) -> str | None:
    """Return a sentence on why the model lacks mass, centre and inertia of some link; None if it has them."""
    parameters = model.mechanism.parameters
    if np.isnan(parameters).any():
        return "it needs mass and inertia of every link, and some are unknown"
    if not parameters[:, 0].sum() > 0.0:
        return "it needs mass, and the links have none"
    theta = times(model.B, parameters.reshape(-1))
    if model.theta_b is None or np.abs(theta - model.theta_b).max() > BELONGS * np.abs(theta).max():
        return (
            "it needs mass and inertia of every link, which torques do not show, and the model's base parameters are "
            "not those of the links in its file"
        )
    return None


def under_general_gravity(chain: Mechanism) -> Mechanism:
    """Return the robot with gravity in a general direction."""
    return replace(chain, gravity=np.array(DIRECTION))


def for_every_gravity(model: DynamicsModel) -> DynamicsModel:
    """Return the model with gravity in a general direction. Its code depends on no property of the file's gravity.

    Raises InputError if the base parameters do not determine the torques under every gravity. Then a change of the link
    parameters that the model does not see changes torques.
    """
    chain = model.mechanism
    x = random_parameters(chain)
    seen = times(model.representative, times(model.B, x))
    states = list(states_of(chain, np.random.default_rng(GRAVITY_SEED), GRAVITY_STATES))
    for gravity in OTHERS:
        turned = replace(chain, gravity=np.array(gravity))
        torques = evaluate.torques(turned, x, states)
        largest = np.abs(torques).max(axis=0)
        lacking = np.abs(evaluate.torques(turned, seen, states) - torques).max(axis=0)
        if (lacking > HIDDEN * largest).any():
            raise InputError(
                f"{shown(chain.name)}: its base parameters determine the torques under the gravity of its file only",
                "derive the model with --gravity-input (gravity_input=True)",
            )
    return replace(model, mechanism=under_general_gravity(chain))
