"""Makes the result of a four-step calibration (motors, gravity, friction, inertia) physically consistent.

Base parameters theta_b and LuGre friction (a friction model with bristles) form one vector. Each step contributes a
cost for changes of the vector.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.four_steps import FourSteps
from psdmc.calibration.identify.friction import FrictionResult
from psdmc.calibration.identify.friction_fit import JointFriction, step_sizes, to_seven, unknowns_of
from psdmc.calibration.identify.physical import nearest_physical, whitening_of
from psdmc.calibration.logs.log import Array
from psdmc.friction.state import STATE_LAW
from psdmc.links.link_terms import PhysicalOptions
from psdmc.model.dynamics_model import DynamicsModel

SEVEN = 7
NEVER_NEGATIVE = tuple(not value.logarithmic for value in STATE_LAW.values)
"""Of F_c, F_s - F_c, ln v_s, F_v, d_v, ln sigma_0, sigma_1. By the logarithms v_s and sigma_0 are positive; F_s >= F_c."""
NEAR = 0.5
"""Step sizes by which a friction parameter may change that its run does not show: the relative standard deviation from
which it is called unseen."""
HELD = 1e-6
"""Step sizes by which a parameter may change that the friction law fixes: none, to the solver's accuracy."""
SMALLEST = np.where(NEVER_NEGATIVE, STATE_LAW.bounds[0], -np.inf)
"""Of the seven, as the friction run's own bounds, so that a value that the solver leaves on a bound is one of the law's."""


@dataclass(frozen=True, slots=True, eq=False)
class PhysicalSteps:
    """The physically possible result of a four-step calibration (motors, gravity, friction, inertia).

    theta_b   (l,) base parameters
    found     results of the four steps, with friction adapted to theta_b
    distance  distance from the unconstrained result, in standard deviations
    """

    theta_b: Array
    found: FourSteps
    distance: float


def physical_steps(
    model: DynamicsModel, found: FourSteps, options: PhysicalOptions | None = None
) -> PhysicalSteps:
    """Return the physically possible base parameters theta_b and LuGre friction nearest to the result of a calibration.

    The calibration has four steps: motors, gravity, friction and inertia. The cost of a change is the sum of three
    costs, those of gravity, friction and inertia. The first is for phi, the base parameters that affect gravity. The
    second is for each joint's seven friction parameters. The third is for psi, the other base parameters, whose
    estimate depends on phi and friction. So friction adapts to a change of theta_b, as far as the friction runs allow.
    Torque constants do not change.
    """
    joints = found.friction.joints
    unknowns = {name: unknowns_of(joint)[:SEVEN] for name, joint in joints.items()}
    vector = np.concatenate([found.inertial.theta_b, *unknowns.values()])
    near = nearest_physical(
        model, vector, _whitening(found, len(vector)), _bounded(model.l, len(joints)), options
    )
    moved = {
        name: _moved(joints[name], near.values[model.l + SEVEN * k : model.l + SEVEN * (k + 1)])
        for k, name in enumerate(joints)
    }
    friction = FrictionResult(moved, found.friction.warnings)
    return PhysicalSteps(near.values[: model.l], replace(found, friction=friction), near.distance)


def _bounded(l: int, joints: int) -> NDArray[np.bool_]:
    return np.concatenate([np.zeros(l, dtype=bool), np.tile(NEVER_NEGATIVE, joints)])


def _moved(joint: JointFriction, seven: Array) -> JointFriction:
    fixed = np.diag(joint.covariance) == 0.0
    kept = np.where(fixed, unknowns_of(joint)[:SEVEN], np.maximum(seven, SMALLEST))
    return replace(joint, friction=STATE_LAW.from_unknowns(kept))


def _whitening(found: FourSteps, size: int) -> Array:
    """W with |W d|^2 the steps' summed cost of a change d of the vector, in variances."""
    inertial, split = found.inertial, found.gravity.split
    l, r, n = len(inertial.theta_b), len(split.pivots), len(found.motors.relative_std)
    joints = list(found.friction.joints.values())
    by_phi = np.zeros((r, size))
    by_phi[:, split.pivots], by_phi[:, split.rest] = np.eye(r), split.dependence
    by_psi = np.zeros((len(split.rest), size))
    by_psi[:, split.rest] = np.eye(len(split.rest))
    moves = inertial.estimate.considered
    by_psi -= moves[:, n : n + r] @ by_phi
    own = []
    for k, joint in enumerate(joints):
        place = slice(l + SEVEN * k, l + SEVEN * (k + 1))
        turn = to_seven(joint.friction)[:, :SEVEN]
        by_psi[:, place] -= moves[:, n + r + SEVEN * k : n + r + SEVEN * (k + 1)] @ turn
        rows = np.zeros((2 * SEVEN, size))
        rows[:, place] = _friction_rows(joint, turn)
        own.append(rows)
    return np.vstack([found.gravity.estimate.whitening @ by_phi, inertial.estimate.whitening @ by_psi, *own])


def _friction_rows(joint: JointFriction, turn: Array) -> Array:
    """(14, 7) of one joint: its run's cost, and rows that keep the values that the run does not show."""
    back = np.linalg.inv(turn)
    covariance = back @ joint.covariance @ back.T
    free = np.flatnonzero(np.diag(covariance) > 0)
    rows = np.zeros((2 * SEVEN, SEVEN))
    rows[np.ix_(free, free)] = whitening_of(covariance[np.ix_(free, free)])
    reach = step_sizes(unknowns_of(joint))[:SEVEN] * np.where(np.diag(covariance) > 0, NEAR, HELD)
    rows[SEVEN:] = np.diag(1.0 / reach)
    return rows
