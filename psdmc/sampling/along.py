"""Draws states along a given motion: at random times, with random noise if the user wants it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.signature import QD, QDD, Q, Quantity
from psdmc.sampling.limits import normal

Array = NDArray[Any]

TIME = "time"
"""Name of the column of times, s."""

LEAST_ROWS = 4
"""Rows of a motion. A cubic spline through fewer points is a single polynomial."""


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
