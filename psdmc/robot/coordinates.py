"""Coordinates of joints. The position q of a joint is a coordinate of its own, follows another joint (a mimic joint,
q_joint = ratio q_leader + offset), or is constant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.reproducible import times
from psdmc.robot.joints import JointType


@dataclass(frozen=True, slots=True)
class Coordinate:
    """Describes the position q of one joint as ratio * q[leader] + offset.

    leader   index of the joint that has the coordinate; None: the joint is locked at `offset`
    ratio    ratio of the two rates, in the joint's unit per the leader's unit
    offset   rad or m
    """

    leader: int | None
    ratio: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.ratio) and math.isfinite(self.offset)):
            raise ValueError(f"a coordinate with ratio {self.ratio} and offset {self.offset}")


def own_coordinates(n: int) -> tuple[Coordinate, ...]:
    """Return the coordinates of n joints of which none is a mimic joint."""
    return tuple(Coordinate(i) for i in range(n))


def leaders(coordinates: Sequence[Coordinate]) -> tuple[int, ...]:
    """Return the indices of the joints that are not mimic joints, in order. Each of them has entries in q."""
    return tuple(i for i, coordinate in enumerate(coordinates) if coordinate == Coordinate(i))


def checked_coordinates(coordinates: Sequence[Coordinate], n: int) -> tuple[Coordinate, ...]:
    """Return the coordinates of n joints. If none are given, each joint has its own. Raises ValueError if a mimic
    joint follows another mimic joint."""
    if not coordinates:
        return own_coordinates(n)
    if len(coordinates) != n:
        raise ValueError(f"{len(coordinates)} coordinates for {n} joints")
    own = leaders(coordinates)
    for i, coordinate in enumerate(coordinates):
        if coordinate.leader is not None and coordinate.leader not in own:
            raise ValueError(
                f"joint {i} follows joint {coordinate.leader}, which has no coordinate of its own"
            )
    return tuple(coordinates)


@dataclass(frozen=True, slots=True, eq=False)
class Following:
    """Matrices that give the positions and rates of all joints, mimic joints included, from q and qd: q_joints =
    shares q + offsets, rates_joints = ratios qd.

    shares   (coordinates of all joints, nq)
    offsets  (coordinates of all joints,)
    ratios   (rates of all joints, nv)
    """

    shares: NDArray[np.float64]
    offsets: NDArray[np.float64]
    ratios: NDArray[np.float64]

    @staticmethod
    def of(coordinates: Sequence[Coordinate], types: Sequence[JointType]) -> Following:
        offsets = [coordinate.offset for coordinate in coordinates]
        lengths = [kind.nq for kind in types]
        return Following(
            _shares(coordinates, lengths),
            np.repeat(offsets, lengths),
            _shares(coordinates, [kind.nv for kind in types]),
        )

    def positions(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the positions (..., n) of all joints, mimic joints included, from q (..., nq)."""
        return np.asarray(times(q, self.shares.T) + self.offsets)

    def rates(self, qd: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rates (..., n) of all joints, mimic joints included, from qd (..., nv)."""
        return np.asarray(times(qd, self.ratios.T))

    def summed(self, values: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
        """Add the torques of mimic joints, times their ratios, to those of the joints that they follow.

        values  array with an axis of all joints, which becomes an axis of length nv
        axis    that axis
        """
        return np.moveaxis(times(np.moveaxis(values, axis, -1), self.ratios), -1, axis)


def _shares(coordinates: Sequence[Coordinate], lengths: Sequence[int]) -> NDArray[np.float64]:
    """The matrix from what the leaders have, so many entries each, to what all joints have."""
    own = leaders(coordinates)
    first = dict(zip(own, np.cumsum([0, *(lengths[i] for i in own)]), strict=False))
    rows = []
    for coordinate, length in zip(coordinates, lengths, strict=True):
        row = np.zeros((length, sum(lengths[i] for i in own)))
        if coordinate.leader is not None:
            start = first[coordinate.leader]
            row[:, start : start + length] = coordinate.ratio * np.eye(length)
        rows.append(row)
    return np.concatenate(rows)
