"""Friction that robot files can hold: a constant torque against the motion, and viscous damping."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from psdmc.friction.joints import rows_of
from psdmc.friction.law import Row
from psdmc.friction.laws import LAWS
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Joint

ORDINARY_SPEED = 1.0
"""rad/s (m/s) up to which friction is made a line where the joint has no speed limit."""


@dataclass(frozen=True, slots=True)
class JointFriction:
    """Friction of one joint as two numbers, neither negative. `constant` is a torque against the motion, N m (N for a
    sliding joint), and `damping` is N m s/rad (N s/m for a sliding joint).

    lost  in words, which parts of the calibrated friction the two numbers cannot express
    """

    constant: float
    damping: float
    lost: tuple[str, ...] = ()


def joint_friction(model: DynamicsModel) -> dict[str, JointFriction]:
    """Return the friction of each calibrated joint, by joint name; empty if the model is not calibrated.

    Each friction law gives the constant torque and the damping that are nearest to it, if it has any.
    """
    calibrated = model.calibrated
    if calibrated is None:
        return {}
    joints = {joint.name: joint for joint in model.mechanism.joints}
    found: dict[str, dict[str, float]] = {}
    for row in calibrated.friction:
        if row.joint in joints and math.isfinite(row.value):
            found.setdefault(row.joint, {})[row.name] = row.value
    law = calibrated.prediction
    word, laws, matrix = ("", LAWS, ()) if law is None else (law.law, law.laws, law.coupling)
    coupled = _coupled(matrix, model.joint_names)
    return {
        name: JointFriction(0.0, 0.0, (COUPLED,))
        if name in coupled
        else _of(rows_of(values, word, laws), joints[name])
        for name, values in found.items()
    }


COUPLED = "friction of motors that drive several joints together"


def _coupled(matrix: Sequence[Sequence[float]], names: Sequence[str]) -> set[str]:
    """Joints that share a motor with another one, of the coupling matrix of the calibration."""
    return {
        names[k]
        for i, row in enumerate(matrix)
        for j, value in enumerate(row)
        if i != j and value
        for k in (i, j)
    }


def _of(rows: Sequence[Row], joint: Joint) -> JointFriction:
    constant, damping, lost = 0.0, 0.0, []
    top = joint.limits.speed if math.isfinite(joint.limits.speed) else ORDINARY_SPEED
    for term, p in rows:
        if term.law.line is None:
            lost += [f"{term.law.about.rstrip('.')} ({term.law.name})"] if any(p) else []
            continue
        own = term.law.line(p, term.number or 0.0, top)
        constant, damping = constant + own[0], damping + own[1]
        if own[2] and any(p):
            lost.append(f"{own[2]} (up to {top:.3g} {joint.type.position_unit}/s a line stands for it)")
    if constant < 0.0 or damping < 0.0:
        lost.append("friction that is negative")
    return JointFriction(max(constant, 0.0), max(damping, 0.0), tuple(lost))


def lost_notes(found: Mapping[str, JointFriction]) -> tuple[str, ...]:
    """Return a sentence with joint names for each kind of friction that URDF and MJCF files cannot hold."""
    by_kind: dict[str, list[str]] = {}
    for name, friction in found.items():
        for what in friction.lost:
            by_kind.setdefault(what, []).append(shown(name))
    return tuple(f"not in the files: {what}: joint {', '.join(names)}" for what, names in by_kind.items())


def calibrated_friction_notes(found: Mapping[str, JointFriction]) -> tuple[str, ...]:
    """Return sentences that say which part of the calibrated friction the written files have."""
    if not found:
        return ()
    return (
        f"<dynamics> of {len(found)} joints: the calibration's friction, as a constant and damping",
        *lost_notes(found),
    )
