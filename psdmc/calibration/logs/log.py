"""A log of motion and effort, row by row: in memory (Log), or on disk if it is larger than memory (StoredLog). The two
have the same interface."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import IO, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.foreign_bytes import listed
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


# Logs larger than memory


HELD_BYTES = 128 * 1024**2
"""Bytes of rows kept in memory: 800,000 rows of seven joints; beyond, they go to a temporary file."""


class RowStore:
    """A store of rows with equal width, in memory or in a temporary file, which is removed with the store.

    width   numbers per row
    held    most bytes in memory before the file is used
    kept    results of passes over all rows of logs (`once`)
    """

    def __init__(self, width: int, held: int = HELD_BYTES) -> None:
        self.width, self.held = width, held
        self.kept: dict[Hashable, Any] = {}
        self._pieces: list[Array] = []
        self._file: IO[bytes] | None = None
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def on_disk(self) -> bool:
        return self._file is not None

    def append(self, rows: Array) -> None:
        """Append rows (k, width) to the store."""
        if rows.ndim != 2 or rows.shape[1] != self.width:
            raise ValueError(f"rows of shape {rows.shape}, expected (k, {self.width})")
        self._count += len(rows)
        if self._file is None:
            self._pieces.append(rows)
            if 8 * self.width * self._count <= self.held:
                return
            self._file = tempfile.TemporaryFile(prefix="psdmc_")  # noqa: SIM115  it lives as long as the store
            pieces, self._pieces = self._pieces, []
        else:
            pieces = [rows]
        for piece in pieces:
            self._file.write(np.ascontiguousarray(piece, dtype=np.float64).tobytes())

    def rows(self, start: int, stop: int) -> Array:
        """Return a copy of some rows, (stop - start, width)."""
        stop = min(stop, self._count)
        if self._file is None:
            if len(self._pieces) > 1:
                self._pieces = [np.concatenate(self._pieces)]
            return self._pieces[0][start:stop] if self._pieces else np.zeros((0, self.width))
        self._file.seek(8 * self.width * start)
        content = self._file.read(8 * self.width * (stop - start))
        return np.frombuffer(content, dtype=np.float64).reshape(-1, self.width)


@dataclass(frozen=True, slots=True, eq=False)
class StoredLog(Timed):
    """A log whose rows are in a RowStore in memory or on disk. It has the fields of Log, with N rows and n joints.

    The method `rows` reads positions, velocities, motor positions and efforts.

    time          (N,) s, in memory
    store         rows, each with the positions, velocities (if there are any), motor positions (if there are any) and
                  efforts of `stored` joints
    has_velocity  False: the velocities in the store have no meaning
    places        (n,) indices of the log's n joints among the `stored` joints
    first         row of the store that is the log's first
    motors_at     column of the store from which on motor positions are; 0: there are none
    position_at   column of the store from which on the positions are
    """

    name: str
    joint_names: tuple[str, ...]
    time: Array
    store: RowStore
    has_velocity: bool
    quantity: Quantity
    stored: int
    places: tuple[int, ...]
    notes: tuple[str, ...] = ()
    sliding: tuple[str, ...] | None = None
    date: str = ""
    use: Use = "fit"
    first: int = 0
    motors_at: int = 0
    position_at: int = 0

    @property
    def of_motors(self) -> StoredLog | None:
        """Return the log with the motors' positions as positions; None if it has no motor positions."""
        if not self.motors_at:
            return None
        return replace(self, position_at=self.motors_at, motors_at=0, has_velocity=False)

    def ordered(self, joint_names: tuple[str, ...]) -> StoredLog:
        """Return a copy of the log with its columns in the order of `joint_names`.

        Raises InputError with all joints that the log lacks.
        """
        found = places_of(self.name, self.joint_names, joint_names)
        return replace(self, joint_names=joint_names, places=tuple(self.places[k] for k in found))

    def rows(self, start: int, stop: int) -> Log:
        """Return the rows from `start` to `stop` as a log in memory."""
        values, places = self.store.rows(self.first + start, self.first + stop), list(self.places)

        def part(first: int) -> Array:
            return values[:, first : first + self.stored][:, places]

        return Log(
            name=self.name,
            joint_names=self.joint_names,
            time=self.time[start:stop],
            position=part(self.position_at),
            velocity=part(self.stored) if self.has_velocity else None,
            effort=part(values.shape[1] - self.stored),
            quantity=self.quantity,
            sliding=self.sliding,
            motor_position=part(self.motors_at) if self.motors_at else None,
        )

    def held(self) -> Log:
        """Return the whole log in memory."""
        return replace(self.rows(0, len(self)), notes=self.notes, date=self.date, use=self.use)


AnyLog = Log | StoredLog

Found = TypeVar("Found")


def once(log: AnyLog, given: Hashable, of_all_rows: Callable[[], Found]) -> Found:
    """Return a result that depends on all rows of a log and on `given`. For a log on disk, whose rows take minutes to
    read, it is computed once."""
    if not isinstance(log, StoredLog):
        return of_all_rows()
    words = (log.joint_names, log.quantity, log.has_velocity, *log.time[[0, -1]].tolist())
    key = (given, words, log.first, len(log), log.places, log.position_at, log.motors_at)
    if key not in log.store.kept:
        log.store.kept[key] = of_all_rows()
    found: Found = log.store.kept[key]
    return found


def without_start(log: AnyLog, seconds: float) -> AnyLog:
    """Return a log without its first `seconds`. Raises InputError if nothing is left."""
    later = log.time >= log.time[0] + seconds if len(log) else np.zeros(0, dtype=bool)
    if not later.any():
        lasts = f"it lasts {log.duration:.4g} s"
        raise InputError(
            f"{log.name}: no rows after the first {seconds:g} s: {lasts}", "leave out less: --warm"
        )
    first, notes = int(np.argmax(later)), (*log.notes, f"{log.name}: the first {seconds:g} s are left out")
    if isinstance(log, StoredLog):
        return replace(log, time=log.time[first:], first=log.first + first, notes=notes)
    return replace(log.rows(first, len(log)), notes=notes)
