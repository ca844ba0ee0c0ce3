"""Selects the limits and collisions for which planned motions are checked, and describes these checks in sentences.

The sentences also say which checks were not possible, and why.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.motions.allowed import Allowed, TorqueLimits
from psdmc.calibration.motions.clearance import APART, Clearance, FloorPoints, clearance_of, floor_points
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.linear_friction import linear_friction
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Mechanism

LISTED = 4
"""Names in a sentence; the others are counted."""


def allowed_of(
    model: DynamicsModel,
    chain: Mechanism,
    regressor: Regressor,
    torque_margin: float,
    shapes: Sequence[Path] | None,
    floor: float | None,
) -> Allowed:
    """Return the limits and collision checks for planned motions of a model's robot.

    Torques are limited if the base parameters theta_b are known and a joint has a torque limit. Collisions are checked
    if the model contains collision shapes.

    chain          the model's robot, with the limits that the motions must keep
    regressor      object that computes the regressor of the robot
    torque_margin  share of the torque limits that a motion may use
    shapes         folders of meshes; None: shapes are not checked
    floor          m, height of a floor above the base's origin; None: no floor

    Raises InputError if a floor that cannot be checked is given, or if meshes are missing.
    """
    clearance: Clearance | FloorPoints | None = None
    if shapes is not None:
        try:
            clearance = clearance_of(model, shapes, floor)
        except InputError:
            if shapes:
                raise
    if clearance is None and floor is not None:
        clearance = floor_points(chain, floor)
    return Allowed(chain, _torques(model, chain, regressor), torque_margin, clearance)


def _torques(model: DynamicsModel, chain: Mechanism, regressor: Regressor) -> TorqueLimits | None:
    largest = np.array([joint.limits.effort for joint in chain.joints])
    largest = np.where(largest > 0, largest, np.inf)
    if model.theta_b is None or not np.isfinite(largest).any():
        return None
    try:
        friction = linear_friction(model).by_speed if model.calibrated else None
    except InputError:
        friction = None  # of a campaign: it has a state
    return TorqueLimits(chain, regressor, largest, model.theta_b, friction)


def looked_at(
    allowed: Allowed, model: DynamicsModel, shapes: Sequence[Path] | None, floor: float | None
) -> tuple[str, ...]:
    """Return one sentence each on the checks of torques, shapes and floor."""
    return (_of_torques(allowed, model), _of_shapes(allowed, model, shapes), _of_floor(allowed, floor))


def _of_torques(allowed: Allowed, model: DynamicsModel) -> str:
    if allowed.torques is None:
        why = (
            "theta_b is unknown"
            if model.theta_b is None
            else "no joint has an effort limit (--effort JOINT=NM)"
        )
        return f"not checked: torques, {why}"
    bare = [
        name
        for name, value in zip(allowed.chain.joint_names, allowed.torques.largest, strict=True)
        if np.isinf(value)
    ]
    beside = f"; joint(s) {_listed(bare)} have no limit" if bare else ""
    with_friction = "with" if allowed.torques.friction is not None else "without"
    return f"torques: by theta_b {with_friction} friction, at most {allowed.torque_margin:.0%} of the limits{beside}"


def _of_shapes(allowed: Allowed, model: DynamicsModel, shapes: Sequence[Path] | None) -> str:
    found = allowed.clearance
    if isinstance(found, Clearance):
        beside = f"; not {_listed(found.always)}, which touch in every pose" if found.always else ""
        return (
            f"self-collision: {len(found.pairs)} pairs of shapes stay {1000 * APART:g} mm apart, neighbours aside{beside};"
            " a load or cables have no shape"
        )
    if shapes is None:
        return "not checked: self-collision, as asked for (--no-collisions)"
    try:
        clearance_of(model, shapes)
    except InputError as error:
        return f"not checked: self-collision, {error.message}{f' ({error.hint})' if error.hint else ''}"
    return "not checked: self-collision"


def _of_floor(allowed: Allowed, floor: float | None) -> str:
    if floor is None:
        return "not checked: floor and surroundings (give the floor's height above the base's origin, m: --floor HEIGHT)"
    by = (
        "shapes"
        if isinstance(allowed.clearance, Clearance)
        else "origins of joints and the tip, not their bodies,"
    )
    return f"floor at {floor:g} m: {by} stay {1000 * APART:g} mm above; other surroundings are not checked"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(shown(name) if " and " not in name else name for name in names[:LISTED]) + more
