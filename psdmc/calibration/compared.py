"""The result of comparing two models of one robot: differences of values, of torques, and of errors on logs."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from psdmc.model.calibrated import OrNaN
from psdmc.model.calibrated_json import plain
from psdmc.model.grounds import OrInf

NOTICEABLE = 0.05
"""Share of a joint's RMS torque from which a controller notices a difference: feed-forward by the model is rarely better."""
SURE = 3.0
"""Standard deviations from which two values differ."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One value, such as a base parameter, of models a and b; `std` is that of b - a, infinite if unknown."""

    name: str
    equation: str
    unit: str
    a: OrNaN
    b: OrNaN
    std: OrInf

    @property
    def sigmas(self) -> float:
        """Return the difference b - a of the value, divided by its standard deviation; NaN if that is unknown."""
        return (self.b - self.a) / self.std if 0.0 < self.std < np.inf else float("nan")


@dataclass(frozen=True, slots=True)
class JointDifference:
    """How the torques of two models a and b differ for one joint over the workspace, N m (N).

    rms, largest  RMS and largest magnitude of the difference, torque of b minus torque of a
    typical       RMS of the torque of a
    gravity       RMS of the difference of gravity torques
    friction      RMS of the difference of friction torques
    inertia       largest relative difference of the inertia about the joint's axis
    """

    joint: str
    unit: str
    rms: float
    largest: float
    typical: float
    gravity: float
    friction: float
    inertia: float

    @property
    def share(self) -> float:
        return self.rms / self.typical if self.typical else 0.0

    @property
    def words(self) -> str:
        return (
            f"{self.joint}: feed-forward torque differs by {self.rms:.3g} {self.unit} RMS, {self.share:.0%} of the torque, "
            f"and by {self.largest:.3g} {self.unit} at most; gravity {self.gravity:.2g}, friction {self.friction:.2g} "
            f"{self.unit} RMS; the joint's inertia by up to {self.inertia:.0%}"
        )


@dataclass(frozen=True, slots=True)
class Curve:
    """Friction torque of two models against the speed of one joint, while the other joints rest."""

    joint: str
    unit: str
    speed: tuple[float, ...]
    a: tuple[float, ...]
    b: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class OnLog:
    """The errors of two models on the logs for one joint: R^2, RMS and largest error of the predicted torque, N m (N).
    Each is a pair, for model a and model b."""

    joint: str
    unit: str
    r2: tuple[OrNaN, OrNaN]
    rms: tuple[float, float]
    largest: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Comparison:
    """The result of comparing two models, a and b, of one robot.

    a, b        names of the models
    doubts      reasons why the comparison may be wrong; a user should read them first
    parameters  base parameters of both models, with the numbering and equations of model a
    friction    friction values of both models
    chi2        statistic of a chi-squared test that all base parameters are equal; NaN without standard deviations
    freedom     degrees of freedom of the chi-squared test
    chance      probability that equal robots would give a chi2 of at least this size; NaN without standard deviations
    joints      differences of torques for each joint
    curves      friction torque against speed for each joint
    on_log      errors of both models on logs for each joint
    """

    robot: str
    a: str
    b: str
    doubts: tuple[str, ...]
    parameters: tuple[Difference, ...]
    friction: tuple[Difference, ...]
    chi2: OrNaN
    freedom: int
    chance: OrNaN
    joints: tuple[JointDifference, ...]
    curves: tuple[Curve, ...] = ()
    on_log: tuple[OnLog, ...] = ()

    @property
    def surely(self) -> tuple[Difference, ...]:
        """Return the values that differ by more than three standard deviations. The values with the largest difference,
        in standard deviations, come first."""
        own = [row for row in (*self.parameters, *self.friction) if abs(row.sigmas) > SURE]
        return tuple(sorted(own, key=lambda row: -abs(row.sigmas)))

    @property
    def noticed(self) -> tuple[JointDifference, ...]:
        """Return the joints whose torques differ by more than NOTICEABLE, which matters for a controller."""
        return tuple(joint for joint in self.joints if joint.share > NOTICEABLE)

    def as_json(self) -> dict[str, Any]:
        """Return the result as plain values; numbers that are not finite become null."""
        values = asdict(self) | {"noticed": [joint.joint for joint in self.noticed]}
        for name in ("parameters", "friction"):
            for row, own in zip(values[name], getattr(self, name), strict=True):
                row["sigmas"] = own.sigmas
        values["codes"] = {"doubts": [getattr(text, "code", "") for text in self.doubts]}
        found: dict[str, Any] = plain(values)
        return found
