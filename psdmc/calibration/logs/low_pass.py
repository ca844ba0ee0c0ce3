"""The zero-phase low-pass filter: its options, its design for a sampling rate, and the length of its memory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from psdmc.calibration.logs.log import Array
from psdmc.errors import InputError

SMALLEST_CUTOFF, LARGEST_CUTOFF = 0.01, 10_000.0
"""Hz: a filter slower than minutes, or faster than any log of a robot, is a mistake."""


@dataclass(frozen=True, slots=True)
class FilterOptions:
    """Options of the low-pass filter of Denso-2022, 3.1. It runs forwards and backwards, so it has no phase shift.

    cutoff   Hz; the paper's: motor and gravity 4, friction 40, inertial 15
    order    of the Butterworth filter, which runs once in each direction
    settle   number of cut-off periods that are dropped at either end, where the filter has not settled
    """

    cutoff: float = 15.0
    order: int = 8
    settle: float = 3.0

    def __post_init__(self) -> None:
        if not SMALLEST_CUTOFF <= self.cutoff <= LARGEST_CUTOFF:
            raise InputError(
                f"cut-off is {self.cutoff:g} Hz, expected {SMALLEST_CUTOFF:g} to {LARGEST_CUTOFF:g} Hz",
                "choose a value in that range",
            )


@dataclass(frozen=True, slots=True, eq=False)
class LowPass:
    """A zero-phase Butterworth filter along axis 0 of an array, designed for one sample period.

    zeros, poles, gain  of its transfer function for one direction
    sections            second-order sections of the filter
    settled             internal state of the sections after a long constant input of one; it avoids a transient at the
                        start
    """

    zeros: Array
    poles: NDArray[np.complex128]
    gain: float
    sections: Array = field(init=False, repr=False)
    settled: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sections", signal.zpk2sos(self.zeros, self.poles, self.gain))
        object.__setattr__(self, "settled", signal.sosfilt_zi(self.sections))

    @staticmethod
    def design(options: FilterOptions, period: float) -> LowPass:
        nyquist = 0.5 / period
        if options.cutoff >= nyquist:
            raise InputError(
                f"cut-off {options.cutoff:g} Hz is not below half the sampling rate, {nyquist:g} Hz",
                "filter lower, or sample faster",
            )
        return LowPass(*signal.butter(options.order, options.cutoff, fs=1.0 / period, output="zpk"))

    @property
    def memory(self) -> int:
        """Return the number of rows after which the effect of a sample is smaller than rounding. At 1 kHz and 8 Hz,
        these are 3,700 rows."""
        return int(np.ceil(np.log(FORGOTTEN) / np.log(np.abs(self.poles).max())))

    def __call__(self, values: Array) -> Array:
        """Return what scipy.signal.sosfiltfilt returns. The start states are found once for a filter, not in each call."""
        pad = min(len(values) - 1, 3 * (2 * len(self.sections) + 1) * 8)
        before, behind = 2 * values[:1] - values[pad:0:-1], 2 * values[-1:] - values[-2 : -pad - 2 : -1]
        there = self._one_way(np.concatenate([before, values, behind]))
        back = self._one_way(there[::-1])[::-1]
        # Not a view in reverse order: sums over its rows would end in other digits once it was sent to a worker.
        return np.ascontiguousarray(back[pad : pad + len(values)])

    def _one_way(self, values: Array) -> Array:
        """Filter once, from the state in which the first value has always been there."""
        settled = self.settled.reshape(*self.settled.shape, *(1,) * (values.ndim - 1)) * values[:1]
        filtered, _ = signal.sosfilt(self.sections, values, axis=0, zi=settled)
        return np.asarray(filtered)


FORGOTTEN = 1e-16
"""Share of a sample's effect that counts as rounding."""


CLIPPED = 10.0
"""Typical deviations beyond which a sample counts as a fault instead of noise, and as this much."""
SMALLEST_SHARE = 0.05
"""Least share of the spectrum above the cut-off that is assumed: the filter leaves nothing to estimate noise from below
it."""
REST_DEVIATIONS = 10.0
"""Peak to peak of filtered noise, in standard deviations, over as many samples as logs have: 8 to 9 for normal noise."""
REST_STEPS = 3.0
"""Encoder steps within which a joint counts as resting: a position between two steps flickers."""
SEED = 30_301


def position_noise(position: Array, filtered: Array, in_band: float) -> Array:
    """Return the standard deviation (n,) of the sensor noise in one position sample, rad or m, for n joints.

    The low-pass filter removes the noise above its cut-off. White noise is assumed, so the removed part gives the
    whole.

    position, filtered  (N, n) positions before and after the filter, at N equal time steps
    in_band             share of a white noise's power that the filter lets pass
    """
    left = position - filtered
    left = left - np.median(left, axis=0)
    typical = 1.4826 * np.median(np.abs(left), axis=0)
    bound = CLIPPED * np.maximum(typical, smallest_steps(position))
    size = np.sqrt(np.mean(np.clip(left, -bound, bound) ** 2, axis=0))
    return np.asarray(size / np.sqrt(max(1.0 - in_band, SMALLEST_SHARE)))


def smallest_steps(position: Array) -> Array:
    """Return for each joint the smallest difference (n,) between two different position readings, rad or m.

    The result is zero for a joint whose readings are all equal. If a joint hardly moves, its readings are neighbouring
    counts of the encoder. The smallest difference is then one encoder step.
    """
    steps = np.zeros(position.shape[1])
    for k, column in enumerate(position.T):
        values = np.unique(column)
        steps[k] = float(np.diff(values).min()) if len(values) > 1 else 0.0
    return steps


def resting(
    position: Array, motion: Array, filtered_motion: Array, noise: Array, in_band: float, smallest: float
) -> NDArray[np.bool_]:
    """Return for each joint (n,) whether its motion is no more than sensor noise, a few encoder steps, or `smallest`
    (rad or m).

    motion, filtered_motion  (n,)  peak to peak, before and after the filter
    """
    by_noise = filtered_motion < REST_DEVIATIONS * noise * np.sqrt(in_band)
    return np.asarray(by_noise | (motion <= REST_STEPS * smallest_steps(position)) | (motion < smallest))


NOISE_CHUNK = 65_536
"""Rows that one seed draws: any row can then be drawn without those before it."""


def noise_like(noise: Array, first: int, last: int) -> Array:
    """Return simulated position noise (last - first, n) for rows `first` to `last` of a log.

    The result is the same in every call with the same arguments.

    noise  (n,) standard deviation for each of n joints, rad or m
    """
    parts = []
    for chunk in range(first // NOISE_CHUNK, (last - 1) // NOISE_CHUNK + 1):
        start = chunk * NOISE_CHUNK
        rng = np.random.default_rng(SEED if chunk == 0 else [SEED, chunk])
        drawn = rng.standard_normal((min(last - start, NOISE_CHUNK), len(noise)))
        parts.append(drawn[max(first - start, 0) :])
    return np.asarray(noise * np.concatenate(parts))
