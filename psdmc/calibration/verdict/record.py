"""The results of a calibration as tables, from which the report and the model file are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.four_steps import FourSteps
from psdmc.calibration.identify.linear_fit import LinearResult
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.lugre import PARAMETERS, UNITS
from psdmc.calibration.identify.motor import MotorResult
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.prediction import FrictionRunConstants, Prediction
from psdmc.calibration.identify.steps import CalibrationOptions, StepOptions, StepQuality
from psdmc.calibration.identify.visibility import (
    IDENTIFIED,
    Visibility,
    as_fitted,
    visibility,
    visibility_warnings,
    weak_notes,
)
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.verdict.verdict import Verdict
from psdmc.calibration.verdict.versions_used import versions_used
from psdmc.errors import InternalError
from psdmc.model.dynamics_model import DynamicsModel


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One base parameter of table 4.

    std           infinite where the data do not fix it by itself; value then as near to the prior as they allow
    identifiable  whether `visibility` is "identified": fixed by itself, to less than half of its value
    file          value by the file that was calibrated; None where it has none
    """

    name: str
    group: str
    value: float
    std: float
    unit: str
    equation: str
    identifiable: bool
    visibility: str = IDENTIFIED
    file: float | None = None

    @property
    def relative(self) -> float:
        return self.std / abs(self.value) if self.value else float("inf")


@dataclass(frozen=True, slots=True)
class NumberRow:
    """A number of one joint with its standard deviation; `seen` says whether the data determine it."""

    joint: str
    name: str
    value: float
    std: float
    unit: str
    seen: bool = True
    visibility: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """The whole result of a calibration.

    model       the calibrated model, its provenance carrying these numbers
    motors      torque constants
    friction    seven per joint, or Coulomb, viscous and offset
    steps       table 3's columns, computed from the model file's content (delivered.delivered_quality)
    prediction  what else a prediction needs
    notes       remarks without consequences for its use
    facts       plain values: ranks, condition numbers, singular values, delay, options
    verdict     whether it can be used; None before it was judged
    springs     values of springs, whose names stand in place of a joint's
    covariance  (l, l) of the base parameters, with the prior's in directions that the data do not show; None: not kept
    """

    robot: str
    method: str
    joint_names: tuple[str, ...]
    model: DynamicsModel
    parameters: tuple[ParameterRow, ...]
    motors: tuple[NumberRow, ...]
    friction: tuple[NumberRow, ...]
    steps: tuple[StepQuality, ...]
    warnings: tuple[str, ...]
    facts: dict[str, Any] = field(default_factory=dict)
    prediction: Prediction | None = None
    notes: tuple[str, ...] = ()
    verdict: Verdict | None = None
    springs: tuple[NumberRow, ...] = ()
    covariance: Array | None = None

    def as_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become null."""
        judged = {} if self.verdict is None else {"verdict": self.verdict.as_json()}
        sprung = {"springs": [_spring(row) for row in self.springs]} if self.springs else {}
        return (
            judged
            | sprung
            | {
                "robot": self.robot,
                "method": self.method,
                "joints": list(self.joint_names),
                "base_parameters": [
                    {
                        "name": row.name,
                        "group": row.group,
                        "file": row.file,
                        "value": row.value,
                        "std": _finite(row.std),
                        "relative": _finite(row.relative),
                        "unit": row.unit,
                        "equation": row.equation,
                        "identifiable": row.identifiable,
                        "visibility": row.visibility,
                    }
                    for row in self.parameters
                ],
                "motors": [_number(row) for row in self.motors],
                "friction": [_number(row) for row in self.friction],
                "quality": {step.step: _quality(step) for step in self.steps},
                "warnings": list(self.warnings),
                "notes": list(self.notes),
                "prediction": None if self.prediction is None else self.prediction.as_json(),
                "facts": self.facts,
            }
        )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _number(row: NumberRow) -> dict[str, Any]:
    return {
        "joint": row.joint,
        "name": row.name,
        "value": _finite(row.value),
        "std": _finite(row.std),
        "unit": row.unit,
        "seen": row.seen,
        "visibility": row.visibility,
    }


def _spring(row: NumberRow) -> dict[str, Any]:
    kept = _number(row)
    return {"spring": kept.pop("joint"), **kept}


def _quality(step: StepQuality) -> dict[str, Any]:
    return {
        name: {
            "fit": {"rmse": _finite(both.fit.rmse), "r2": _finite(both.fit.r2)},
            "held_out": {"rmse": _finite(both.held_out.rmse), "r2": _finite(both.held_out.r2)},
        }
        for name, both in step.joints.items()
    }


def four_step_record(
    model: DynamicsModel, found: FourSteps, theta_b: Array, options: CalibrationOptions
) -> Calibration:
    """The record of a campaign with these base parameters, without its quality."""
    inertial, gravity = found.inertial, found.gravity
    groups = ["inertial"] * model.l
    for k in gravity.split.pivots:
        groups[int(k)] = "gravity"
    names = [f"theta_{k + 1}" for k in range(model.l)]
    kept_at = _kept_at(model, theta_b, inertial.scale)
    seen = visibility(names, theta_b, inertial.std, inertial.unseen / inertial.scale[:, None], kept_at)
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
            joint_names=model.joint_names,
            model=model,
            parameters=_parameter_rows(model, theta_b, inertial.std, groups, seen),
            motors=_motor_rows(model, found.motors, found.motor),
            friction=_lugre_rows(model, found),
            steps=(),
            warnings=(*found.warnings, *visibility_warnings("inertial", names, seen)),
            facts=facts,
            prediction=Prediction("lugre", steps, runs=runs),
            notes=weak_notes("inertial", names, seen),
            covariance=inertial.covariance + inertial.prior_covariance,
        ),
        theta_b,
    )


def linear_record(
    model: DynamicsModel, found: LinearResult, values: Array, options: LinearOptions
) -> Calibration:
    """The record of a linear fit with these values of the whole vector, without its quality."""
    problem, solved = found.problem, found.estimate
    kept_at = _kept_at(model, values, found.prior.scale)
    seen = visibility(problem.names, values, solved.std, solved.unseen, kept_at)
    dropped = np.zeros(len(values), dtype=bool) if found.dropped is None else found.dropped
    seen = as_fitted(seen, kept_at, dropped, model.l if found.stated else 0)
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
        return NumberRow(owner, name, float(values[k]), float(std[k]), unit, word == IDENTIFIED, word)

    friction = [row(k, *own, _friction_unit(own[1])) for k, own in enumerate(problem.plain, start=model.l)]
    unknowns = enumerate(problem.columns.unknowns, start=problem.first_extra)
    extra = [row(k, unknown.owner, unknown.name, unknown.unit) for k, unknown in unknowns]
    of_springs = problem.columns.of_springs
    step = StepOptions(options.filter, options.split, options.fit)
    return with_model(
        Calibration(
            robot=model.mechanism.name,
            method="linear fit",
            joint_names=model.joint_names,
            model=model,
            parameters=_parameter_rows(model, values, solved.std, ["all"] * model.l, seen),
            motors=_motor_rows(model, found.motors, None),
            friction=(*friction, *_chosen(extra, ~of_springs)),
            springs=_chosen(extra, of_springs),
            steps=(),
            warnings=(*found.warnings, *visibility_warnings("linear fit", problem.names, seen)),
            facts=facts,
            prediction=Prediction(
                "linear",
                {"all": step},
                options.sign_speed,
                options.exponents,
                options.offset,
                coupling=options.coupling,
                columns=problem.columns.content,
            ),
            notes=(*_coupled_notes(options), *weak_notes("linear fit", problem.names, seen)),
        ),
        values[: model.l],
    )


def _coupled_notes(options: LinearOptions) -> tuple[str, ...]:
    if not options.coupling:
        return ()
    return (
        "friction is of the motors, which are called like the joints: some of them drive several together",
    )


def _chosen(rows: Sequence[NumberRow], wanted: NDArray[np.bool_]) -> tuple[NumberRow, ...]:
    return tuple(row for row, is_wanted in zip(rows, wanted.tolist(), strict=True) if is_wanted)


def with_model(record: Calibration, theta_b: Array | None = None) -> Calibration:
    """The record with a model that carries its present numbers, and these base parameters where given."""
    provenance = {**record.model.provenance, "calibration": record.as_json()}
    theta = record.model.theta_b if theta_b is None else theta_b
    return replace(record, model=replace(record.model, theta_b=theta, provenance=provenance))


def with_data(record: Calibration, logs: Sequence[AnyLog]) -> Calibration:
    """The record with the names, lengths and dates of its logs."""
    return replace(record, facts={**record.facts, "data": data_of(logs), "versions": versions_used()})


def data_of(logs: Sequence[AnyLog]) -> list[dict[str, Any]]:
    """Names, lengths and dates of logs as plain values."""
    return [_data(log) for log in logs]


def _data(log: AnyLog) -> dict[str, Any]:
    """A log in plain values; `use` where it is not for fitting."""
    found = {"log": log.name, "rows": len(log), "seconds": log.duration, "date": log.date}
    return found if log.use == "fit" else {**found, "use": log.use}


def with_verdict(record: Calibration, verdict: Verdict) -> Calibration:
    """The calibration with its verdict, which is also in the model's provenance."""
    return with_model(replace(record, verdict=verdict))


def verdict_of(record: Calibration) -> Verdict:
    """The verdict of a finished calibration's record."""
    if record.verdict is None:
        raise InternalError(f"{record.robot}: calibrated, but not judged")
    return record.verdict


MOVED = 1e-6
"""Distance from the prior, in units of what is believable, from which an invisible parameter counts as moved by
physical consistency."""


def _kept_at(model: DynamicsModel, values: Array, scale: Array) -> list[str]:
    """The value that each unseen parameter is kept at, in words: friction at zero, theta_b at the file's."""
    prior = np.zeros(len(values))
    prior[: model.l] = 0.0 if model.theta_b is None else model.theta_b
    names = ["zero" if model.theta_b is None else "the file's value"] * model.l
    names += ["zero"] * (len(values) - model.l)
    moved = np.abs(values - prior) > MOVED * scale
    return [
        f"the physical value nearest to {name}" if m else name for name, m in zip(names, moved, strict=True)
    ]


def _by_joint(model: DynamicsModel, values: Array) -> dict[str, float]:
    return dict(zip(model.joint_names, values.tolist(), strict=True))


def _parameter_rows(
    model: DynamicsModel, theta: Array, std: Array, groups: list[str], seen: Visibility
) -> tuple[ParameterRow, ...]:
    return tuple(
        ParameterRow(
            name=f"theta_{k + 1}",
            group=groups[k],
            value=float(theta[k]),
            std=float(std[k]) if seen.determined[k] else float("inf"),
            unit=parameter.unit,
            equation=parameter.equation,
            identifiable=seen.words[k] == IDENTIFIED,
            visibility=seen.words[k],
            file=None if model.theta_b is None else float(model.theta_b[k]),
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
    return tuple(
        NumberRow(name, "torque_constant", float(value), float(abs(value) * share), "Nm/A", bool(known))
        for name, value, share, known in zip(model.joint_names, constants, relative, seen, strict=True)
    )


def _lugre_rows(model: DynamicsModel, found: FourSteps) -> tuple[NumberRow, ...]:
    """The seven per joint; the uncertainty of forces includes the torque constant's."""
    relative = dict(zip(model.joint_names, found.motors.relative_std.tolist(), strict=True))
    rows: list[NumberRow] = []
    for name, joint in found.friction.joints.items():
        values = zip(PARAMETERS, joint.friction.as_array().tolist(), joint.std.tolist(), UNITS, strict=True)
        for parameter, value, std, unit in values:
            by_constant = relative[name] * value if unit.startswith("Nm") else 0.0
            seen = parameter not in joint.unseen
            rows.append(NumberRow(name, parameter, value, float(np.hypot(std, by_constant)), unit, seen))
    return tuple(rows)


def _friction_unit(name: str) -> str:
    if not name.startswith("viscous"):
        return "Nm"
    _, _, exponent = name.partition("^")
    return f"Nm (s/rad)^{exponent}" if exponent else "Nms/rad"
