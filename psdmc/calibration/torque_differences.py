"""Differences of the torques of two models of one robot: over the workspace, of friction, and on logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from psdmc.calibration.columns.columns import Columns
from psdmc.calibration.compared import Curve, JointDifference, OnLog
from psdmc.calibration.identify.motor_model import motors_of_logs, one_quantity
from psdmc.calibration.identify.residuals import qualities
from psdmc.calibration.logs.log import Array
from psdmc.calibration.sources import LogNaming
from psdmc.calibration.validation import opened_logs
from psdmc.calibration.verdict.delivered import Delivered, linear_torque, predicted_rows
from psdmc.errors import InputError
from psdmc.friction.law import At
from psdmc.friction.state import STATE_LAW
from psdmc.model import recursive
from psdmc.model.calibrated import LINEAR, Prediction
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress
from psdmc.robot.mechanism import Limits, Mechanism

STATES, SEED = 2_000, 20_159
"""States of the workspace at which torques are compared: the largest of them is then exceeded in one state of a thousand."""
SPEED, ACCELERATION = 3.0, 5.0
"""rad/s and rad/s^2 (m/s, m/s^2) of joints without limits."""
CURVE = 81
"""Speeds of a friction curve."""


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of two models that are compared.

    covariance  (l, l) covariance matrix of the l base parameters; None: they are treated as exact
    found       result of the model's calibration; None: the model was not calibrated
    """

    name: str
    model: DynamicsModel
    covariance: Array | None
    found: Delivered | None


def _range(limits: Limits, turns: bool) -> tuple[float, float]:
    full = np.pi if turns else 1.0
    low = limits.lower if np.isfinite(limits.lower) else -full
    return low, limits.upper if np.isfinite(limits.upper) else full


def _states(chain: Mechanism) -> tuple[Array, Array, Array]:
    """q, qd, qdd (STATES, n) within the joints' limits: the same for the same robot."""
    draw = np.random.default_rng(SEED).uniform(-1.0, 1.0, (3, STATES, chain.nv))
    low, high = np.array([_range(j.limits, j.type.effort_unit == "N m") for j in chain.leading_joints]).T
    speed = np.array([j.limits.speed if np.isfinite(j.limits.speed) else SPEED for j in chain.leading_joints])
    hard = [
        j.limits.acceleration if np.isfinite(j.limits.acceleration) else ACCELERATION
        for j in chain.leading_joints
    ]
    return low + (high - low) * 0.5 * (draw[0] + 1.0), speed * draw[1], np.array(hard) * draw[2]


def friction_of(found: Delivered, q: Array, qd: Array) -> Array:
    """Return the friction torque (N samples, n joints) without springs. For LuGre friction, whose state is the
    deflection of bristles, return the torque in steady sliding."""
    names = found.model.v_names
    if found.prediction.is_linear:
        still = np.zeros_like(q)
        plain_ones = replace(found, extra=np.where(found.columns.of_springs, 0.0, found.extra))
        x = found.model.equivalent_parameters()
        return linear_torque(plain_ones, q, qd, still) - recursive.torques(
            found.model.mechanism, x, [q, qd, still]
        )
    torque, state = np.zeros_like(qd), STATE_LAW.state
    assert state is not None
    for k, name in enumerate(names):
        if name in found.prediction.runs:
            p = [found.friction[name, value] for value in STATE_LAW.parameters]
            v = qd[:, k]
            fall = state.rate(p, v, 0.0) - state.rate(p, v, 1.0)  # dz/dt is linear in z
            z = np.divide(state.rate(p, v, 0.0), fall, out=np.zeros_like(v), where=fall != 0.0)
            torque[:, k] = STATE_LAW.torque(p, At(v=v, z=z))
    return torque


def joint_differences(a: Side, b: Side, both: bool) -> tuple[JointDifference, ...]:
    """Return how the torques of two models differ for each joint over the workspace.

    both  True: both models were calibrated, so friction is compared, too
    """
    chain = a.model.mechanism
    q, qd, qdd = _states(chain)
    still = np.zeros_like(q)
    whole, weight, rubbed, inertia = [], [], [], []
    for side in (a, b):
        x = side.model.equivalent_parameters()
        rubbed.append(friction_of(side.found, q, qd) if both and side.found is not None else still)
        whole.append(recursive.torques(side.model.mechanism, x, [q, qd, qdd]) + rubbed[-1])
        weight.append(recursive.torques(side.model.mechanism, x, [q, still, still]))
        masses = recursive.mass_matrix(side.model.mechanism, x, q)
        inertia.append(np.diagonal(masses, axis1=1, axis2=2))
    rms, typical, gravity, friction = (
        np.sqrt(np.mean(values**2, axis=0))
        for values in (whole[1] - whole[0], whole[0], weight[1] - weight[0], rubbed[1] - rubbed[0])
    )
    heavier = np.max(np.abs(inertia[1] - inertia[0]) / np.abs(inertia[0]).max(axis=0), axis=0)
    largest = np.abs(whole[1] - whole[0]).max(axis=0)
    return tuple(
        JointDifference(
            joint.name,
            joint.type.effort_unit,
            *(float(x[k]) for x in (rms, largest, typical, gravity, friction, heavier)),
        )
        for k, joint in enumerate(chain.leading_joints)
    )


def friction_curves(a: Side, b: Side) -> tuple[Curve, ...]:
    """Return the friction torque of both models against the speed of each joint, while the other joints rest."""
    assert a.found is not None
    assert b.found is not None
    chain = a.model.mechanism
    middle = np.array(
        [0.5 * sum(_range(j.limits, j.type.effort_unit == "N m")) for j in chain.leading_joints]
    )
    q = np.tile(middle, (CURVE, 1))
    found = []
    for k, joint in enumerate(chain.leading_joints):
        top = joint.limits.speed if np.isfinite(joint.limits.speed) else SPEED
        qd = np.zeros_like(q)
        qd[:, k] = np.linspace(-top, top, CURVE)
        curves = [tuple(friction_of(side, q, qd)[:, k].tolist()) for side in (a.found, b.found)]
        found.append(Curve(joint.name, joint.type.effort_unit, tuple(qd[:, k].tolist()), *curves))
    return tuple(found)


def errors_on_logs(
    a: Side,
    b: Side,
    paths: Sequence[str | Path],
    torque_constants: Mapping[str, float] | None,
    naming: LogNaming,
    progress: Progress,
) -> tuple[OnLog, ...]:
    """Return the errors of both models on logs for each joint. Raises InputError if neither model is calibrated.

    torque_constants  N m/A by joint name, for logs of motor currents; None: those of the log description or of a model
    """
    known = a.found or b.found
    if known is None:
        raise InputError(
            "neither model is calibrated, so psdmc knows no filter for the log", "calibrate one of them"
        )
    logs, constants = opened_logs(known, paths, naming, progress)
    given = torque_constants or constants or known.constants or None
    names = a.model.v_names
    motors = motors_of_logs(names, logs, given if one_quantity(logs) == "current" else None)
    measured, errors = [], []
    for side in (a, b):
        found = side.found or _without_friction(known, side.model)
        found = replace(found, prediction=replace(found.prediction, steps={"all": known.step.used}))
        parts = [predicted_rows(found, log, known.linear.check, motors) for log in logs]
        measured.append(np.concatenate([part.measured for part in parts]))
        errors.append(measured[-1] - np.concatenate([part.predicted for part in parts]))
    r2 = [[x.r2 for x in qualities(m, m - e)] for m, e in zip(measured, errors, strict=True)]
    rms, largest = [np.sqrt(np.mean(e**2, axis=0)) for e in errors], [np.abs(e).max(axis=0) for e in errors]
    return tuple(
        OnLog(
            joint.name,
            joint.type.effort_unit,
            *((float(x[0][k]), float(x[1][k])) for x in (r2, rms, largest)),
        )
        for k, joint in enumerate(a.model.mechanism.leading_joints)
    )


def _without_friction(known: Delivered, model: DynamicsModel) -> Delivered:
    """A model that was not calibrated, with the filter of one that was."""
    law = Prediction(LINEAR, {"all": known.step.used}, sign_speed=1.0)
    none = {(joint, name): 0.0 for joint in model.v_names for term in law.terms for name in term.names}
    return Delivered(model, law, none, {}, {}, Columns())
