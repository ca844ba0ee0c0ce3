"""Puts the rows of a log on equal time steps. Rows that are there already stay unchanged; others are resampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import interpolate

from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import AnyLog


@dataclass(frozen=True, slots=True, eq=False)
class EvenGrid:
    """Equal time steps of a log's median period, from its first row to its last, beginning at zero.

    same  whether the log's rows already have these times
    """

    time: Array
    same: bool

    @property
    def count(self) -> int:
        return len(self.time)

    @property
    def period(self) -> float:
        return float(self.time[1] - self.time[0])


def even_grid(log: AnyLog) -> EvenGrid:
    """Return the times with equal steps for a log."""
    count = round(log.duration / log.period) + 1
    even = np.linspace(0.0, log.duration, count)
    same = count == len(log) and bool(np.abs(even - (log.time - log.time[0])).max() < 1e-6 * log.period)
    return EvenGrid(even, same)


NEIGHBOURS = 4
"""Rows on either side that interpolation between rows uses; its slopes need one."""


def evenly_spaced(log: AnyLog, grid: EvenGrid, first: int, last: int) -> tuple[Array, Array]:
    """Return position and effort at rows `first` to `last` of the grid. Rows that have equal steps already stay
    unchanged."""
    if grid.same:
        part = log.rows(first, last)
        return part.position, part.effort
    wanted = grid.time[first:last]
    begin, end = np.searchsorted(log.time - log.time[0], wanted[[0, -1]])
    part = log.rows(max(int(begin) - NEIGHBOURS, 0), int(end) + NEIGHBOURS)
    time = part.time - log.time[0]
    return (
        np.asarray(interpolate.PchipInterpolator(time, part.position)(wanted)),
        np.asarray(interpolate.PchipInterpolator(time, part.effort)(wanted)),
    )
