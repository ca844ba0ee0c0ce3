"""Draws states from random numbers between 0 and 1: within the limits of a robot, or along a motion, with noise if
the user wants it."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly
from scipy.special import ndtri

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.signature import QD, QDD, TAU, Q, Quantity
from psdmc.robot.coordinates import units_of
from psdmc.robot.limits import listed, shown
from psdmc.robot.mechanism import Limits, Mechanism

Array = NDArray[Any]

LIMITS: Mapping[str, tuple[str, str]] = {
    Q.name: ("position", "rad or m"),
    QD.name: ("speed", "rad/s or m/s"),
    QDD.name: ("acceleration", "rad/s^2 or m/s^2"),
    TAU.name: ("effort", "N m or N"),
}
"""Quantities that are drawn, in this order: the option that gives limits that the robot's file lacks, and their units."""

TIME = "time"
"""Name of the column of times, s."""

LEAST_ROWS = 4
"""Rows of a motion. A cubic spline through fewer points is a single polynomial."""

LEAST = 2.0**-53
"""Nearest to 0 and 1 that a share is taken where it becomes a normal deviate, which is infinite there."""


def normal(shares: Array) -> Array:
    """Return normal deviates of mean 0 and variance 1, from numbers that are uniform between 0 and 1."""
    found: Array = ndtri(np.clip(shares, LEAST, 1.0 - LEAST))
    return found


@dataclass(frozen=True, eq=False)
class WithinLimits:
    """Draws quantities independently of each other, uniform within their limits.

    ranges  lower and upper bounds by name of the quantity
    """

    robot: Mechanism
    ranges: Mapping[str, tuple[Array, Array]]

    @classmethod
    def of(cls, robot: Mechanism, reads: Sequence[Quantity], given: Mapping[str, float]) -> WithinLimits:
        """Return what draws these quantities of a robot. Raises InputError if a joint has no limits, or none of
        its values is within a range.

        given  ranges, plus and minus, beside the limits in the robot file: word of LIMITS -> range
        """
        found, lacking = {}, {}
        for quantity in reads:
            word, _ = LIMITS[quantity.name]
            bounds, without = _bounds(robot, quantity.name, given.get(word))
            found[quantity.name] = bounds[:, 0], bounds[:, 1]
            if without:
                lacking[word] = without
        if lacking:
            faults = "; ".join(f"{word}: {listed(names, 4)}" for word, names in lacking.items())
            units = dict(LIMITS.values())
            options = " and ".join(f"--{word} NUMBER ({units[word]})" for word in lacking)
            raise InputError(f"{robot.name}: joints without limits of {faults}", f"add {options}")
        return cls(robot, found)

    @property
    def size(self) -> int:
        """Return how many random numbers a state takes."""
        return sum(len(low) for low, _ in self.ranges.values())

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shapes of columns that the states have besides the inputs of the functions."""
        return {}

    @property
    def described(self) -> dict[str, Any]:
        """Return what determines the states, for the manifest."""
        return {"ranges": {name: [side.tolist() for side in sides] for name, sides in self.ranges.items()}}

    def drawn(self, shares: Array) -> dict[str, Array]:
        """Return states from numbers between 0 and 1, (states, size)."""
        found = {}
        for name, (lower, upper) in self.ranges.items():
            own, shares = shares[:, : len(lower)], shares[:, len(lower) :]
            values = lower + (upper - lower) * own
            for start, stop in (
                units_of(self.robot.joints[i].type for i in self.robot.own_joints) if name == Q.name else ()
            ):
                entries = normal(own[:, start:stop])
                values[:, start:stop] = entries / np.sqrt(sum(x * x for x in entries.T))[:, None]
            found[name] = values
        return found


def _bounds(robot: Mechanism, quantity: str, given: float | None) -> tuple[Array, list[str]]:
    """(size, 2) the range of each entry, and the names of joints that have none. Entries of quaternions need none."""
    bounds: list[tuple[float, float]] = []
    lacking = []
    for joint in (robot.joints[i] for i in robot.own_joints):
        low, high = _limits(joint.limits, quantity)
        if given is not None:
            if low > given or high < -given:
                word = LIMITS[quantity][0]
                raise InputError(
                    f"{robot.name}: joint {shown(joint.name)}: no {word} within its limits is from {-given:g} to {given:g}",
                    f"give a larger number for --{word}",
                )
            low, high = max(low, -given), min(high, given)
        size = joint.type.nq if quantity == Q.name else joint.type.nv
        own = [(low, high)] * size
        if quantity == Q.name:
            own[joint.type.unit] = [(0.0, 0.0)] * len(own[joint.type.unit])
        if not all(math.isfinite(bound) for pair in own for bound in pair) or low > high:
            lacking.append(joint.name)
        bounds += own
    return np.array(bounds).reshape(-1, 2), lacking


def _limits(limits: Limits, quantity: str) -> tuple[float, float]:
    if quantity == Q.name:
        return limits.lower, limits.upper
    largest = {QD.name: limits.speed, QDD.name: limits.acceleration, TAU.name: limits.effort}[quantity]
    return -largest, largest


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion of n joints, of which N rows are given at growing times.

    name    name for messages
    joints  names of the n joints, in the order of the columns
    time    (N,) s
    q       (N, n) rad; m for sliding joints
    qd      (N, n) rad/s (m/s); None: the derivative of a spline through q
    qdd     (N, n) rad/s^2 (m/s^2); None: the derivative of the rates
    """

    name: str
    joints: tuple[str, ...]
    time: Array
    q: Array
    qd: Array | None = None
    qdd: Array | None = None

    def __post_init__(self) -> None:
        if len(self.time) < LEAST_ROWS:
            raise InputError(
                f"{self.name}: {len(self.time)} rows, expected {LEAST_ROWS} or more", "give a longer motion"
            )
        for what in ("time", "q", "qd", "qdd"):
            values = getattr(self, what)
            odd = np.argwhere(~np.isfinite(() if values is None else values))
            if len(odd):
                raise InputError(
                    f"{self.name}: {what}, row {odd[0][0] + 1}: no finite number", "correct the row"
                )
        back = np.flatnonzero(~(np.diff(self.time) > 0.0))
        if len(back):
            raise InputError(
                f"{self.name}: row {back[0] + 2}: the time does not grow", "sort the rows, each time once"
            )

    def ordered(self, names: Sequence[str]) -> Motion:
        """Return the motion of these joints, in this order. Raises InputError with joints that the motion lacks."""
        missing = [name for name in names if name not in self.joints]
        if missing:
            raise InputError(
                f"{self.name}: no positions of joint(s) {', '.join(missing)}", "give a motion of all joints"
            )
        at = [self.joints.index(name) for name in names]
        columns = (None if values is None else values[:, at] for values in (self.q, self.qd, self.qdd))
        return Motion(self.name, tuple(names), self.time, *columns)  # type: ignore[arg-type]

    @property
    def spline(self) -> PPoly:
        """Return q as piecewise polynomials of the time. Their derivatives are those given at the rows: degree 5 if rates
        and accelerations are given, else 3."""
        if self.qd is None:
            return CubicSpline(self.time, self.q)
        if self.qdd is None:
            return CubicHermiteSpline(self.time, self.q, self.qd)
        h, q, v, a = np.diff(self.time)[:, None], self.q, self.qd, self.qdd
        rise = q[1:] - q[:-1]
        fifth = 12.0 * rise - 6.0 * (v[1:] + v[:-1]) * h + (a[1:] - a[:-1]) * h**2
        fourth = -30.0 * rise + (14.0 * v[1:] + 16.0 * v[:-1]) * h + (3.0 * a[:-1] - 2.0 * a[1:]) * h**2
        third = 20.0 * rise - (8.0 * v[1:] + 12.0 * v[:-1]) * h - (3.0 * a[:-1] - a[1:]) * h**2
        powers = (fifth / h**5, fourth / h**4, third / h**3, a[:-1], 2.0 * v[:-1], 2.0 * q[:-1])
        return PPoly(0.5 * np.array(powers), self.time)

    @property
    def digest(self) -> str:
        """Return the hash of all numbers, which determines the states."""
        found = hashlib.sha256()
        for values in (self.time, self.q, self.qd, self.qdd):
            found.update(b"none" if values is None else np.ascontiguousarray(values, "<f8").tobytes())
        return found.hexdigest()


@dataclass(frozen=True, eq=False)
class AlongMotion:
    """Draws states at random times of a motion.

    motion  with columns in the order of q
    reads   quantities of the states: q, qd, qdd
    noise   standard deviation of normal noise on each value, as a share of the value's standard deviation in the motion
    """

    motion: Motion
    reads: tuple[Quantity, ...]
    noise: float

    @classmethod
    def of(cls, model: DynamicsModel, reads: Sequence[Quantity], motion: Motion, noise: float) -> AlongMotion:
        """Return what draws these quantities of a robot. Raises InputError if the motion does not give them."""
        strange = [each.name for each in reads if each.name not in (Q.name, QD.name, QDD.name)]
        if strange:
            raise InputError(
                f"{motion.name}: a motion does not give {strange[0]}, which a function reads",
                "sample functions of q, qd and qdd along a motion",
            )
        if model.nq != model.n:
            raise InputError(
                f"{model.mechanism.name}: joints with several coordinates have no position in a motion's file",
                "leave out --along",
            )
        return cls(motion.ordered(model.joint_names), tuple(reads), noise)

    @property
    def size(self) -> int:
        """Return how many random numbers a state takes: one for the time, and one for the noise on each value."""
        return 1 + bool(self.noise) * len(self.reads) * len(self.motion.joints)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shapes of columns that the states have besides the inputs of the functions."""
        return {TIME: ()}

    @property
    def described(self) -> dict[str, Any]:
        """Return what determines the states, for the manifest."""
        rows = len(self.motion.time)
        return {"along": {"numbers": self.motion.digest, "rows": rows, "noise": self.noise}}

    @cached_property
    def _splines(self) -> tuple[PPoly, ...]:
        order = {Q.name: 0, QD.name: 1, QDD.name: 2}
        spline = self.motion.spline
        return tuple(
            spline.derivative(order[each.name]) if order[each.name] else spline for each in self.reads
        )

    @cached_property
    def _deviations(self) -> tuple[Array, ...]:
        return tuple(spline(self.motion.time).std(axis=0) for spline in self._splines)

    def drawn(self, shares: Array) -> dict[str, Array]:
        """Return states from numbers between 0 and 1, (states, size), with their times."""
        first, last = self.motion.time[[0, -1]]
        at, shares = first + (last - first) * shares[:, 0], shares[:, 1:]
        found = {TIME: at}
        for quantity, spline, deviation in zip(self.reads, self._splines, self._deviations, strict=True):
            values = spline(at)
            if self.noise:
                own, shares = shares[:, : len(deviation)], shares[:, len(deviation) :]
                values = values + self.noise * deviation * normal(own)
            found[quantity.name] = values
        return found
