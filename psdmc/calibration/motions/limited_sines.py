"""Describes sums of sines by unbounded coordinates, so that every motion keeps the joints' limits.

The sines of each joint are divided by the share of its tightest limit that they need, and so keep that limit. This
share is the largest value of a curve, which is not a smooth function of the coordinates. A norm that is never smaller
than the largest value therefore takes its place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.trajectory import Trajectory, smooth_step
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

NORM = 40
"""Exponent of the norm that bounds a curve's largest value from above, by 2 to 8 % for sums of a few sines: motions use
that much less of their limits. Larger exponents make corners of the smooth search space."""
FULL = 4.0
"""Coordinate of a random motion's share of its limits: 1 / (1 + exp(-4)) = 98 %."""
TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A motion for given coordinates (see LimitedSines), with the data for its derivatives; n joints, N samples.

    states  (3, n, N) position, speed and acceleration
    raw     (3, n, N) the sines before scaling
    norm    (n,) share of each joint's tightest limit that the sines before scaling need
    reach   (n,) share of the position limit that they need
    fill    (n,) share of the limits that the motion uses
    place   (n,) centre of the motion within the range of positions that remains, -1 to 1
    """

    states: Array
    raw: Array
    norm: Array
    reach: Array
    fill: Array
    place: Array


class LimitedSines:
    """The coordinates that describe a motion. For each joint, these are the weights of sines and cosines, the used share of
    its limits, and the position of its centre."""

    def __init__(self, chain: Mechanism, options: ExciteOptions) -> None:
        limits = [joint.limits for joint in chain.joints]
        bounds = np.array([(x.lower, x.upper, x.speed, x.acceleration) for x in limits])
        self.options = options
        self.n, self.h = len(chain), len(options.harmonics)
        self.size = self.n * (2 * self.h + 2)
        top = max(options.harmonics)
        self.samples = max(options.samples, 16 * top)
        # between samples a trigonometric polynomial of degree m exceeds its largest sample by at most this factor
        # (Ehlich and Zeller 1964), so that the limits hold at every time, not only on the grid
        usable = options.margin * float(np.cos(np.pi * top / self.samples))
        self.middle = 0.5 * (bounds[:, 0] + bounds[:, 1])
        self.half = 0.5 * (bounds[:, 1] - bounds[:, 0]) * usable
        self.limits = np.maximum(np.stack([self.half, bounds[:, 2] * usable, bounds[:, 3] * usable]), TINY)
        even = np.arange(self.samples) * options.duration / self.samples
        # with equal weights the fastest sine would use up the limits
        self.weight = np.tile(1.0 / np.array(options.harmonics), 2)[:, None]
        parts = sine_basis(options.harmonics, options.duration, even)
        self.basis = np.stack([np.vstack(part) * self.weight for part in parts])

    def drawn(self, count: int, rng: np.random.Generator) -> Array:
        """Return random coordinates (count, size) of `count` motions that use nearly the full limits of every joint."""
        found = rng.standard_normal((count, self.size))
        found.reshape(count, self.n, -1)[..., -2] = FULL
        return found

    def filled(self, point: Array, share: float) -> Array:
        """Return a motion's coordinates with the used share of every joint's limits at most `share`."""
        found = point.copy().reshape(self.n, -1)
        found[:, -2] = np.minimum(found[:, -2], np.log(share / (1.0 - share)))
        return found.ravel()

    def placed(self, point: Array) -> Placed:
        shaped = point.reshape(self.n, -1)
        raw = np.einsum("nk,pkt->pnt", shaped[:, :-2], self.basis)
        shares = np.abs(raw) / self.limits[:, :, None]
        norm, reach = _norm(shares, (0, 2)), _norm(shares[0], (1,))
        fill, place = 0.5 * (1.0 + np.tanh(0.5 * shaped[:, -2])), np.tanh(shaped[:, -1])
        states = raw * (fill / norm)[:, None]
        states[0] += self._centre(fill, place, norm, reach)[:, None]
        return Placed(states, raw, norm, reach, fill, place)

    def _centre(self, fill: Array, place: Array, norm: Array, reach: Array) -> Array:
        return np.asarray(self.middle + place * self.half * (1.0 - fill * reach / norm))

    def motion(self, point: Array) -> SineSum:
        at, shaped = self.placed(point), point.reshape(self.n, -1)
        weights = shaped[:, :-2] * self.weight[:, 0] * (at.fill / at.norm)[:, None]
        centre = self._centre(at.fill, at.place, at.norm, at.reach)
        options = self.options
        return SineSum(
            options.duration, options.harmonics, centre, weights[:, : self.h], weights[:, self.h :]
        )

    def slope(self, at: Placed, by_states: Array) -> Array:
        """Return the gradient (size,) of a scalar by the `size` numbers that describe a motion, such as the weights of
        its sines. The chain rule gives it from the derivatives by positions, speeds and accelerations.

        at         the motion, as `placed` returns it
        by_states  (3, n, N) derivatives of the scalar by q, qd and qdd of n joints at N samples of the motion
        """
        by_centre = by_states[0].sum(axis=1)
        by_scale = np.einsum("pnt,pnt->n", by_states, at.raw) - by_centre * at.place * self.half * at.reach
        by_norm = -by_scale * at.fill / at.norm**2
        by_reach = -by_centre * at.place * self.half * at.fill / at.norm
        shares = at.raw / self.limits[:, :, None]
        by_raw = by_states * (at.fill / at.norm)[:, None]
        by_raw += by_norm[:, None] * _norm_slope(shares, at.norm) / self.limits[:, :, None]
        by_raw[0] += by_reach[:, None] * _norm_slope(shares[0], at.reach) / self.limits[0][:, None]
        found = np.empty((self.n, 2 * self.h + 2))
        found[:, :-2] = np.einsum("pnt,pkt->nk", by_raw, self.basis)
        found[:, -2] = by_scale * at.fill * (1.0 - at.fill) / at.norm
        found[:, -1] = by_centre * self.half * (1.0 - at.fill * at.reach / at.norm) * (1.0 - at.place**2)
        return found.ravel()


def _norm(shares: Array, axes: tuple[int, ...]) -> Array:
    """(n,) norms of the entries' sizes along the axes, scaled first so that no power overflows."""
    largest = np.maximum(shares.max(axis=axes), TINY)
    spread = np.expand_dims(largest, axes) if axes == (1,) else largest[:, None]
    return np.asarray(largest * ((shares / spread) ** NORM).sum(axis=axes) ** (1.0 / NORM))


def _norm_slope(shares: Array, norm: Array) -> Array:
    """Derivatives of the norm by the entries."""
    return np.asarray(np.sign(shares) * (np.abs(shares) / norm[:, None]) ** (NORM - 1))


@dataclass(frozen=True, slots=True, eq=False)
class SineSum:
    """A periodic motion, a sum of sines and cosines for each joint.

    q_i(t) = centre_i + sum over k of a_ik sin(w_k t) + b_ik cos(w_k t), w_k = 2 pi harmonic_k / duration

    centre (n,), sine (n, h), cosine (n, h): rad (m). As amplitude and phase: A sin(w t + phi), A = hypot(a, b).
    """

    duration: float
    harmonics: tuple[int, ...]
    centre: Array
    sine: Array
    cosine: Array

    @property
    def amplitude(self) -> Array:
        return np.hypot(self.sine, self.cosine)

    @property
    def phase(self) -> Array:
        return np.arctan2(self.cosine, self.sine)

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return position, speed and acceleration, (N, n) each, at any times (N,)."""
        basis = sine_basis(self.harmonics, self.duration, time)
        q, qd, qdd = (self.sine @ s + self.cosine @ c for s, c in basis)
        return q.T + self.centre, qd.T, qdd.T

    def sampled(self, joint_names: tuple[str, ...], period: float) -> Trajectory:
        """Return one period of the motion at equal time steps."""
        count = round(self.duration / period) + 1
        time: Array = np.arange(count, dtype=np.float64) * period
        return Trajectory(joint_names, time, *self.at(time))

    def shrunk(self, share: float) -> SineSum:
        """Return the motion with all amplitudes multiplied by `share`, about the same centre."""
        return replace(self, sine=share * self.sine, cosine=share * self.cosine)


def sine_basis(harmonics: tuple[int, ...], duration: float, time: Array) -> list[tuple[Array, Array]]:
    """Return the sines and cosines (h, N each) of h harmonics at N times, and their first and second derivatives.

    The result has three pairs: for position, speed and acceleration.
    """
    w = 2.0 * np.pi * np.array(harmonics)[:, None] / duration
    s, c = np.sin(w * time), np.cos(w * time)
    return [(s, c), (w * c, -w * s), (-(w**2) * s, -(w**2) * c)]


RAMPS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, *(12.0 * 2.0**k for k in range(7)))
"""s, tried in this order until the limits are kept: up to 13 minutes, for a motion that leaves 1 % of an acceleration
that is a hundredth of its speed."""


def from_rest_to_rest(
    motion: SineSum,
    chain: Mechanism,
    period: float,
    repeats: int,
    faults: Callable[[Trajectory], list[str]],
) -> Trajectory:
    """Return `repeats` periods of the motion with a ramp before and after them, in rows that are `period` (s) apart.

    faults  function that returns a sentence for each limit that a motion violates

    Raises InputError if no ramp keeps the limits.
    """
    found: list[str] = []
    for ramp in RAMPS:
        whole = ramped(motion, chain.joint_names, period, repeats, ramp)
        found = faults(whole)
        if not found:
            return whole
    raise InputError(
        f"the exciting motion cannot begin at rest within the limits: {'; '.join(found)}",
        "leave more of the limits: a smaller --margin or --torque-margin",
    )


def ramped(
    motion: SineSum, joint_names: tuple[str, ...], period: float, repeats: int, ramp: float
) -> Trajectory:
    """Return `repeats` periods of a motion with a ramp from rest before them, and a ramp to rest after them.

    period  s between rows
    ramp    s, duration of each ramp, rounded to a whole number of rows
    """
    rows = max(round(ramp / period), 1)
    middle: Array = np.arange(round(repeats * motion.duration / period) + 1, dtype=np.float64) * period
    length = rows * period
    x: Array = np.arange(rows, dtype=np.float64) / rows
    gone, rate, bend, _ = smooth_step(x)
    way = gone * length - 0.5 * length
    end = middle[-1]
    path = np.concatenate([way, middle, end - way[::-1]])
    pace = np.concatenate([rate, np.ones(len(middle)), rate[::-1]])[:, None]
    change = np.concatenate([bend, np.zeros(len(middle)), -bend[::-1]])[:, None] / length
    q, qd, qdd = motion.at(path)
    time: Array = np.arange(len(path), dtype=np.float64) * period
    return Trajectory(joint_names, time, q, qd * pace, qdd * pace**2 + qd * change)
