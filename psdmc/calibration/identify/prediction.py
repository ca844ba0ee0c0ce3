"""The numbers of a torque prediction other than theta_b, kept in a calibrated model file: enough to judge it by logs
alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from psdmc.calibration.identify.coupling import Matrix
from psdmc.calibration.identify.steps import StepOptions
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.friction.law import Term
from psdmc.friction.terms import every_joint_s

LINEAR = "linear"
"""The law of friction that is a sum of linear terms."""


@dataclass(frozen=True, slots=True)
class FrictionRunConstants:
    """Constants of a joint's friction run that are not friction: inertia in that pose (kg m^2), constant torque (N m),
    and the time between position and current (s)."""

    inertia: float
    offset: float
    delay: float


@dataclass(frozen=True, slots=True)
class Prediction:
    """Numbers of the prediction that are neither theta_b nor a row of friction or motors.

    law         of friction: "linear" (a sum of terms), or the name of a law with a state
    steps       filter and split by step: "all" of one log, else motor, gravity, friction, inertial
    sign_speed  rad/s over which friction changes sign, linear law
    exponents   of the terms of every joint, linear law;  offset  whether each joint has one
    coupling    C of q_joint = C q_motor, linear law: friction is of motors; empty: of joints
    runs        constants of the friction runs by joint, law with a state
    columns     tables of springs and further friction, linear law (columns.read_columns)
    """

    law: str
    steps: Mapping[str, StepOptions]
    sign_speed: float = 0.0
    exponents: tuple[float, ...] = ()
    offset: bool = False
    runs: Mapping[str, FrictionRunConstants] = field(default_factory=dict)
    coupling: Matrix = ()
    columns: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_linear(self) -> bool:
        return self.law == LINEAR

    @property
    def terms(self) -> tuple[Term, ...]:
        """Linear friction of every joint."""
        return every_joint_s(self.exponents, self.offset)

    def as_json(self) -> dict[str, Any]:
        """Plain values, which read back the same."""
        return (
            {
                "law": self.law,
                "steps": {
                    name: {"filter": asdict(step.filter), "split": asdict(step.split)}
                    for name, step in self.steps.items()
                },
                "sign_speed": self.sign_speed,
                "exponents": list(self.exponents),
                "offset": self.offset,
                "runs": {joint: asdict(constants) for joint, constants in self.runs.items()},
            }
            | ({"coupling": [list(row) for row in self.coupling]} if self.coupling else {})
            | ({"columns": self.columns} if self.columns else {})
        )


def prediction_from_json(kept: Mapping[str, Any]) -> Prediction:
    """The reverse of as_json; KeyError or TypeError where something is missing."""
    steps = {
        name: StepOptions(FilterOptions(**step["filter"]), SplitOptions(**step["split"]))
        for name, step in kept["steps"].items()
    }
    runs = {joint: FrictionRunConstants(**constants) for joint, constants in kept["runs"].items()}
    coupling = tuple(tuple(map(float, row)) for row in kept.get("coupling", ()))
    exponents, columns = tuple(kept["exponents"]), kept.get("columns", {})
    return Prediction(
        kept["law"], steps, kept["sign_speed"], exponents, kept["offset"], runs, coupling, columns
    )
