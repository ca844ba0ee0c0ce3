"""The verdict on a calibration: usable, usable with doubts, or not usable, with the figures behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

Word = Literal["usable", "usable, with doubts", "not usable"]

NOT_USABLE_STATUS = 6
"""Exit status of `psdmc calibrate` where the verdict is `not usable`."""


@dataclass(frozen=True, slots=True)
class JointFigures:
    """The figures by which one joint is judged; NaN where a figure does not exist.

    r2, rmse            on held-out data, whole torque (N m, N where the joint slides)
    gain, gain_std      measured torque, without friction, per torque by the file's own theta_b: one where the file is
                        right
    visible             whether the file's torque is large enough for its gain to count
    friction_power      W, mean power that friction takes: positive on any real joint
    friction_power_std  its standard deviation
    noise_ratio         residual over the sensor noise that passes the filter
    speed               rad/s (m/s), RMS
    """

    joint: str
    r2: float
    rmse: float
    gain: float
    gain_std: float
    visible: bool
    friction_power: float
    friction_power_std: float
    noise_ratio: float
    speed: float


@dataclass(frozen=True, slots=True)
class Delay:
    """s by which the torque of logs comes after their motion; std infinite where it may be longer still.

    shown  whether the logs show that there is one
    """

    log: str
    value: float
    std: float
    shown: bool

    @property
    def size(self) -> str:
        """The s without their sign, to two digits of the std."""
        return f"{abs(self.value):.3g}" if math.isinf(self.std) else f"{abs(self.value):.{self._digits}f}"

    @property
    def words(self) -> str:
        spread = " s or more" if math.isinf(self.std) else f" +- {self.std:.{self._digits}f} s"
        return f"{self.size}{spread} {'later' if self.value > 0 else 'earlier'}"

    @property
    def _digits(self) -> int:
        return max(0, 1 - math.floor(math.log10(max(self.std, 1e-6))))


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict with all reasons and doubts.

    reasons    why it is not usable; empty where it is
    doubts     what a user should know before using it
    suspects   possible explanations of a bad fit: joints swapped, signs reversed, units
    joints     figures, in the model's order
    samples_per_unknown   independent samples per fitted unknown, the smallest of all steps
    delays     of torques behind the motion, log by log
    """

    reasons: tuple[str, ...]
    doubts: tuple[str, ...]
    suspects: tuple[str, ...]
    joints: tuple[JointFigures, ...]
    samples_per_unknown: float
    delays: tuple[Delay, ...] = ()

    @property
    def usable(self) -> bool:
        return not self.reasons

    @property
    def word(self) -> Word:
        if self.reasons:
            return "not usable"
        return "usable, with doubts" if self.doubts else "usable"

    @property
    def exit_status(self) -> int:
        """Exit status of the command line: 0 for both usable verdicts."""
        return 0 if self.usable else NOT_USABLE_STATUS

    def lines(self) -> list[str]:
        """The verdict as text: the word first, then its grounds."""
        return [
            f"verdict: {self.word}",
            *(f"  not usable: {reason}" for reason in self.reasons),
            *(f"  likely: {suspect}" for suspect in self.suspects),
            *(f"  doubt: {doubt}" for doubt in self.doubts),
        ]

    def as_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become null."""
        return {
            "verdict": self.word,
            "usable": self.usable,
            "reasons": list(self.reasons),
            "suspects": list(self.suspects),
            "doubts": list(self.doubts),
            "samples_per_unknown": _plain(self.samples_per_unknown),
            "delays": [
                {"log": delay.log, "seconds": delay.value, "std": _plain(delay.std)} for delay in self.delays
            ],
            "joints": {figures.joint: _figures(figures) for figures in self.joints},
        }


def _figures(figures: JointFigures) -> dict[str, Any]:
    numbers = (
        "r2",
        "rmse",
        "gain",
        "gain_std",
        "friction_power",
        "friction_power_std",
        "noise_ratio",
        "speed",
    )
    return {name: _plain(getattr(figures, name)) for name in numbers} | {"visible": figures.visible}


def _plain(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def listed(names: Sequence[str]) -> str:
    """'a', 'a and b', 'a, b and c'."""
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))
