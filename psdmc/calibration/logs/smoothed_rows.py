"""Computes low-pass filtered values at few rows of a long log, at less cost than the filter has on all rows.

The filter's response to one sample is a sum of oscillations that decay on both sides, one for each pole. So the samples
of a block act on later and on earlier blocks by a few weighted sums. See Oppenheim and Schafer, Discrete-Time Signal
Processing, 6.3.3 (parallel form).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.filter import States
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.low_pass import LowPass

ZERO_POLE = 1e-14
"""Size of a pole that stands for zero: filters of odd order at a quarter of the sampling rate have one."""
AT_ONCE = 8192
"""Rows whose values are computed at once: a multiple of BLOCK."""
BLOCK = 256
"""Rows that act on other blocks by the same sums."""


def smoothed_rows(states: States, at: NDArray[np.intp], values: Callable[[slice], Array]) -> Array:
    """Return values at some rows of a log after low-pass filtering over time, for quantities computed from the log's
    states.

    at      indices of the wanted rows, in order; the result has one row for each
    values  function from a slice of the log's rows to the quantity (rows, ...) at these rows

    Few values are in memory at once. The result equals that of filtering all rows at once, up to effects of rows beyond
    the filter's memory.
    """
    count, margin = len(states.time), states.low_pass.memory
    if count <= 2 * margin:
        return _by_column(states.low_pass, values(slice(0, count)), at)
    early, late = np.searchsorted(at, [margin, count - margin])
    parts = []
    if early:
        parts.append(_by_column(states.low_pass, values(slice(0, 2 * margin)), at[:early]))
    if early < late:
        parts.append(Decays.of(states.low_pass).at(at[early:late], values, margin))
    if late < len(at):
        end = count - 2 * margin
        parts.append(_by_column(states.low_pass, values(slice(end, count)), at[late:] - end))
    return np.concatenate(parts) if parts else values(slice(0, 1))[:0]


def _by_column(low_pass: LowPass, values: Array, rows: NDArray[np.intp]) -> Array:
    """The filtered values near the ends of a log, column by column: the filter's copies of one column are small."""
    flat = values.reshape(len(values), -1)
    columns = np.ascontiguousarray(flat.T)
    smooth = np.stack(
        [low_pass(column)[rows] if column.any() else np.zeros(len(rows)) for column in columns], axis=-1
    )
    return smooth.reshape(len(rows), *values.shape[1:])


@dataclass(frozen=True, slots=True, eq=False)
class Decays:
    """The response of a zero-phase filter to a sample of one: the sum over poles of Re(size pole^d), d rows away.

    poles   (P,) poles with an imaginary part of at least zero
    sizes   (P,) factors; those of pairs of poles count twice
    centre  response at d = 0, of which a part decays at once
    """

    poles: NDArray[np.complex128]
    sizes: NDArray[np.complex128]
    centre: float

    @staticmethod
    def of(low_pass: LowPass) -> Decays:
        """Return the partial fractions of H(z) H(1/z) for the filter's transfer function H(z)."""
        zeros, gain = low_pass.zeros, low_pass.gain
        poles = np.where(np.abs(low_pass.poles) < ZERO_POLE, ZERO_POLE, low_pass.poles)
        kept, sizes = poles[poles.imag >= 0.0], []
        for pole in kept:
            others = poles[poles != pole]
            forward = np.prod(pole - zeros) / np.prod(pole - others)
            backward = np.prod(1.0 / pole - zeros) / np.prod(1.0 / pole - poles)
            sizes.append(gain**2 * forward * backward / pole * (2.0 if pole.imag else 1.0))
        # A constant signal stays as it is: all responses add up to one.
        later = np.sum(np.array(sizes) * kept / (1.0 - kept)).real
        return Decays(kept, np.array(sizes), float(1.0 - 2.0 * later))

    def response(self, rows: NDArray[np.intp]) -> Array:
        """Return the response at some numbers of rows before or behind a sample."""
        decayed = (self.sizes * self.poles ** np.abs(rows)[..., None]).real.sum(axis=-1)
        return np.asarray(np.where(rows == 0, self.centre, decayed))

    def at(self, rows: NDArray[np.intp], values: Callable[[slice], Array], margin: int) -> Array:
        """Return the filtered values (k, ...) at k increasing rows, from the values of all rows up to `margin` away.

        values  function from a slice of rows to the values (rows, ...) at these rows
        """
        first, last = int(rows[0]) - margin, int(rows[-1]) + margin + 1
        inside, near = np.arange(BLOCK), self.response(np.arange(BLOCK))
        weights = np.vstack([_parts(self.poles ** inside[::-1, None]), _parts(self.poles ** inside[:, None])])
        own, smooth, sums = rows - first, [], []
        for start in range(first, last, AT_ONCE):
            part = values(slice(start, min(start + AT_ONCE, last)))
            shape, flat = part.shape[1:], part.reshape(len(part), -1)
            sums.append(_sums(weights, flat))
            for k, block in enumerate(
                np.split(flat, range(BLOCK, len(flat), BLOCK)), (start - first) // BLOCK
            ):
                place = own[slice(*np.searchsorted(own, [BLOCK * k, BLOCK * (k + 1)]))] - BLOCK * k
                smooth.append(near[np.abs(place[:, None] - inside[: len(block)])] @ block)
        found = np.concatenate(smooth)
        self._add_other_blocks(found, own, *np.split(np.concatenate(sums), 2, axis=1))
        return found.reshape(len(rows), *shape)

    def _add_other_blocks(self, found: Array, rows: NDArray[np.intp], ahead: Array, behind: Array) -> None:
        """Add to filtered values (k, columns) the effects of earlier and of later blocks, from sums over each block."""
        decayed = self.sizes * self.poles ** np.arange(BLOCK + 1)[:, None]
        onto, onward = np.hstack([decayed.real, -decayed.imag]), _turning(self.poles**BLOCK)
        bounds = np.searchsorted(rows, BLOCK * np.arange(len(ahead) + 1)).tolist()
        blocks = [(k, slice(*own)) for k, own in enumerate(pairwise(bounds))]
        state = np.zeros_like(ahead[0])
        for k, own in blocks:
            found[own] += onto[rows[own] - BLOCK * k + 1] @ state
            state = onward @ state + ahead[k]
        state = np.zeros_like(state)
        for k, own in reversed(blocks):
            found[own] += onto[BLOCK * (k + 1) - rows[own]] @ state
            state = onward @ state + behind[k]


def _sums(weights: Array, values: Array) -> Array:
    """(blocks, sums, columns): weighted sums of each block of values, of which the last may be shorter."""
    full = len(values) // BLOCK * BLOCK
    whole = weights @ values[:full].reshape(-1, BLOCK, values.shape[1])
    rest = values[full:]
    return np.concatenate([whole, (weights[:, : len(rest)] @ rest)[None]]) if len(rest) else whole


def _parts(powers: NDArray[np.complex128]) -> Array:
    """(2P, rows): the real parts of powers (rows, P), then the imaginary ones."""
    return np.asarray(np.hstack([powers.real, powers.imag]).T)


def _turning(factors: NDArray[np.complex128]) -> Array:
    """(2P, 2P): the product with complex factors, for real parts followed by imaginary ones."""
    return np.block(
        [[np.diag(factors.real), -np.diag(factors.imag)], [np.diag(factors.imag), np.diag(factors.real)]]
    )
