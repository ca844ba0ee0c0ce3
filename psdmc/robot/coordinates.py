"""Coordinates of joints: each joint's q is a coordinate of its own, follows another's (q_joint = ratio q_leader +
offset), or is constant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One joint's q as ratio * q[leader] + offset.

    leader   number of the joint that has the coordinate; None: the joint is held at `offset`
    ratio    of the two rates, in the joint's unit per the leader's
    offset   rad or m
    """

    leader: int | None
    ratio: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.ratio) and math.isfinite(self.offset)):
            raise ValueError(f"a coordinate with ratio {self.ratio} and offset {self.offset}")


def own_coordinates(n: int) -> tuple[Coordinate, ...]:
    """The coordinates of n joints that follow no other."""
    return tuple(Coordinate(i) for i in range(n))


def leaders(coordinates: Sequence[Coordinate]) -> tuple[int, ...]:
    """The joints that have a coordinate of their own, in order: q has one entry for each."""
    return tuple(i for i, coordinate in enumerate(coordinates) if coordinate == Coordinate(i))


def checked_coordinates(coordinates: Sequence[Coordinate], n: int) -> tuple[Coordinate, ...]:
    """The coordinates, each joint's own where none are given; ValueError where a joint follows one that follows
    another."""
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
    """How all joints move with the coordinates, of robots whose joints have one each: q_joints = ratios q + offsets.

    ratios   (n, nv)
    offsets  (n,)
    """

    ratios: NDArray[np.float64]
    offsets: NDArray[np.float64]

    @staticmethod
    def of(coordinates: Sequence[Coordinate]) -> Following:
        own = leaders(coordinates)
        ratios, offsets = np.zeros((len(coordinates), len(own))), np.zeros(len(coordinates))
        for i, coordinate in enumerate(coordinates):
            if coordinate.leader is not None:
                ratios[i, own.index(coordinate.leader)] = coordinate.ratio
            offsets[i] = coordinate.offset
        return Following(ratios, offsets)

    def positions(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., n) from (..., nv)."""
        return np.asarray(q @ self.ratios.T + self.offsets)

    def rates(self, qd: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., n) from (..., nv)."""
        return np.asarray(qd @ self.ratios.T)

    def summed(self, values: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
        """Torques of the joints, or whatever has an axis of them, summed onto the coordinates."""
        return np.moveaxis(np.moveaxis(values, axis, -1) @ self.ratios, -1, axis)
