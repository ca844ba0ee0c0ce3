"""The function `psdmc.compare`: how two models of one robot differ, in standard deviations and in torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import stats

from psdmc.calibration.columns.columns import Columns
from psdmc.calibration.compared import Comparison, Curve, Difference, JointDifference, OnLog
from psdmc.calibration.identify.motor_model import motors_of_logs, one_quantity
from psdmc.calibration.identify.residuals import qualities
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import Array
from psdmc.calibration.sources import LogNaming
from psdmc.calibration.validation import opened_logs
from psdmc.calibration.verdict.delivered import Delivered, delivered, linear_torque, predicted_rows
from psdmc.errors import InputError
from psdmc.friction.law import At
from psdmc.friction.terms import STATE_LAW
from psdmc.model import evaluate
from psdmc.model.calibrated import LINEAR, Prediction, Remark
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import ROBOT_FILES, model_of
from psdmc.progress import Progress, silent
from psdmc.robot.load import load_robot
from psdmc.robot.mechanism import Limits, Mechanism, Placement, require_axes, require_no_loops


def compare(
    a: DynamicsModel | str | Path,
    b: DynamicsModel | str | Path,
    logs: str | Path | Sequence[str | Path] = (),
    torque_constants: Mapping[str, float] | None = None,
    *,
    naming: LogNaming | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Compare two models of one robot: base parameters, friction, torques, and errors on logs.

    Returns an object with the differences. For example, its attributes are `parameters`, `friction`, `joints` (torques by
    joint) and `on_log` (errors on logs).

    a                 a model, or the path of its file
    b                 another model of the robot, the path of its file, or the path of a robot file (URDF, MJCF, DH table)
    logs              logs on which psdmc tests both models; at least one of the models must then be calibrated
    torque_constants  torque per current of each joint, for logs of motor currents: a dictionary from joint names to N m/A
                      at the joint (after the gear); None: those of the models
    naming            names in the logs that differ from those of the model: psdmc.calibration.sources.LogNaming(topic,
                      joints). `topic` is the topic of the joint states in ROS bags. `joints` is a dictionary from joint
                      names in the logs to those of the model. None: no name differs
    progress          function, such as print, that psdmc calls with the name of each stage

    Raises InputError if a file is missing, if the parameters of a model have no numerical values, or if the models are of
    different robots.
    """
    progress("reading models")
    first = model_of(a)
    require_axes(first.mechanism, "comparison")
    require_no_loops(first.mechanism, "comparison")
    if first.mechanism.has_mimic_joints:
        raise InputError("psdmc compares models without joints that follow others", "lock those that do")
    second = _like(first, b)
    require_same_robot(first.mechanism, second.mechanism)
    if first.B.shape != second.B.shape or not np.allclose(
        first.B, second.B, rtol=SAME_PLACE, atol=SAME_PLACE
    ):
        raise InputError(
            f"the models have other base parameters: {first.l} and {second.l}",
            "derive both with the same --drive-inertia, --assume-zero and --unknown",
        )
    own, other = _side(_name(a, first), first), _side(_name(b, second), second)
    parameters, chi2, freedom = _parameters(first, own, other)
    progress("torques over the workspace")
    both = own.found is not None and other.found is not None
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    return Comparison(
        robot=first.mechanism.name,
        a=own.name,
        b=other.name,
        doubts=tuple(_doubts(own, other)),
        parameters=parameters,
        friction=_friction(own, other) if both else (),
        chi2=chi2,
        freedom=freedom,
        chance=float(stats.chi2.sf(chi2, freedom)) if freedom else float("nan"),
        joints=joint_differences(own, other, both),
        curves=friction_curves(own, other) if both else (),
        on_log=errors_on_logs(own, other, paths, torque_constants, naming or LogNaming(), progress)
        if paths
        else (),
    )


def _name(given: DynamicsModel | str | Path, model: DynamicsModel) -> str:
    return model.mechanism.name if isinstance(given, DynamicsModel) else Path(given).name


def _like(first: DynamicsModel, given: DynamicsModel | str | Path) -> DynamicsModel:
    """The other model; of a robot file, read with the first one's options, the first with the file's values."""
    if isinstance(given, DynamicsModel) or Path(given).suffix.lower() not in ROBOT_FILES:
        return model_of(given)
    chain = load_robot(given, **first.provenance.get("options", {})).mechanism
    require_same_robot(first.mechanism, chain)
    if chain.has_unknown_body.any():
        raise InputError(
            f"{given}: links without inertia, so the file has no torques to compare", "complete it"
        )
    theta_b = first.B @ chain.known_parameters.reshape(-1)
    return replace(first, mechanism=chain, theta_b=theta_b, calibrated=None)


def _side(name: str, model: DynamicsModel) -> Side:
    kept = model.calibrated
    if model.theta_b is None:
        raise InputError(
            f"{name}: the model's base parameters are unknown", "calibrate it, or derive it with inertias"
        )
    found = None if kept is None or kept.prediction is None else delivered(model)
    covariance = None if kept is None else kept.covariance
    if kept is not None and covariance is None:
        covariance = np.diag(np.where(np.isfinite(kept.std), kept.std, UNKNOWN) ** 2)
    return Side(name, model, covariance, found)


UNKNOWN = 1e6
"""SI, standard deviation of a value that an older file does not know: so large that no difference counts."""


def _doubts(*sides: Side) -> list[Remark]:
    kept = [(side.name, side.model.calibrated) for side in sides]
    old = [name for name, own in kept if own is not None and own.covariance is None]
    exact = [name for name, own in kept if own is None]
    bad = [
        name for name, own in kept if own is not None and own.verdict is not None and not own.verdict.usable
    ]
    found = []
    if old:
        text = f"{listed(old)}: no covariance in the file, so its parameters count as independent"
        found.append(Remark(f"{text}: calibrate again to get one", "no_covariance"))
    if exact:
        text = f"{listed(exact)}: not calibrated, so its values count as exact and it has no friction"
        found.append(Remark(f"{text}: torques are compared without friction", "not_calibrated"))
    if bad:
        found.append(Remark(f"{listed(bad)}: the verdict on the calibration is: not usable", "not_usable"))
    return found


# Values


def _parameters(first: DynamicsModel, a: Side, b: Side) -> tuple[tuple[Difference, ...], float, int]:
    """Base parameters of both, the chi-square of their differences, and its degrees of freedom."""
    values = [side.model.known_theta_b() for side in (a, b)]
    known = [side.covariance for side in (a, b) if side.covariance is not None]
    together = sum(known[1:], start=known[0]) if known else np.full((first.l, first.l), np.nan)
    std = np.sqrt(np.diag(together)) if known else np.full(first.l, np.inf)
    rows = tuple(
        Difference(
            f"theta_b[{k}]", row.equation, row.unit, float(values[0][k]), float(values[1][k]), float(std[k])
        )
        for k, row in enumerate(first.base_parameters)
    )
    if not known:
        return rows, float("nan"), 0
    shown = np.flatnonzero(std > 0.0)
    size = std[shown]
    variances, axes = np.linalg.eigh(together[np.ix_(shown, shown)] / np.outer(size, size))
    kept = variances > ROUNDING * variances.max(initial=0.0)
    along = axes[:, kept].T @ ((values[1] - values[0])[shown] / size) / np.sqrt(variances[kept])
    return rows, float(along @ along), int(kept.sum())


ROUNDING = 1e-12
"""Share of the largest variance below which one is rounding."""


def _friction(a: Side, b: Side) -> tuple[Difference, ...]:
    """Friction and springs that both models have by the same names."""
    tables = []
    for side in (a, b):
        kept = side.model.calibrated
        assert kept is not None
        tables.append({(row.joint, row.name): row for row in (*kept.friction, *kept.springs, *kept.motors)})
    one, two = tables
    return tuple(
        Difference(
            f"{key[1]} of {key[0]}",
            "",
            row.unit,
            row.value,
            two[key].value,
            float(np.hypot(row.std, two[key].std)),
        )
        for key, row in one.items()
        if key in two
    )


# The same robot


SAME_PLACE = 1e-6
"""m, and rad: farther apart, two joints are not the same."""


def require_same_robot(a: Mechanism, b: Mechanism) -> None:
    """Raise InputError unless two robots have equal joints, axes, link frames and gravity. The error says what differs."""
    hint = "compare two models of one robot, derived with the same --base, --tip, --lock and --gravity"
    if a.joint_names != b.joint_names:
        pairs = (("first", a.joint_names, b.joint_names), ("second", b.joint_names, a.joint_names))
        alone = [(which, [name for name in own if name not in other]) for which, own, other in pairs]
        what = "; ".join(f"only in the {which}: {listed(names)}" for which, names in alone if names)
        raise InputError(f"different robots: joints {what or 'in another order'}", hint)
    other = [x.name for x, y in zip(a.joints, b.joints, strict=True) if x.type is not y.type]
    other += [name for name, x, y in zip(a.joint_names, a.parents, b.parents, strict=True) if x != y]
    if other:
        raise InputError(
            f"different robots: joint(s) {listed(other)} of another type or on another link", hint
        )
    moved = [
        name
        for name, (axis, frame), (axis_b, frame_b) in zip(a.joint_names, _places(a), _places(b), strict=True)
        if max(
            np.abs(axis.rotation[:, 2] - axis_b.rotation[:, 2]).max(),
            np.abs(np.cross(axis.translation - axis_b.translation, axis.rotation[:, 2])).max(),
            np.abs(frame.rotation - frame_b.rotation).max(),
            np.abs(frame.translation - frame_b.translation).max(),
        )
        > SAME_PLACE
    ]
    if moved:
        raise InputError(f"different robots: joint(s) {listed(moved)} have other axes or link frames", hint)
    if np.abs(a.gravity - b.gravity).max() > SAME_PLACE:
        raise InputError(f"different gravity: {a.gravity.tolist()} and {b.gravity.tolist()} m/s^2", hint)


def _places(chain: Mechanism) -> list[tuple[Placement, Placement]]:
    """Return each joint's axis, and its link's frame, in the base frame at q = 0."""
    found: list[Placement] = []
    for joint, parent in zip(chain.joints, chain.parents, strict=True):
        found.append(joint.placement if parent < 0 else found[parent] @ joint.placement)
    return [(place, place @ joint.link_frame) for place, joint in zip(found, chain.joints, strict=True)]


# Differences of torques


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
        return linear_torque(plain_ones, q, qd, still) - evaluate.torques(
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
        whole.append(evaluate.torques(side.model.mechanism, x, [q, qd, qdd]) + rubbed[-1])
        weight.append(evaluate.torques(side.model.mechanism, x, [q, still, still]))
        masses = evaluate.mass_matrix(side.model.mechanism, x, q)
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
        found = side.found
        if found is None:  # without friction, and with the filter of the other model
            law = Prediction(LINEAR, {"all": known.step.used}, sign_speed=1.0)
            none = {(joint, name): 0.0 for joint in names for term in law.terms for name in term.names}
            found = Delivered(side.model, law, none, {}, {}, Columns())
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
