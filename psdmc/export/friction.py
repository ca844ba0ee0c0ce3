"""Friction of a calibrated model as robot files hold it: a constant against the motion, and damping."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from psdmc.model.calibrated import viscous_name
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Joint

ORDINARY_SPEED = 1.0
"""rad/s (m/s) up to which a viscous law is made a line where the joint has no speed limit."""


@dataclass(frozen=True, slots=True)
class JointFriction:
    """One joint's friction: `constant` N m (N) against the motion, `damping` N m s/rad (N s/m); neither negative.

    lost  what such a pair cannot say of the calibrated friction, in words
    """

    constant: float
    damping: float
    lost: tuple[str, ...] = ()


def joint_friction(model: DynamicsModel) -> dict[str, JointFriction]:
    """Friction by joint name, of joints for which the model was calibrated; empty where it was not.

    Of LuGre friction the Coulomb force and the line nearest to the viscous law remain; of a linear fit all but the offset.
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
    exponents, matrix = ((), ()) if law is None else (law.exponents, law.coupling)
    coupled = _coupled(matrix, model.joint_names)
    return {
        name: JointFriction(0.0, 0.0, (COUPLED,)) if name in coupled else _of(values, joints[name], exponents)
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


def _of(values: Mapping[str, float], joint: Joint, exponents: Sequence[float]) -> JointFriction:
    constant, lost = values.get("coulomb", 0.0), []
    if "stiffness" in values:
        terms = [(values.get("viscous", 0.0), values.get("viscous_exponent", 1.0))]
        lost += ["the Stribeck effect and bristles of LuGre friction"]
    else:
        terms = [
            (value, d) for d in exponents or (1.0,) if (value := values.get(viscous_name(d))) is not None
        ]
    top = joint.limits.speed if math.isfinite(joint.limits.speed) else ORDINARY_SPEED
    damping = sum(value * _line(d, top) for value, d in terms)
    if any(d != 1.0 and value for value, d in terms):
        lost.append(
            f"a viscous law that is no line (the line nearest to it up to {top:.3g} {joint.type.position_unit}/s is)"
        )
    if any(name.startswith(("stribeck_", "load_friction", "coulomb_asymmetry")) for name in values):
        lost.append("Stribeck effect, asymmetry and load dependence of friction")
    if values.get("offset"):
        lost.append("the constant torque (offset)")
    if constant < 0.0 or damping < 0.0:
        lost.append("friction that is negative")
    return JointFriction(max(constant, 0.0), max(damping, 0.0), tuple(lost))


def _line(exponent: float, top: float) -> float:
    """The slope s for which s v is the least-squares line to v^exponent over 0 to `top`."""
    return 1.0 if exponent == 1.0 else 3.0 / (exponent + 2.0) * top ** (exponent - 1.0)


def lost_notes(found: Mapping[str, JointFriction]) -> tuple[str, ...]:
    """One sentence for each kind of friction that the files do not hold, with the joints."""
    by_kind: dict[str, list[str]] = {}
    for name, friction in found.items():
        for what in friction.lost:
            by_kind.setdefault(what, []).append(shown(name))
    return tuple(f"not in the files: {what}: joint {', '.join(names)}" for what, names in by_kind.items())


def calibrated_friction_notes(found: Mapping[str, JointFriction]) -> tuple[str, ...]:
    """What of the calibration is in the files."""
    if not found:
        return ()
    return (
        f"<dynamics> of {len(found)} joints: the calibration's Coulomb friction and damping",
        *lost_notes(found),
    )
