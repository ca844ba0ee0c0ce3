"""From a log's rows to evenly spaced, smooth states: resampling, zero-phase low-pass, central differences, split."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, signal

from psdmc.calibration.logs.check_options import CheckOptions
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.logs.position_noise import noise_like, position_noise, resting
from psdmc.errors import InputError

SMALLEST_CUTOFF, LARGEST_CUTOFF = 0.01, 10_000.0
"""Hz: a filter slower than minutes, or faster than any log of a robot, is a slip."""


@dataclass(frozen=True, slots=True)
class FilterOptions:
    """Low-pass filtering as in Denso-2022 3.1: forwards and backwards, so that no phase is lost.

    cutoff   Hz; the paper's: motor and gravity 4, friction 40, inertial 15
    order    of the Butterworth filter that runs once each way
    settle   cut-off periods dropped at either end, where the filter starts up
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


@dataclass(frozen=True, slots=True)
class SplitOptions:
    """Which samples are held out for validation.

    held_out   share of the samples; the paper's 85/15
    blocks     0: the last part of the log; else the log is cut into this many blocks, and a share of them, evenly
               spread, is held out
    """

    held_out: float = 0.15
    blocks: int = 40


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """A filtered log on an even time grid. N samples, n joints.

    time, period      s
    q, qd, qdd        (N, n)  rad, rad/s, rad/s^2 (m for sliding joints)
    effort            (N, n)  as logged, filtered like q
    use               (N,)    False where the filter starts up
    low_pass          the filter, for predictions to be compared with `effort`
    cutoff            Hz, of that filter
    noise             (n,)    standard deviation of a raw position sample, rad (m); zero for joints that rest
    still             (n,)    joints whose motion is no more than noise: their rates are exactly zero
    """

    time: Array
    period: float
    q: Array
    qd: Array
    qdd: Array
    effort: Array
    use: NDArray[np.bool_]
    low_pass: LowPass
    cutoff: float
    noise: Array
    still: NDArray[np.bool_]

    def jittered(self) -> tuple[Array, Array, Array]:
        """q, qd, qdd (N, n) as another draw of the position noise would have made them."""
        draw = self.low_pass(noise_like(self.noise, len(self.time)))
        rate, acceleration = central_differences(draw, self.period)
        return self.q + draw, self.qd + rate, self.qdd + acceleration


@dataclass(frozen=True, slots=True, eq=False)
class LowPass:
    """A zero-phase Butterworth filter along axis 0, for one sample period."""

    sections: Array

    @staticmethod
    def design(options: FilterOptions, period: float) -> LowPass:
        nyquist = 0.5 / period
        if options.cutoff >= nyquist:
            raise InputError(
                f"cut-off {options.cutoff:g} Hz is not below half the sampling rate, {nyquist:g} Hz",
                "filter lower, or sample faster",
            )
        return LowPass(signal.butter(options.order, options.cutoff, fs=1.0 / period, output="sos"))

    def __call__(self, values: Array) -> Array:
        pad = min(len(values) - 1, 3 * (2 * len(self.sections) + 1) * 8)
        filtered: Array = signal.sosfiltfilt(self.sections, values, axis=0, padlen=pad)
        return filtered


def filtered(log: Log, options: FilterOptions, check: CheckOptions | None = None) -> States:
    """States of a checked log; a joint that does no more than its sensor's noise gets exactly zero rates, so that it
    excites nothing."""
    time, position, effort = evenly_spaced(log)
    period = float(time[1] - time[0])
    low_pass = LowPass.design(options, period)
    smooth = low_pass(position)
    in_band = min(2.0 * options.cutoff * period, 1.0)
    noise = position_noise(position, smooth, in_band)
    smallest = (check or CheckOptions()).smallest_motion
    still = resting(position, smooth, noise, in_band, smallest)
    q = np.where(still, np.mean(position, axis=0), smooth)
    qd, qdd = central_differences(q, period)
    margin = int(np.ceil(options.settle / options.cutoff / period))
    use = np.zeros(len(time), dtype=bool)
    use[margin : len(time) - margin] = True
    if not use.any():
        raise InputError(
            f"{log.name}: too short: {log.duration:.3g} s leave nothing after the {options.cutoff:g} Hz filter settled",
            "record a longer run",
        )
    noise = np.where(still, 0.0, noise)
    return States(time, period, q, qd, qdd, low_pass(effort), use, low_pass, options.cutoff, noise, still)


def evenly_spaced(log: Log) -> tuple[Array, Array, Array]:
    """Time, position and effort on an even grid of the log's median period; rows that are even already stay as they are."""
    time = log.time - log.time[0]
    count = round(log.duration / log.period) + 1
    even = np.linspace(0.0, log.duration, count)
    if count == len(log) and np.abs(even - time).max() < 1e-6 * log.period:
        return even, log.position, log.effort
    return (
        even,
        np.asarray(interpolate.PchipInterpolator(time, log.position)(even)),
        np.asarray(interpolate.PchipInterpolator(time, log.effort)(even)),
    )


def central_differences(q: Array, period: float) -> tuple[Array, Array]:
    """Speed and acceleration without phase: (q[k+1] - q[k-1]) / 2T and (q[k+1] - 2 q[k] + q[k-1]) / T^2."""
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    qd[1:-1] = (q[2:] - q[:-2]) / (2.0 * period)
    qdd[1:-1] = (q[2:] - 2.0 * q[1:-1] + q[:-2]) / period**2
    qd[0], qd[-1] = qd[1], qd[-2]
    return qd, qdd


def held_out(count: int, options: SplitOptions) -> NDArray[np.bool_]:
    """(count,) True where a sample is kept for validation."""
    if options.blocks == 0:
        return np.arange(count) >= round((1.0 - options.held_out) * count)
    block = np.arange(count) * options.blocks // max(count, 1)
    # block b is held out when the running share of held-out blocks falls behind the wanted one
    share = np.floor((np.arange(options.blocks) + 1) * options.held_out + 0.5)
    is_out = np.diff(share, prepend=np.floor(0.5)) > 0
    return np.asarray(is_out[block])


def thinned(states: States, options: FilterOptions) -> NDArray[np.intp]:
    """Indices of usable samples one cut-off's independence apart, 1/(2 f_c).

    Neighbouring filtered samples share their noise; counting each as new information would shrink standard
    deviations by the square root of the oversampling.
    """
    step = max(1, int(np.floor(0.5 / (options.cutoff * states.period))))
    return np.flatnonzero(states.use)[::step]


BLOCK_ROWS = 16384
"""Rows that are filtered at once."""
MEMORY_CYCLES = 30.0
"""Cut-off periods after which the filter has forgotten a sample to rounding: its slowest pole decays by
exp(-2 pi sin(pi / (2 order))) a period, which is to 0.29 at order 8."""


def smoothed_rows(states: States, at: NDArray[np.intp], values: Callable[[slice], Array]) -> Array:
    """(len(at), ...) low-passed values at rows `at`, block by block: a long log's values need not be held at once.

    values   of a slice of the log's rows, (rows, ...)
    The same as filtering all rows at once, but for what the filter remembers beyond MEMORY_CYCLES.
    """
    count = len(states.time)
    margin = int(np.ceil(MEMORY_CYCLES / states.cutoff / states.period))
    parts = []
    for start in range(0, count, BLOCK_ROWS):
        wanted = at[(at >= start) & (at < start + BLOCK_ROWS)]
        if not len(wanted):
            continue
        first, last = max(start - margin, 0), min(start + BLOCK_ROWS + margin, count)
        parts.append(_by_column(states.low_pass, values(slice(first, last)), wanted - first))
    return np.concatenate(parts)


def _by_column(low_pass: LowPass, values: Array, rows: NDArray[np.intp]) -> Array:
    """A filter's copies of one column are small, those of all columns are not."""
    flat = values.reshape(len(values), -1)
    smooth = np.stack([low_pass(column)[rows] for column in np.ascontiguousarray(flat.T)], axis=-1)
    return smooth.reshape(len(rows), *values.shape[1:])


def away_from(turning: NDArray[np.bool_], options: FilterOptions, period: float) -> NDArray[np.bool_]:
    """Samples that the filter does not mix with any turn: two periods of its cut-off away."""
    reach = int(np.ceil(2.0 / options.cutoff / period))
    before = np.concatenate([[0], np.cumsum(turning)])
    index = np.arange(len(turning))
    first, last = np.maximum(index - reach, 0), np.minimum(index + reach + 1, len(turning))
    return np.asarray(before[last] == before[first])
