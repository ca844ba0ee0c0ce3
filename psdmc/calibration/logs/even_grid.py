"""Resamples a log to equal time steps. Rows of a log whose times already have equal steps stay unchanged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import interpolate

from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import AnyLog


@dataclass(frozen=True, slots=True, eq=False)
class EvenGrid:
    """The times of a log after resampling to equal steps, from the first row to the last, beginning at zero.

    time  s; the step is the median period of the log
    same  True: the rows of the log already have equal steps
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
    """Return position and effort of a log, interpolated at the times `first` to `last` of an evenly spaced grid.

    If the log already has these times, the function returns the logged rows unchanged.
    """
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
