"""The result of a calibration as tables, from which the report and the model file are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from psdmc.calibration.identify.prediction import Prediction
from psdmc.calibration.identify.steps import StepQuality
from psdmc.calibration.identify.visibility import IDENTIFIED
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
