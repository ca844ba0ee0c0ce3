"""The result of a calibration, with the calibrated model. Four-step calibrations and linear fits have this result."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.four_steps import FourSteps, Runs
from psdmc.calibration.identify.linear_fit import LinearResult
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.motor import MotorResult
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.steps import CalibrationOptions, StepOptions
from psdmc.calibration.identify.visibility import (
    Visibility,
    as_fitted,
    visibility,
    visibility_warnings,
    weak_notes,
)
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.verdict.delivered import delivered_quality, reread
from psdmc.errors import InternalError
from psdmc.friction.law import Term, unit_of
from psdmc.friction.terms import STATE_LAW
from psdmc.model.calibrated import (
    IDENTIFIED,
    LINEAR,
    WHOLE,
    Calibrated,
    FrictionRunConstants,
    LogUsed,
    NumberRow,
    ParameterRow,
    Prediction,
    Remark,
    StepQuality,
    Verdict,
    code_of,
    parameters_of,
)
from psdmc.model.calibrated_json import document
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import check_mass_matrix
from psdmc.robot.urdf.missing_inertia import massless_words, unknown_option
from psdmc.version import psdmc_version

LIBRARIES = ("numpy", "scipy", "cvxpy", "clarabel")
"""Whose results enter a calibration's numbers."""
MOVED = 1e-6
"""Distance from the prior, in units of what is believable, from which an invisible parameter counts as moved by
physical consistency."""
DROPPED_LINKS = "dropped_links"
"""Code of the warning about links that the model has no parameters for."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Calibration(Calibrated):
    """The whole result of a calibration, with the results of its steps and samples to plot.

    model  the calibrated model; its field `calibrated` holds the results without the samples to plot
    """

    model: DynamicsModel

    def as_json(self) -> dict[str, Any]:
        """Return the result of a calibration as dictionaries, lists, texts and numbers. Numbers that are not finite
        become null."""
        return document(self)


def with_model(record: Calibration, theta_b: Array | None = None) -> Calibration:
    """Return the result of a calibration with a copy of its results stored in its model.

    theta_b  (l,) new base parameters of the model; None: they stay unchanged
    """
    theta = record.model.theta_b if theta_b is None else theta_b
    return replace(record, model=replace(record.model, theta_b=theta, calibrated=record.kept()))


def with_data(record: Calibration, logs: Sequence[AnyLog]) -> Calibration:
    """Return the record with its logs and the versions of the programs that computed it."""
    return replace(record, logs=logs_used(logs), versions=_versions())


def logs_used(logs: Sequence[AnyLog], use: str = "") -> tuple[LogUsed, ...]:
    """Return name, number of rows, duration, date and use of each log, as the result of a calibration stores them.

    use  "fit" or "validate" for all logs; empty: the use that each log has
    """
    return tuple(LogUsed(log.name, len(log), log.duration, log.date, use or log.use) for log in logs)


def _versions() -> dict[str, str]:
    """psdmc's, Python's and the libraries' versions, by name; libraries that are not installed are left out."""
    found = {"psdmc": psdmc_version(), "Python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def with_verdict(record: Calibration, verdict: Verdict) -> Calibration:
    """Return the result of a calibration with a verdict added, also in the data that its model stores."""
    return with_model(replace(record, verdict=verdict))


def verdict_of(record: Calibration) -> Verdict:
    """Return the verdict of a finished calibration."""
    if record.verdict is None:
        raise InternalError(f"{record.robot}: calibrated, but not judged")
    return record.verdict


# Of a campaign, in four steps


def four_step_record(
    model: DynamicsModel, found: FourSteps, theta_b: Array, options: CalibrationOptions
) -> Calibration:
    """Return the result of a four-step calibration with the given base parameters, before its accuracy is computed.

    found    results of the four steps: motors, gravity, friction, inertia
    theta_b  (l,) base parameters
    """
    inertial, gravity = found.inertial, found.gravity
    groups = ["inertial"] * model.l
    for k in gravity.split.pivots:
        groups[int(k)] = "gravity"
    names = model.base_parameters.labels
    at = _kept_at(model, theta_b, inertial.scale)
    seen = visibility(names, theta_b, inertial.std, inertial.unseen / inertial.scale[:, None], at)
    facts = {
        "delay_s": found.friction.delay,
        "gravity_rank": gravity.estimate.rank,
        "gravity_condition": gravity.estimate.condition,
        "gravity_singular_values": gravity.estimate.singular_values.tolist(),
        "inertial_rank": inertial.estimate.rank,
        "inertial_condition": inertial.estimate.condition,
        "inertial_singular_values": inertial.estimate.singular_values.tolist(),
        "residual_correlation": _by_joint(model, inertial.estimate.correlation),
        "noise_factor": max(gravity.estimate.noise_factor, inertial.estimate.noise_factor),
    }
    steps = {
        "motor": options.motor,
        "gravity": options.gravity,
        "friction": options.friction,
        "inertial": options.inertial,
    }
    runs = {
        name: FrictionRunConstants(joint.inertia, joint.offset, joint.delay)
        for name, joint in found.friction.joints.items()
    }
    return with_model(
        Calibration(
            robot=model.mechanism.name,
            method="four steps",
            joint_names=model.v_names,
            model=model,
            parameters=_parameter_rows(model, theta_b, inertial.std, groups, seen),
            motors=_motor_rows(model, found.motors, found.motor),
            friction=_friction_rows(model, found),
            steps=(),
            warnings=(*dropped_links(model), *found.warnings, *visibility_warnings("inertial", names, seen)),
            facts=facts,
            prediction=Prediction(
                STATE_LAW.name, {name: step.used for name, step in steps.items()}, runs=runs
            ),
            notes=weak_notes("inertial", names, seen),
            covariance=_covariance(inertial.covariance + inertial.prior_covariance),
        ),
        theta_b,
    )


def _friction_rows(model: DynamicsModel, found: FourSteps) -> tuple[NumberRow, ...]:
    """The seven per joint; the uncertainty of forces includes the torque constant's."""
    relative = dict(zip(model.v_names, found.motors.relative_std.tolist(), strict=True))
    rows: list[NumberRow] = []
    joints = {joint.name: joint for joint in model.mechanism.leading_joints}
    units = Term(STATE_LAW).units()
    for name, joint in found.friction.joints.items():
        values = zip(STATE_LAW.parameters, joint.friction.tolist(), joint.std.tolist(), units, strict=True)
        for parameter, value, std, unit in values:
            by_constant = relative[name] * value if unit.startswith("Nm") else 0.0
            seen = parameter not in joint.unseen
            own = unit_of(joints[name].type.effort_unit, unit)
            rows.append(NumberRow(name, parameter, value, float(np.hypot(std, by_constant)), own, seen))
    return tuple(rows)


# Of plain logs, in one linear fit


def linear_record(
    model: DynamicsModel, found: LinearResult, values: Array, options: LinearOptions
) -> Calibration:
    """Return the result of a linear fit with the given values, before its accuracy is computed.

    values  base parameters, followed by friction values and offsets, in the order of the fit
    """
    problem, solved = found.problem, found.estimate
    names = (*model.base_parameters.labels, *problem.names)
    at = _kept_at(model, values, found.prior.scale, found.prior.values)
    seen = visibility(names, values, solved.std, solved.unseen, at)
    dropped = np.zeros(len(values), dtype=bool) if found.dropped is None else found.dropped
    stated = np.arange(len(values)) < (model.l if found.stated else 0)
    stated[list(model.unknown_base_parameters)] = False
    seen = as_fitted(seen, at, dropped, stated)
    facts = {
        "rank": solved.rank,
        "unknowns": len(values),
        "condition": solved.condition,
        "singular_values": solved.singular_values.tolist(),
        "residual_correlation": _by_joint(model, solved.correlation),
        "noise_factor": solved.noise_factor,
    }
    std = solved.std

    def row(k: int, owner: str, name: str, unit: str) -> NumberRow:
        word = seen.words[k]
        is_seen = code_of(word) == IDENTIFIED.code
        return NumberRow(
            owner, name, float(values[k]), float(std[k]), unit, is_seen, word, parameters_of(name)
        )

    joints = {joint.name: joint for joint in model.mechanism.leading_joints}
    turning = {
        name: unit for term in problem.terms for name, unit in zip(term.names, term.units(), strict=True)
    }
    friction = [
        row(k, owner, name, unit_of(joints[owner].type.effort_unit, turning[name]))
        for k, (owner, name) in enumerate(problem.plain, start=model.l)
    ]
    unknowns = enumerate(problem.columns.unknowns, start=problem.first_extra)
    extra = [row(k, unknown.owner, unknown.name, unknown.unit) for k, unknown in unknowns]
    of_springs = problem.columns.of_springs
    step = StepOptions(options.filter, options.split, options.fit)
    coupled = (
        "friction is of the motors, which are called like the joints: some of them drive several together"
    )
    notes = (coupled,) if options.coupling else ()
    return with_model(
        Calibration(
            robot=model.mechanism.name,
            method="linear fit",
            joint_names=model.v_names,
            model=model,
            parameters=_parameter_rows(model, values, solved.std, ["all"] * model.l, seen),
            motors=_motor_rows(model, found.motors, None),
            friction=(*friction, *_chosen(extra, ~of_springs)),
            springs=_chosen(extra, of_springs),
            steps=(),
            warnings=(
                *dropped_links(model),
                *found.warnings,
                *visibility_warnings("linear fit", names, seen),
            ),
            facts=facts,
            prediction=Prediction(
                LINEAR,
                {"all": step.used},
                options.sign_speed,
                options.exponents,
                options.offset,
                coupling=options.coupling,
                columns=problem.columns.content,
            ),
            notes=(*notes, *weak_notes("linear fit", names, seen)),
            covariance=_covariance((solved.total_covariance + solved.prior_covariance)[: model.l, : model.l]),
        ),
        values[: model.l],
    )


def _chosen(rows: Sequence[NumberRow], wanted: NDArray[np.bool_]) -> tuple[NumberRow, ...]:
    return tuple(row for row, is_wanted in zip(rows, wanted.tolist(), strict=True) if is_wanted)


# Rows that both methods have


def _kept_at(model: DynamicsModel, values: Array, scale: Array, start: Array | None = None) -> list[str]:
    """Return the value that each unseen parameter is kept at, in words. theta_b is kept at the file's value, and what
    follows it at `start`, or at zero if that is None."""
    prior = np.zeros(len(values)) if start is None else start.copy()
    known, unknown = model.file_theta_b, model.unknown_base_parameters
    prior[: model.l] = 0.0 if known is None else known
    words = ["the known links' part" if k in unknown else "the file's value" for k in range(model.l)]
    names = ["zero"] * model.l if known is None else words
    names += [f"{value:g}" if value else "zero" for value in prior[model.l :]]
    moved = np.abs(values - prior) > MOVED * scale
    return [
        f"the physical value nearest to {name}" if m else name for name, m in zip(names, moved, strict=True)
    ]


def dropped_links(model: DynamicsModel) -> tuple[str, ...]:
    """Return a sentence on links without inertia in the file, for which the model has no parameters."""
    chain = model.mechanism
    if not chain.massless:
        return ()
    return (
        Remark(
            f"{massless_words(chain)}, so the model has no parameters to calibrate there; derive it again with "
            f"{unknown_option(chain)}",
            DROPPED_LINKS,
        ),
    )


def _covariance(found: Array) -> Array:
    """(l, l) without what rounding leaves of exact zeros: no variance negative, no correlation above one."""
    std = np.sqrt(np.maximum(np.diag(found), 0.0))
    largest = std * std[:, None]
    return np.clip(found, -largest, largest)


def _by_joint(model: DynamicsModel, values: Array) -> dict[str, float]:
    """Values (n,) by their joints' names."""
    return dict(zip(model.v_names, values.tolist(), strict=True))


def _parameter_rows(
    model: DynamicsModel, theta: Array, std: Array, groups: list[str], seen: Visibility
) -> tuple[ParameterRow, ...]:
    """One row for each base parameter: theta and std (l,), the group of each, and what the data show of it."""
    return tuple(
        ParameterRow(
            name=f"theta_b[{k}]",
            group=groups[k],
            value=float(theta[k]),
            std=float(std[k]) if seen.determined[k] else float("inf"),
            unit=parameter.unit,
            equation=parameter.equation,
            identifiable=code_of(seen.words[k]) == IDENTIFIED.code,
            visibility=seen.words[k],
            file=parameter.value,
        )
        for k, parameter in enumerate(model.base_parameters)
    )


def _motor_rows(model: DynamicsModel, motors: Motors, step: MotorResult | None) -> tuple[NumberRow, ...]:
    """Rows of the torque constants; none where torques were logged. A given constant, which is exact, is marked as not
    seen."""
    constants, relative = motors.torque_constant, motors.relative_std
    if step is None and np.all(constants == 1.0):
        return ()
    seen = relative > 0.0 if step is None else step.identified
    own = zip(model.mechanism.leading_joints, constants, relative, seen, strict=True)
    return tuple(
        NumberRow(
            joint.name,
            "torque_constant",
            float(value),
            float(abs(value) * share),
            unit_of(joint.type.effort_unit, "Nm/A"),
            bool(known),
        )
        for joint, value, share, known in own
    )


# The figures of its model file


def judged_record(
    record: Calibration,
    source: Sequence[AnyLog] | Runs,
    plain: Calibration | None = None,
    distance: float | None = None,
    check: CheckOptions | None = None,
) -> Calibration:
    """Return the result of a calibration with its accuracy on logs or runs added.

    The torques are computed from the model's file after it was written and read back.

    plain     result of the unconstrained fit, if `record` is physically consistent; None: `record` is unconstrained
    distance  distance of `record` from the unconstrained fit, in standard deviations
    """
    model = reread(record.model)
    steps = delivered_quality(model, source, check)
    mass = check_mass_matrix(model)
    facts = {**record.facts, "physically_consistent": plain is not None}
    notes, warnings = list(record.notes), list(record.warnings)
    if plain is not None and distance is not None:
        cost, of_friction = (_lost(plain.steps, steps, step) for step in (WHOLE, "Friction"))
        facts["physical_cost_r2"] = cost
        facts["physical_distance_std"] = distance
        words = ", ".join(f"{name} {-price:+.4f}" for name, price in cost.items())
        worst = f"; of friction runs by {-max(of_friction.values()):+.4f} at worst" if of_friction else ""
        notes.append(
            f"physical consistency moved the parameters by {distance:.3g} standard deviations in all and held-out R^2 by "
            f"{words}{worst}"
        )
    if mass is not None:
        facts["mass_matrix"] = {"poses": mass.poses, "failing": mass.failing, "smallest": mass.smallest}
        if not mass.passed:
            warnings.append(Remark(f"{mass.reason}: there is no forward dynamics", "indefinite"))
    method = f"{record.method}, physically consistent" if plain is not None else record.method
    whole = replace(
        record, method=method, steps=steps, facts=facts, notes=tuple(notes), warnings=tuple(warnings)
    )
    return with_model(whole)


def _lost(before: Sequence[StepQuality], after: Sequence[StepQuality], step: str) -> dict[str, float]:
    """Held-out R^2 that a step loses, by joint; empty where there is no such step."""
    was, now = ({each.step: each.joints for each in steps}.get(step, {}) for steps in (before, after))
    return {name: was[name].held_out.r2 - now[name].held_out.r2 for name in now}
