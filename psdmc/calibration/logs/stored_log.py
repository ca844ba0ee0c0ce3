"""A log whose rows are on disk, for files larger than memory. It has the interface of Log."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import IO, Any, TypeVar

import numpy as np

from psdmc.calibration.logs.log import Array, Log, Quantity, Timed, Use, places_of
from psdmc.errors import InputError

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
            if 8 * self.width * self._count > self.held:
                self._to_disk()
        else:
            self._file.write(np.ascontiguousarray(rows, dtype=np.float64).tobytes())

    def _to_disk(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="psdmc_")  # noqa: SIM115  it lives as long as the store
        for piece in self._pieces:
            self._file.write(np.ascontiguousarray(piece, dtype=np.float64).tobytes())
        self._pieces = []

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
