"""The class Log: motion of the joints and effort of the motors, row by row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.wording import listed
from psdmc.errors import InputError

Array = NDArray[np.float64]
Quantity = Literal["current", "motor_torque", "joint_torque"]

QUANTITIES: tuple[Quantity, ...] = ("current", "motor_torque", "joint_torque")

Use = Literal["fit", "validate"]
USES: tuple[Use, ...] = ("fit", "validate")

LARGEST_NUMBER = 1e20
"""In any unit: a number beyond it is no time, angle or torque, and its square may overflow."""


MOST_STEPS = 1_000_000
RUNS = 100
"""Steps of time of which the median is taken, and consecutive ones in a long log."""


class Timed:
    """Properties of rows with a time: their number, duration and period."""

    __slots__ = ()
    time: Array

    def __len__(self) -> int:
        return len(self.time)

    @property
    def duration(self) -> float:
        """Time from the first row to the last, s."""
        return float(self.time[-1] - self.time[0]) if len(self) else 0.0

    @property
    def period(self) -> float:
        """Median time between rows, s; in a long log, of evenly spread runs of rows."""
        if len(self) < 2:
            return np.inf
        if len(self) <= MOST_STEPS:
            return float(np.median(np.diff(self.time)))
        length = MOST_STEPS // RUNS
        runs = [self.time[k : k + length] for k in np.linspace(0, len(self) - length, RUNS, dtype=int)]
        return float(np.median(np.diff(runs)))


@dataclass(frozen=True, slots=True, eq=False)
class Log(Timed):
    """Samples of one run of a robot, with N rows and n joints.

    name         name for messages
    joint_names  n names, in the order of the columns
    time         (N,) s
    position     (N, n) rad; m for sliding joints
    velocity     (N, n) rad/s (m/s), or None if the log has none
    effort       (N, n) A, N m or N, by `quantity`; motor torque is positive in the joint's positive direction
    quantity     current: motor current; motor_torque: torque including the friction torque; joint_torque: torque after
                 friction
    notes        assumptions that psdmc made when reading the log
    sliding      names of joints whose position is in m, while the others are in rad; None: the log does not say
    date         date of the data if the file tells, else empty
    use          fit: the log is for the fit; validate: the whole log is held out for validation
    motor_position  (N, n) rad; m for sliding joints: the motors' positions divided by the gear ratios, where elastic
                 joints have encoders on both sides; `position` is then the links'. A joint with one encoder has its
                 `position` here, too. None: no joint has two
    """

    name: str
    joint_names: tuple[str, ...]
    time: Array
    position: Array
    velocity: Array | None
    effort: Array
    quantity: Quantity
    notes: tuple[str, ...] = ()
    sliding: tuple[str, ...] | None = None
    date: str = ""
    use: Use = "fit"
    motor_position: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        shape = (len(np.asarray(self.time)), len(self.joint_names))
        object.__setattr__(self, "time", _column(self.time, shape[:1], f"{self.name}: time"))
        for what in ("position", "velocity", "effort", "motor_position"):
            values = getattr(self, what)
            if values is not None:
                object.__setattr__(self, what, _column(values, shape, f"{self.name}: {what}"))
        if self.quantity not in QUANTITIES:
            raise InputError(f"{self.name}: quantity {self.quantity!r}", f"known are {', '.join(QUANTITIES)}")

    def ordered(self, joint_names: tuple[str, ...]) -> Log:
        """Return a copy of the log with its columns in the order of `joint_names`.

        Raises InputError with all joints that the log lacks.
        """
        columns = places_of(self.name, self.joint_names, joint_names)
        return replace(self, joint_names=joint_names, **self._changed(lambda values: values[:, columns]))

    def _changed(self, change: Callable[[Array], Array]) -> dict[str, Any]:
        """All columns that the log has after a change, by name."""
        parts = {name: getattr(self, name) for name in ("position", "velocity", "effort", "motor_position")}
        return {name: change(values) for name, values in parts.items() if values is not None}

    @property
    def has_velocity(self) -> bool:
        return self.velocity is not None

    @property
    def of_motors(self) -> Log | None:
        """Return the log with the motors' positions as `position`; None if it has no motor positions."""
        if self.motor_position is None:
            return None
        return replace(self, position=self.motor_position, velocity=None, motor_position=None)

    def rows(self, start: int, stop: int) -> Log:
        """Return the rows from `start` to `stop` as a log."""
        return self.at(slice(start, stop))

    def at(self, rows: slice | NDArray[np.bool_]) -> Log:
        """Return the rows of a slice or a mask as a log."""
        return replace(self, time=self.time[rows], **self._changed(lambda values: values[rows]))

    def between(self, start: float, end: float) -> Log:
        """Return the rows with start <= time < end (s) as a log."""
        return self.at((self.time >= start) & (self.time < end))


def places_of(log: str, found: tuple[str, ...], wanted: tuple[str, ...]) -> list[int]:
    """Return the index in a log of each wanted joint. Raises InputError with all joints that are missing."""
    missing = [name for name in wanted if name not in found]
    if missing:
        raise InputError(
            f"{log}: no columns for joint(s) {listed(missing)}",
            f"the log has {listed(found)}; joints are matched by name",
        )
    return [found.index(name) for name in wanted]


def _column(values: object, shape: tuple[int, ...], what: str) -> Array:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise InputError(
            f"{what} has shape {array.shape}, expected {shape}", "one row per time, one column per joint"
        )
    array.setflags(write=False)
    return array


EARLIEST, LATEST = 9.0e8, 4.0e9
"""s since 1970 that are taken for a date: 1998 to 2096."""


def date_of(first_time: float) -> str:
    """Return the date (UTC) of a first row whose time counts in s since 1970, else an empty text.

    The date of the file itself is not used: it changes with copying, and the same log must give the same calibrated
    file.
    """
    if not EARLIEST < first_time < LATEST:
        return ""
    return datetime.fromtimestamp(first_time, UTC).date().isoformat()
