"""Draws states within the limits of a robot, from random numbers between 0 and 1."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from psdmc.errors import InputError
from psdmc.program.signature import QD, QDD, TAU, Q, Quantity
from psdmc.robot.limits import listed, shown
from psdmc.robot.mechanism import Limits, Mechanism
from psdmc.robot.unit_lengths import units_of

Array = NDArray[Any]

LIMITS: Mapping[str, tuple[str, str]] = {
    Q.name: ("position", "rad or m"),
    QD.name: ("speed", "rad/s or m/s"),
    QDD.name: ("acceleration", "rad/s^2 or m/s^2"),
    TAU.name: ("effort", "N m or N"),
}
"""Quantities that are drawn, in this order: the option that gives limits that the robot's file lacks, and their units."""

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
