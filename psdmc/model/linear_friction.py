"""The friction of a calibrated model, as a sum of terms. There is none for a measurement campaign with friction laws
that have an internal state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from psdmc.errors import InputError
from psdmc.friction.joints import Friction, FrictionInDynamics, found_friction
from psdmc.friction.laws import LAWS
from psdmc.friction.terms import named
from psdmc.model.calibrated import by_joint
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.limits import shown

SLOWEST, FASTEST = 1e-9, 1e9
"""rad/s or m/s: bounds of the smoothing speed."""


def beyond_friction(model: DynamicsModel) -> tuple[str, ...]:
    """Return sentences about what a calibration found in addition to rigid bodies and `linear_friction`: springs, and
    friction that depends on the load. The sentences contain no names. The result is empty if the model was not
    calibrated."""
    found = model.calibrated
    if found is None:
        return ()
    laws = LAWS if found.prediction is None else found.prediction.laws
    terms = [(row.joint, named(row.name, laws)) for row in found.friction]
    springs = len({row.joint for row in found.springs})
    joints = len({joint for joint, term in terms if term is not None and "load" in term[0].reads})
    by_load = f"friction that grows with the load, of {joints} joint(s)" if joints else ""
    return tuple(filter(None, (f"{springs} spring(s)" if springs else "", by_load)))


def linear_friction(model: DynamicsModel) -> Friction:
    """Return the friction that the model's calibration found, as a sum of terms. Raises InputError if the model was not
    calibrated, or if its friction has an internal state. Raises InputError also for coupled motors, for mimic joints,
    and for damaged friction data in the file."""
    if model.calibrated is not None and model.mechanism.has_mimic_joints:
        name = shown(model.mechanism.name)
        raise InputError(f"{name}: friction is of joints that follow no other", "lock those that do")
    return _friction_of(model, model.joint_names)


def friction_in_dynamics(model: DynamicsModel, smoothing_speed: float | None = None) -> FrictionInDynamics:
    """Return the friction that the model's calibration found, as a part of the dynamics. Joints of several coordinates,
    such as a floating base, and mimic joints have no friction of their own.

    smoothing_speed  V in tanh(v / V), which replaces the sign of a joint's speed v; rad/s, or m/s for sliding joints.
                     None: the value of the calibration

    Raises InputError as `linear_friction` does, and if the smoothing speed is not a number within its bounds.
    """
    is_number = isinstance(smoothing_speed, int | float) and not isinstance(smoothing_speed, bool)
    if smoothing_speed is not None and not (is_number and SLOWEST <= smoothing_speed <= FASTEST):
        raise InputError(
            f"the smoothing speed is {smoothing_speed!r}, expected a number of rad/s from {SLOWEST:g} to {FASTEST:g}",
            "such as 0.03",
        )
    chain, name = model.mechanism, shown(model.mechanism.name)
    places: dict[str, tuple[int, int]] = {}
    nq, nv, is_turned = 0, 0, False
    for joint in (chain.joints[i] for i in chain.own_joints):
        if joint.type.nv == 1:
            places[joint.name] = nq, nv
            is_turned |= joint.type.nq > 1
        nq, nv = nq + joint.type.nq, nv + joint.type.nv
    friction = _friction_of(model, list(places))
    if model.calibrated is not None and not {row.joint for row in model.calibrated.friction} <= set(places):
        raise InputError(f"{name}: friction is of joints of one rate that follow no other", "lock the others")
    if friction.by_position and is_turned:
        raise InputError(
            f"{name}: its friction depends on positions, and a joint's position is a cosine and a sine",
            "calibrate with laws of speed",
        )
    if smoothing_speed is not None:
        friction = replace(friction, sign_speed=float(smoothing_speed))
    return FrictionInDynamics.of(friction, list(places.values()), nv)


def _friction_of(model: DynamicsModel, joints: Sequence[str]) -> Friction:
    """The friction of these joints."""
    name = shown(model.mechanism.name)
    found = model.calibrated
    if found is None:
        raise InputError(f"{name}: not calibrated: its friction is unknown", "run `psdmc calibrate` first")
    law = found.prediction
    if law is None or not law.is_linear:
        raise InputError(
            f"{name}: calibrated by a campaign: its friction has a state",
            "`psdmc calibrate --actuators DIR` writes it as C",
        )
    if law.coupling:
        raise InputError(
            f"{name}: calibrated with a coupling: its friction is of motors that drive several joints together, which C "
            "does not have",
            "leave --friction out; `psdmc show` has its numbers",
        )
    try:
        friction = found_friction(
            by_joint(found.friction),
            joints,
            replace(law, offset=False).terms,
            law.laws,
            law.sign_speed,
        )
    except (KeyError, ValueError) as error:
        raise InputError(
            f"{name}: the friction in the model file is damaged: {error}", "calibrate again"
        ) from None
    return replace(friction, beyond=beyond_friction(model))
