"""Rows as logged into rows in SI units, by joints: zeros and factors, delays, coupled motors, start and end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.description.columns_found import Found
from psdmc.calibration.description.delays import without_delays
from psdmc.calibration.description.table_coupling import CouplingEntry
from psdmc.calibration.description.table_logs import LogEntry
from psdmc.calibration.description.table_quantities import refused
from psdmc.calibration.identify.coupling import coupling_of
from psdmc.calibration.logs.log import Array, Quantity
from psdmc.calibration.logs.stored_log import RowStore


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Columns of a store: position, velocity where all have one, effort; n each.

    factors, zeros  (columns,)  SI value = factor * (number - zero)
    sliding         names of joints in m; None where a unit was not said
    """

    columns: tuple[Found, ...]
    factors: Array
    zeros: Array
    has_velocity: bool
    quantity: Quantity
    sliding: tuple[str, ...] | None
    notes: tuple[str, ...]


def in_si(
    time: Array, store: RowStore, layout: Layout, coupling: CouplingEntry, entry: LogEntry
) -> tuple[Array, RowStore]:
    """The rows in SI units, delays taken out, of joints, between the entry's start and end.

    Numbers that are not finite stay what they are: the checks of a log name them.
    """
    delays = np.array([found.delay for found in layout.columns])
    begin = time[0]
    time, store = without_delays(time, store, delays, entry.name)
    with np.errstate(invalid="ignore", over="ignore"):
        first, stop = _kept(time - begin, entry)
        if first >= stop:
            lasts = f"it lasts {float(time[-1] - begin):.4g} s" if len(time) else "nothing is left of it"
            raise refused(f"{entry.name}: no rows from {entry.start:g} to {entry.end:g} s, {lasts}")
        maps = _maps(layout, coupling)
        converted = RowStore(store.width, store.held)
        for start in range(first, stop, BLOCK_ROWS):
            rows = (store.rows(start, min(start + BLOCK_ROWS, stop)) - layout.zeros) * layout.factors
            parts = np.split(rows, len(maps), axis=1)
            converted.append(np.hstack([onto(part) for onto, part in zip(maps, parts, strict=True)]))
    return time[first:stop], converted


def _maps(layout: Layout, coupling: CouplingEntry) -> list[Callable[[Array], Array]]:
    """What turns a quantity's columns into the joints', in the order of a store's quantities."""
    motions = [coupling.position, *([coupling.velocity] if layout.has_velocity else [])]
    maps = [_same if found is None else found.to_joints for found in map(coupling_of, motions)]
    torques = coupling_of(coupling.effort)
    return [*maps, _same if torques is None else torques.torque_of_joints]


def _same(values: Array) -> Array:
    return values


def _kept(time: Array, entry: LogEntry) -> tuple[int, int]:
    """First row between start and end, and the one after the last; time counts from the log's first row."""
    first = int(np.searchsorted(time, entry.start)) if entry.start > 0.0 else 0
    stop = int(np.searchsorted(time, entry.end, side="right")) if np.isfinite(entry.end) else len(time)
    return first, stop


BLOCK_ROWS = 65_536
"""Rows converted at once."""
