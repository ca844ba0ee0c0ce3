"""Replacement of constants that differ by less than their uncertainty: all of them become the same float."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXACT = (0.5, 1.0, 2.0)
"""Constants that are likely: a coefficient that may equal one of them becomes it."""

SMALLEST_UNCERTAINTY = 1e-15


class Constants:
    """A growing table of positive numbers. `merged` replaces each value by a number of the table that is equal within
    the uncertainty. Equal values then have equal bits.

    The most certain values are entered first and replace less certain ones near them. No value changes by more than the
    sum of two uncertainties, that of the value and that of the number in the table. No uncertain value joins two
    certain ones.
    """

    def __init__(self) -> None:
        self._entries: Array = np.array(EXACT)
        self._uncertainty: Array = np.full(len(EXACT), SMALLEST_UNCERTAINTY)

    def merged(self, values: Array, uncertainty: Array) -> Array:
        """Return, for each of k values, the number of the table that replaces it, with the value's sign. `uncertainty`
        is relative."""
        out = np.abs(values)
        uncertainty = np.maximum(uncertainty, SMALLEST_UNCERTAINTY)
        decade = np.floor(np.log10(uncertainty)).astype(int)
        for present in np.unique(decade):
            chosen = np.flatnonzero(decade == present)
            out[chosen] = self._looked_up(out[chosen], uncertainty[chosen])
        return np.copysign(out, values)

    def _looked_up(self, values: Array, uncertainty: Array) -> Array:
        """The nearest entries for values of about equal uncertainty; values that are near no entry become entries."""
        nearest = self._nearest(values)
        tolerance = (uncertainty + self._uncertainty[nearest]) * values
        known = np.abs(self._entries[nearest] - values) <= tolerance
        known &= self._uncertainty[nearest] <= 10.0 * uncertainty
        out = np.where(known, self._entries[nearest], values)
        if not known.all():
            unknown = np.flatnonzero(~known)
            out[unknown] = self._entered(values[unknown], uncertainty[unknown])
        return out

    def _nearest(self, values: Array) -> NDArray[np.int64]:
        right = np.clip(np.searchsorted(self._entries, values), 1, len(self._entries) - 1)
        is_left = values - self._entries[right - 1] < self._entries[right] - values
        return right - is_left

    def _entered(self, values: Array, uncertainty: Array) -> Array:
        """New entries for runs of neighbours: the value that is most certain, of equally certain ones the smallest. A
        value that this would move too far, as its run is long or the next value's doubt as large as that value, is in
        a run of its own."""
        order = np.lexsort((uncertainty, values))
        ordered, doubt = values[order], uncertainty[order]
        gap = np.diff(ordered) > (doubt[1:] + doubt[:-1]) * ordered[1:]
        run = np.concatenate([[0], np.cumsum(gap)])
        by_certainty = np.lexsort((ordered, doubt, run))
        first = by_certainty[np.searchsorted(run[by_certainty], np.arange(run[-1] + 1))]
        entries = ordered[first]
        self._insert(entries, doubt[first])
        too_far = np.abs(entries[run] - ordered) > (doubt + doubt[first][run]) * ordered
        out = np.empty_like(values)
        out[order] = entries[run]
        left = order[too_far]
        if len(left):
            out[left] = self._entered(values[left], uncertainty[left])
        return out

    def _insert(self, entries: Array, uncertainty: Array) -> None:
        joined = np.concatenate([self._entries, entries])
        order = np.argsort(joined, kind="stable")
        self._entries = joined[order]
        self._uncertainty = np.concatenate([self._uncertainty, uncertainty])[order]
