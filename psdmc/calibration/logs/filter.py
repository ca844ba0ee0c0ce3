"""Computes smooth states from a log: resampling to equal time steps, zero-phase low-pass filter, central differences,
and the split for validation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate

from psdmc.calibration.logs.log import AnyLog, Array, Log, once
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.logs.log_survey import STRETCH_ROWS
from psdmc.calibration.logs.low_pass import (
    FilterOptions,
    LowPass,
    noise_like,
    position_noise,
    resting,
)
from psdmc.errors import InputError


@dataclass(frozen=True, slots=True)
class SplitOptions:
    """The choice of samples that are held out for validation.

    held_out   share of the samples; the paper (Denso-2022) holds out 15 %
    blocks     0: the last part of the log; else the log is divided into this many blocks, and a share of them, evenly
               spread, is held out
    """

    held_out: float = 0.15
    blocks: int = 40


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """The states of a log after low-pass filtering, at N equal time steps, for n joints.

    time, period  s
    q, qd, qdd    (N, n) rad, rad/s, rad/s^2 (m for sliding joints)
    effort        (N, n) as logged, filtered like q
    use           (N,) False at the ends of the log, where the filter has not settled
    low_pass      the filter, for predictions that are compared with `effort`
    cutoff        Hz, of the filter
    noise         (n,) standard deviation of an unfiltered position sample, rad (m); zero for joints that rest
    still         (n,) True: the joint moves no more than the sensor's noise, so its rates are set to zero
    motion        (n,) range of each position in the whole log, peak to peak, rad (m)
    first         index of the first row within the resampled log, if these rows are a part of the log
    raw           (N, n) effort before the filter
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
    motion: Array
    first: int
    raw: Array

    def jittered(self) -> tuple[Array, Array, Array]:
        """Return q, qd, qdd (N, n) with simulated sensor noise added, to test how noise affects a fit.

        The noise has the standard deviations `noise` and passes the same filter and differences as the log.
        """
        draw = self.low_pass(noise_like(self.noise, self.first, self.first + len(self.time)))
        rate, acceleration = central_differences(draw, self.period)
        return self.q + draw, self.qd + rate, self.qdd + acceleration


def filtered(log: Log, options: FilterOptions) -> States:
    """Resample and filter a log in memory, and return positions, speeds, accelerations and efforts of all joints.

    A joint that moves by no more than the sensor's noise counts as resting. Its speeds and accelerations are exactly
    zero, so that noise is not taken for motion.
    """
    grid = even_grid(log)
    low_pass = LowPass.design(options, grid.period)
    return _states(grid, low_pass, noticed(grid, low_pass, options), options, 0, grid.count)


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """The filtered states of a part of a log, with additional rows before and after the part that the filter needs.

    states  states of the part and of the additional rows
    at      indices into `states` of the usable rows in this part. They are one period of the cut-off apart, and
            independent
    """

    states: States
    at: NDArray[np.intp]


def stretches(
    log: AnyLog, options: FilterOptions, check: CheckOptions | None = None, rows: int = STRETCH_ROWS
) -> Iterator[Stretch]:
    """Filter a long log in parts of `rows` rows, and yield the states of each part.

    The states equal those of the whole log filtered at once. Neighbouring parts overlap by twice the number of rows
    that affect a filtered row: once for the states, once for quantities computed from the states.
    """
    grid = even_grid(log)
    low_pass = LowPass.design(options, grid.period)
    found = noticed(grid, low_pass, options, check, rows)
    reach = 2 * low_pass.memory
    every = independent_rows(grid, options)
    for start in range(0, grid.count, rows):
        wanted = every[(every >= start) & (every < start + rows)]
        if len(wanted):
            first, last = max(start - reach, 0), min(start + rows + reach, grid.count)
            yield Stretch(_states(grid, low_pass, found, options, first, last), wanted - first)


def _states(
    grid: EvenGrid, low_pass: LowPass, found: Noticed, options: FilterOptions, first: int, last: int
) -> States:
    """Rows first to last of the even grid."""
    position, effort = grid.rows(first, last)
    q = np.where(found.still, found.rest, low_pass(position))
    qd, qdd = central_differences(q, grid.period)
    usable = _usable(grid, options)
    use = np.zeros(last - first, dtype=bool)
    use[max(usable.start - first, 0) : max(usable.stop - first, 0)] = True
    return States(
        time=grid.time(first, last),
        period=grid.period,
        q=q,
        qd=qd,
        qdd=qdd,
        effort=low_pass(effort),
        use=use,
        low_pass=low_pass,
        cutoff=options.cutoff,
        noise=found.noise,
        still=found.still,
        motion=found.motion,
        first=first,
        raw=effort,
    )


def _usable(grid: EvenGrid, options: FilterOptions) -> range:
    """The rows that are left after the filter's start; InputError where there are none."""
    margin = int(np.ceil(options.settle / options.cutoff / grid.period))
    if grid.count <= 2 * margin:
        raise InputError(
            f"{grid.log.name}: too short: {grid.log.duration:.3g} s leave nothing after the {options.cutoff:g} Hz"
            " filter settled",
            "record a longer run",
        )
    return range(margin, grid.count - margin)


def independent_rows(grid: EvenGrid, options: FilterOptions) -> NDArray[np.intp]:
    """Return the indices of the usable rows of a whole log that are one period of the filter's cut-off apart.

    Rows that are closer share their noise and are not independent.
    """
    usable = _usable(grid, options)
    return np.arange(usable.start, usable.stop, _independent(options, grid.period), dtype=np.intp)


def central_differences(q: Array, period: float) -> tuple[Array, Array]:
    """Return speed and acceleration of positions q at time steps T, by central differences without phase error.

    For row k, they are (q[k+1] - q[k-1]) / 2T and (q[k+1] - 2 q[k] + q[k-1]) / T^2.
    """
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    qd[1:-1] = (q[2:] - q[:-2]) / (2.0 * period)
    qdd[1:-1] = (q[2:] - 2.0 * q[1:-1] + q[:-2]) / period**2
    qd[0], qd[-1] = qd[1], qd[-2]
    return qd, qdd


def held_out(count: int, options: SplitOptions) -> NDArray[np.bool_]:
    """Return for each of `count` samples whether it is held out for validation."""
    if options.blocks == 0:
        return np.arange(count) >= round((1.0 - options.held_out) * count)
    block = np.arange(count) * options.blocks // max(count, 1)
    # block b is held out when the running share of held-out blocks falls behind the wanted one
    share = np.floor((np.arange(options.blocks) + 1) * options.held_out + 0.5)
    is_out = np.diff(share, prepend=np.floor(0.5)) > 0
    return np.asarray(is_out[block])


def held_out_of(log: AnyLog, count: int, options: SplitOptions) -> NDArray[np.bool_]:
    """Return for each sample of a log whether the sample is held out for validation.

    If the whole log is for validation, the result is True for all samples.
    """
    return np.ones(count, dtype=bool) if log.use == "validate" else held_out(count, options)


def thinned(states: States, options: FilterOptions) -> NDArray[np.intp]:
    """Return the indices of usable samples that are independent, 1/(2 f_c) apart for the cut-off f_c.

    Neighbouring filtered samples share their noise. If each counted as new information, standard deviations would be
    too small by the square root of the oversampling.
    """
    return np.flatnonzero(states.use)[:: _independent(options, states.period)]


def _independent(options: FilterOptions, period: float) -> int:
    """Rows from one sample to the next with independent noise."""
    return max(1, int(np.floor(0.5 / (options.cutoff * period))))


def away_from(turning: NDArray[np.bool_], options: FilterOptions, period: float) -> NDArray[np.bool_]:
    """Return for each sample whether the sample is at least two periods of the cut-off away from any reversal of
    motion.

    Near a reversal, the low-pass filter mixes friction torques of both directions.

    turning  (N,) True: the motion reverses at this sample
    """
    reach = int(np.ceil(2.0 / options.cutoff / period))
    before = np.concatenate([[0], np.cumsum(turning)])
    index = np.arange(len(turning))
    first, last = np.maximum(index - reach, 0), np.minimum(index + reach + 1, len(turning))
    return np.asarray(before[last] == before[first])


@dataclass(frozen=True, slots=True, eq=False)
class Noticed:
    """Noise and rest of n joints in a log.

    noise   (n,) standard deviation of an unfiltered position sample, rad or m; zero for a joint at rest
    still   (n,) True: the joint is at rest, that is, moves no more than noise
    rest    (n,) mean position of each joint, which replaces the position of a joint at rest
    motion  (n,) range of the position, peak to peak, rad or m
    """

    noise: Array
    still: NDArray[np.bool_]
    rest: Array
    motion: Array


def noticed(
    grid: EvenGrid,
    low_pass: LowPass,
    options: FilterOptions,
    check: CheckOptions | None = None,
    rows: int = STRETCH_ROWS,
) -> Noticed:
    """Determine sensor noise, range and rest of every joint in one pass over a log.

    A joint is at rest if the position changes no more than noise. For long logs, the noise comes from evenly spread
    rows.
    """
    smallest = (check or CheckOptions()).smallest_motion
    given = ("noticed", options, smallest, rows)
    return once(grid.log, given, lambda: _noticed(grid, low_pass, options, smallest, rows))


def _noticed(
    grid: EvenGrid, low_pass: LowPass, options: FilterOptions, smallest: float, rows: int
) -> Noticed:
    reach, every = low_pass.memory, -(-grid.count // NOISE_ROWS)
    raw, smooth = [], []
    n = len(grid.log.joint_names)
    total, bounds = np.zeros(n), np.array([[np.inf] * n, [-np.inf] * n, [np.inf] * n, [-np.inf] * n])
    for start in range(0, grid.count, rows):
        first, last = max(start - reach, 0), min(start + rows + reach, grid.count)
        position, _ = grid.rows(first, last)
        own = slice(start - first, min(start + rows, grid.count) - first)
        filtered_position = low_pass(position)[own]
        position = position[own]
        total += position.sum(axis=0)
        for k, values in ((0, position), (2, filtered_position)):
            bounds[k] = np.minimum(bounds[k], values.min(axis=0))
            bounds[k + 1] = np.maximum(bounds[k + 1], values.max(axis=0))
        # Copies: a view would keep the whole stretch in memory.
        raw.append(position[-start % every :: every].copy())
        smooth.append(filtered_position[-start % every :: every].copy())
    in_band = min(2.0 * options.cutoff * grid.period, 1.0)
    position = np.concatenate(raw)
    noise = position_noise(position, np.concatenate(smooth), in_band)
    motion = bounds[1] - bounds[0]
    still = resting(position, motion, bounds[3] - bounds[2], noise, in_band, smallest)
    return Noticed(np.where(still, 0.0, noise), still, total / grid.count, motion)


NOISE_ROWS = 200_000
"""Rows from which sensor noise is computed; in longer logs evenly spread ones."""


# Equal time steps


NEIGHBOURS = 4
"""Rows on either side that interpolation between rows uses; its slopes need one."""


@dataclass(frozen=True, slots=True, eq=False)
class EvenGrid:
    """A log at equal time steps, from the first row to the last, with times from zero.

    count  number of rows
    same   True: the rows of the log already have equal steps, and stay unchanged
    """

    log: AnyLog
    count: int
    same: bool

    @property
    def period(self) -> float:
        return self.log.duration / (self.count - 1)

    def time(self, first: int, last: int) -> Array:
        """Return the times of the rows `first` to before `last`, s."""
        time: Array = self.period * np.arange(first, last, dtype=np.float64)
        if last == self.count:
            time[-1] = self.log.duration
        return time

    def rows(self, first: int, last: int) -> tuple[Array, Array]:
        """Return position and effort of the rows `first` to before `last`, by interpolation between the log's rows."""
        if self.same:
            part = self.log.rows(first, last)
            return part.position, part.effort
        wanted, logged = self.time(first, last), self.log.time
        begin, end = np.searchsorted(logged, logged[0] + wanted[[0, -1]])
        part = self.log.rows(max(int(begin) - NEIGHBOURS, 0), int(end) + NEIGHBOURS)
        time = part.time - logged[0]
        return (
            np.asarray(interpolate.PchipInterpolator(time, part.position)(wanted)),
            np.asarray(interpolate.PchipInterpolator(time, part.effort)(wanted)),
        )


TIMES_AT_ONCE = 1_000_000
"""Times that are compared at once: a log of a day has 86 million."""
EVEN = 1e-6
"""Share of a period by which the times of an even log differ from equal steps."""


def even_grid(log: AnyLog) -> EvenGrid:
    """Return a log with equal time steps: those of the log if they are equal, else steps of its median period."""
    own = EvenGrid(log, len(log), True)
    for start in range(0, len(log), TIMES_AT_ONCE):
        time = log.time[start : start + TIMES_AT_ONCE] - log.time[0]
        if not np.abs(own.time(start, start + len(time)) - time).max() < EVEN * own.period:
            return EvenGrid(log, round(log.duration / log.period) + 1, False)
    return own
