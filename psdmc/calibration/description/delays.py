"""Columns that lag the time column, moved to the time at which they were true."""

from __future__ import annotations

import numpy as np
from scipy import interpolate

from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import RowStore
from psdmc.errors import InputError

BLOCK_ROWS = 65_536
NEIGHBOURS = 4
"""Rows on either side that interpolation between rows uses."""


def without_delays(time: Array, store: RowStore, delays: Array, name: str) -> tuple[Array, RowStore]:
    """The rows whose columns are all there, column k being its value `delays[k]` (s) later; InputError where time does
    not grow.

    time   (N,);  store  N rows of len(delays) columns
    """
    if not delays.any():
        return time, store
    if len(time) < 2 or not np.all(np.diff(time) > 0.0):
        raise InputError(
            f"{name}: its time does not grow from row to row: delays cannot be taken out",
            "sort the rows by time and drop doubled ones",
        )
    first = int(np.searchsorted(time, time[0] - min(float(delays.min()), 0.0)))
    stop = int(np.searchsorted(time, time[-1] - max(float(delays.max()), 0.0), side="right"))
    moved = RowStore(store.width, store.held)
    for start in range(first, stop, BLOCK_ROWS):
        own = time[start : min(start + BLOCK_ROWS, stop)]
        moved.append(_moved(time, store, own, start, delays, name))
    return time[first:stop], moved


def _moved(time: Array, store: RowStore, own: Array, start: int, delays: Array, name: str) -> Array:
    values = np.array(store.rows(start, start + len(own)))
    for delay in dict.fromkeys(delays[delays != 0.0].tolist()):
        begin, end = np.searchsorted(time, own[[0, -1]] + delay)
        low, high = max(int(begin) - NEIGHBOURS, 0), min(int(end) + NEIGHBOURS, len(time))
        columns = np.flatnonzero(delays == delay)
        around = store.rows(low, high)[:, columns]
        if not np.isfinite(around).all():
            raise InputError(
                f"{name}: a column with a delay holds values that are not finite near {own[0]:.6g} s",
                "cut the log to a clean stretch, or leave the delay out",
            )
        inside = np.clip(own + delay, time[low], time[high - 1])
        values[:, columns] = interpolate.PchipInterpolator(time[low:high], around)(inside)
    return values
