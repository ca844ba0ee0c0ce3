"""Describes how the position q of each joint is determined: it is an entry of the robot's q, follows other joints, or
is constant. A mimic joint follows by q_joint = ratio q_leader + offset. A joint of a parallelogram may follow the sum
of several joints, each with its ratio. In q, quaternions, and pairs of cosine and sine, must have length one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.reproducible import times
from psdmc.robot.joints import JointType


@dataclass(frozen=True, slots=True)
class Coordinate:
    """Describes the position q of one joint as ratio * q[leader] + offset, plus a ratio times q of each further leader.

    leader   index of the joint that is followed; for a joint that is no mimic joint, the joint itself. None: the joint
             is locked at `offset`
    ratio    rate of the joint divided by that of the leader, in the joint's unit per the leader's unit
    offset   rad or m
    others   further leaders, each with its ratio
    """

    leader: int | None
    ratio: float = 1.0
    offset: float = 0.0
    others: tuple[tuple[int, float], ...] = ()

    def __post_init__(self) -> None:
        ratios = (self.ratio, *(ratio for _, ratio in self.others))
        if not all(map(math.isfinite, (*ratios, self.offset))):
            raise ValueError(f"a coordinate with ratios {ratios} and offset {self.offset}")

    def in_words(self, names: Sequence[str], of: str = "") -> str:
        """Return the position as a sum in words. `of` is written between each ratio and the name of a joint."""
        signs = {} if of else {1.0: "", -1.0: "-"}
        terms = [signs.get(ratio, f"{ratio:g} ") + of + names[leader] for leader, ratio in self.shares]
        terms += [f"{self.offset:g}"] if self.offset else []
        return " + ".join(terms).replace("+ -", "- ")

    @property
    def shares(self) -> tuple[tuple[int, float], ...]:
        """All leaders, each with its ratio; none if the joint is locked."""
        return () if self.leader is None else ((self.leader, self.ratio), *self.others)


def own_coordinates(n: int) -> tuple[Coordinate, ...]:
    """Return the coordinates of n joints if no joint is a mimic joint: each joint is its own leader."""
    return tuple(Coordinate(i) for i in range(n))


def leaders(coordinates: Sequence[Coordinate]) -> tuple[int, ...]:
    """Return the indices of the joints that are not mimic joints: q has their positions, in order."""
    return tuple(i for i, coordinate in enumerate(coordinates) if coordinate == Coordinate(i))


def checked_coordinates(coordinates: Sequence[Coordinate], n: int) -> tuple[Coordinate, ...]:
    """Return the coordinates of n joints after a check. Without coordinates, no joint is a mimic joint. Raises
    ValueError if a mimic joint follows another mimic joint."""
    if not coordinates:
        return own_coordinates(n)
    if len(coordinates) != n:
        raise ValueError(f"{len(coordinates)} coordinates for {n} joints")
    own = leaders(coordinates)
    for i, coordinate in enumerate(coordinates):
        for leader, _ in coordinate.shares:
            if leader not in own:
                raise ValueError(f"joint {i} follows joint {leader}, which has no coordinate of its own")
    return tuple(coordinates)


@dataclass(frozen=True, slots=True, eq=False)
class MimicMap:
    """Matrices that give the positions and rates of all joints, mimic joints included, from q and qd. They are q_joints
    = shares q + offsets and rates_joints = ratios qd.

    shares   (coordinates of all joints, nq)
    offsets  (coordinates of all joints,)
    ratios   (rates of all joints, nv)
    """

    shares: NDArray[np.float64]
    offsets: NDArray[np.float64]
    ratios: NDArray[np.float64]

    @staticmethod
    def of(coordinates: Sequence[Coordinate], types: Sequence[JointType]) -> MimicMap:
        offsets = [coordinate.offset for coordinate in coordinates]
        lengths = [kind.nq for kind in types]
        return MimicMap(
            _shares(coordinates, lengths),
            np.repeat(offsets, lengths),
            _shares(coordinates, [kind.nv for kind in types]),
        )

    def positions(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (..., n) of all n joints, mimic joints included, from the robot's q (..., nq)."""
        return np.asarray(times(q, self.shares.T) + self.offsets)

    def rates(self, qd: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rates (..., n) of all n joints, mimic joints included, from the robot's qd (..., nv)."""
        return np.asarray(times(qd, self.ratios.T))

    def summed(self, values: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
        """Return torques with one entry per rate of the robot, from torques of all joints. The torque of a mimic joint,
        times its ratio, is added to that of the joint that it follows.

        values  array of torques, with one axis for the rates of all joints, mimic joints included
        axis    number of this axis, which gets the length nv
        """
        return np.moveaxis(times(np.moveaxis(values, axis, -1), self.ratios), -1, axis)


def _shares(coordinates: Sequence[Coordinate], lengths: Sequence[int]) -> NDArray[np.float64]:
    """The matrix from what the leaders have, so many entries each, to what all joints have."""
    own = leaders(coordinates)
    first = dict(zip(own, np.cumsum([0, *(lengths[i] for i in own)]), strict=False))
    rows = []
    for coordinate, length in zip(coordinates, lengths, strict=True):
        row = np.zeros((length, sum(lengths[i] for i in own)))
        for leader, ratio in coordinate.shares:
            start = first[leader]
            row[:, start : start + length] = ratio * np.eye(length)
        rows.append(row)
    return np.concatenate(rows)


SLACK = 1e-6
"""Accepted deviation of a length from one: torques are then off by as much, and a quaternion in float32 by 1e-7."""


def units_of(types: Iterable[JointType]) -> tuple[tuple[int, int], ...]:
    """Return the slices (start, stop) of q that are quaternions or pairs of cosine and sine, whose length must be one.
    `types` are the types of the robot's joints, in order."""
    found, start = [], 0
    for kind in types:
        if kind.unit.stop:
            found.append((start + kind.unit.start, start + kind.unit.stop))
        start += kind.nq
    return tuple(found)


def refuse_other_lengths(what: str, q: NDArray[Any], units: Sequence[tuple[int, int]]) -> None:
    """Raise InputError for the first row of q (..., nq) in which a quaternion, or a pair of cosine and sine, has not
    length one.

    units  slices (start, stop) of q that must have length one
    """
    rows = np.reshape(q, (-1, q.shape[-1]))
    for start, stop in units:
        lengths = np.linalg.norm(rows[:, start:stop].astype(np.float64), axis=1)
        wrong = np.flatnonzero(~(np.abs(lengths - 1.0) <= SLACK))
        if wrong.size:
            row = int(wrong[0])
            places = [int(k) for k in np.unravel_index(row, q.shape[:-1])]
            place = str(places[0]) if len(places) == 1 else f"({', '.join(map(str, places))})"
            where = f" of row {place}" if q.ndim > 1 else ""
            raise InputError(
                f"{what}[{start}:{stop}]{where} has length {lengths[row]:.9g}, expected one",
                "divide it by its length, or let integrate do it: integrate(q, 0 * v)",
            )
