"""What a calibration found, as tables: the report and the model file are made from it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibrate.four_steps import FourSteps
from psdmc.calibrate.linear_fit import LinearResult
from psdmc.calibrate.log import Array
from psdmc.calibrate.lugre import PARAMETERS, UNITS
from psdmc.calibrate.steps import StepQuality
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.equations import base_parameters


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One base parameter of table 4; std is infinite and value the model's own (or zero) where unidentifiable."""

    name: str
    group: str
    value: float
    std: float
    unit: str
    equation: str
    identifiable: bool

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


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Everything a calibration hands on.

    model     the calibrated model, its provenance carrying `numbers`
    motors    torque constants; friction: seven per joint, or Coulomb, viscous and offset
    steps     table 3's columns
    facts     plain values: ranks, condition numbers, singular values, delay, options
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

    def as_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become null."""
        return {
            "robot": self.robot,
            "method": self.method,
            "joints": list(self.joint_names),
            "base_parameters": [
                {
                    "name": row.name,
                    "group": row.group,
                    "value": row.value,
                    "std": _finite(row.std),
                    "relative": _finite(row.relative),
                    "unit": row.unit,
                    "equation": row.equation,
                    "identifiable": row.identifiable,
                }
                for row in self.parameters
            ],
            "motors": [_number(row) for row in self.motors],
            "friction": [_number(row) for row in self.friction],
            "quality": {step.step: _quality(step) for step in self.steps},
            "warnings": list(self.warnings),
            "facts": self.facts,
        }


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
    }


def _quality(step: StepQuality) -> dict[str, Any]:
    return {
        name: {
            "fit": {"rmse": _finite(both.fit.rmse), "r2": _finite(both.fit.r2)},
            "held_out": {"rmse": _finite(both.held_out.rmse), "r2": _finite(both.held_out.r2)},
        }
        for name, both in step.joints.items()
    }


def four_step_record(model: DynamicsModel, found: FourSteps) -> Calibration:
    """The record of a campaign."""
    inertial, gravity = found.inertial, found.gravity
    groups = ["inertial"] * model.l
    for k in gravity.split.pivots:
        groups[int(k)] = "gravity"
    theta = _kept(model, inertial.theta_b, inertial.identifiable)
    facts = {
        "delay_s": found.friction.delay,
        "gravity_rank": gravity.estimate.rank,
        "gravity_condition": gravity.estimate.condition,
        "gravity_singular_values": gravity.estimate.singular_values.tolist(),
        "inertial_rank": inertial.estimate.rank,
        "inertial_condition": inertial.estimate.condition,
        "inertial_singular_values": inertial.estimate.singular_values.tolist(),
        "residual_correlation": dict(
            zip(model.joint_names, inertial.estimate.correlation.tolist(), strict=True)
        ),
    }
    steps = (gravity.quality, found.friction.quality, inertial.inertial, inertial.everything)
    return _with_model(
        Calibration(
            robot=model.chain.name,
            method="four steps",
            joint_names=model.joint_names,
            model=model,
            parameters=_parameter_rows(model, theta, inertial.std, groups),
            motors=_motor_rows(model, found),
            friction=_lugre_rows(model, found),
            steps=steps if found.motor is None else (found.motor.quality, *steps),
            warnings=found.warnings,
            facts=facts,
        ),
        theta,
    )


def linear_record(
    model: DynamicsModel,
    found: LinearResult,
    theta_b: Array | None = None,
    quality: StepQuality | None = None,
) -> Calibration:
    """The record of a linear fit; theta_b and quality of its physically consistent version, where there is one."""
    values = found.theta_b if theta_b is None else theta_b
    seen = found.identifiable | (theta_b is not None)
    theta = _kept(model, values, seen)
    facts = {
        "rank": found.estimate.rank,
        "condition": found.estimate.condition,
        "singular_values": found.estimate.singular_values.tolist(),
        "physically_consistent": theta_b is not None,
        "residual_correlation": dict(
            zip(model.joint_names, found.estimate.correlation.tolist(), strict=True)
        ),
    }
    friction = tuple(
        NumberRow(
            joint, name, float(found.friction[k, j]), float(found.friction_std[k, j]), _friction_unit(name)
        )
        for k, joint in enumerate(model.joint_names)
        for j, name in enumerate(found.friction_names)
    )
    return _with_model(
        Calibration(
            robot=model.chain.name,
            method="linear fit, physically consistent" if theta_b is not None else "linear fit",
            joint_names=model.joint_names,
            model=model,
            parameters=_parameter_rows(model, theta, found.std, ["all"] * model.l),
            motors=(),
            friction=friction,
            steps=(found.quality if quality is None else quality,),
            warnings=found.warnings,
            facts=facts,
        ),
        theta,
    )


def with_theta(record: Calibration, theta_b: Array, warnings: tuple[str, ...] = ()) -> Calibration:
    """The same calibration with other base parameters: the physically consistent ones nearest to what was found."""
    rows = tuple(replace(row, value=float(v)) for row, v in zip(record.parameters, theta_b, strict=True))
    method = f"{record.method}, physically consistent"
    changed = replace(record, method=method, parameters=rows, warnings=(*record.warnings, *warnings))
    return _with_model(changed, theta_b)


def _kept(model: DynamicsModel, theta_b: Array, identifiable: NDArray[np.bool_]) -> Array:
    """What the data do not see stays as the model has it, or zero."""
    own = np.zeros(model.l) if model.theta_b is None else model.theta_b
    return np.where(identifiable, theta_b, own)


def _with_model(record: Calibration, theta_b: Array) -> Calibration:
    numbers = record.as_json()
    provenance = {**record.model.provenance, "calibration": numbers}
    return replace(record, model=replace(record.model, theta_b=theta_b, provenance=provenance))


def _parameter_rows(
    model: DynamicsModel, theta: Array, std: Array, groups: list[str]
) -> tuple[ParameterRow, ...]:
    return tuple(
        ParameterRow(
            name=f"theta_{k + 1}",
            group=groups[k],
            value=float(theta[k]),
            std=float(std[k]),
            unit=parameter.unit,
            equation=parameter.equation,
            identifiable=bool(np.isfinite(std[k])),
        )
        for k, parameter in enumerate(base_parameters(model))
    )


def _motor_rows(model: DynamicsModel, found: FourSteps) -> tuple[NumberRow, ...]:
    """None where torques were logged; a constant that was given, not identified, is marked as not seen."""
    constants, relative = found.motors.torque_constant, found.motors.relative_std
    if found.motor is None and np.all(constants == 1.0):
        return ()
    seen = np.zeros(model.n, dtype=bool) if found.motor is None else found.motor.identified
    return tuple(
        NumberRow(name, "torque_constant", float(value), float(abs(value) * share), "Nm/A", bool(known))
        for name, value, share, known in zip(model.joint_names, constants, relative, seen, strict=True)
    )


def _lugre_rows(model: DynamicsModel, found: FourSteps) -> tuple[NumberRow, ...]:
    """The seven per joint; forces carry the torque constant's uncertainty too."""
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
