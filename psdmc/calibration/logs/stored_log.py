"""A log whose rows are on disk: the interface of Log for files larger than memory."""

from __future__ import annotations

from dataclasses import dataclass, replace

from psdmc.calibration.logs.log import Array, Log, Quantity, Timed, Use, places_of
from psdmc.calibration.logs.row_store import RowStore


@dataclass(frozen=True, slots=True, eq=False)
class StoredLog(Timed):
    """A Log's fields; position, velocity and effort are read with `rows`. N rows, n joints.

    time    (N,)  s, held in memory
    store   rows of positions, velocities (unused unless `has_velocity`) and efforts, of `stored` joints each
    places  (n,)  of this log's joints among those
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

    def ordered(self, joint_names: tuple[str, ...]) -> StoredLog:
        """The same log with its columns in the order of these joints; InputError names every joint that is missing."""
        found = places_of(self.name, self.joint_names, joint_names)
        return replace(self, joint_names=joint_names, places=tuple(self.places[k] for k in found))

    def rows(self, start: int, stop: int) -> Log:
        """Some rows as a log in memory."""
        values, places = self.store.rows(start, stop), list(self.places)
        position, velocity, effort = values[:, : self.stored], None, values[:, -self.stored :]
        if self.has_velocity:
            velocity = values[:, self.stored : 2 * self.stored][:, places]
        return Log(
            name=self.name,
            joint_names=self.joint_names,
            time=self.time[start:stop],
            position=position[:, places],
            velocity=velocity,
            effort=effort[:, places],
            quantity=self.quantity,
            sliding=self.sliding,
        )

    def held(self) -> Log:
        """The same log in memory."""
        return replace(self.rows(0, len(self)), notes=self.notes, date=self.date, use=self.use)


AnyLog = Log | StoredLog
