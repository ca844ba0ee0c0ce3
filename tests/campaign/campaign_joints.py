"""States of every joint of an oracle's model from states of a robot's coordinates, and efforts back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from campaign_robots import RandomRobot

Array = np.ndarray

ROOT_Q, ROOT_RATES = 7, 6
"""Coordinates (position, quaternion xyzw) and rates (linear, angular, along the root's own axes) of a floating base: first
in every vector."""


@dataclass(frozen=True, slots=True)
class Joints:
    """q_joint = ratios q + offsets for joints of one coordinate; a floating base comes before them.

    names        (joints) as the oracle has them
    coordinates  (coordinates) names of joints that neither follow another nor are held, in the order of `names`
    ratios       (joints, coordinates)
    offsets      (joints,)
    """

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    ratios: Array
    offsets: Array
    is_floating: bool

    @staticmethod
    def of(names: Sequence[str], robot: RandomRobot | None = None) -> Joints:
        """By the robot's own mimic joints and held ones; without a robot every joint is a coordinate."""
        if robot is None:
            return Joints(tuple(names), tuple(names), np.eye(len(names)), np.zeros(len(names)), False)
        followed = [robot.coordinate_of(name) for name in names]
        own = [name for name in names if name not in robot.mimics and name not in robot.held]
        ratios = np.array([[one.ratio * (one.leader == name) for name in own] for one in followed])
        offsets = np.array([one.offset for one in followed])
        return Joints(tuple(names), tuple(own), ratios, offsets, robot.is_floating)

    @property
    def root(self) -> tuple[int, int]:
        """How many coordinates and rates the floating base has."""
        return (ROOT_Q, ROOT_RATES) if self.is_floating else (0, 0)

    @property
    def nv(self) -> int:
        return self.root[1] + len(self.coordinates)

    def in_order_of(self, coordinates: Sequence[str]) -> Joints:
        """The same for vectors in another order."""
        order = [self.coordinates.index(name) for name in coordinates]
        return Joints(self.names, tuple(coordinates), self.ratios[:, order], self.offsets, self.is_floating)

    def positions(self, q: Array) -> Array:
        first = self.root[0]
        return np.hstack([q[:, :first], q[:, first:] @ self.ratios.T + self.offsets])

    def rates(self, qd: Array) -> Array:
        first = self.root[1]
        return np.hstack([qd[:, :first], qd[:, first:] @ self.ratios.T])

    def summed(self, efforts: Array) -> Array:
        """(..., nv) from (..., all rates): those of mimic joints times their ratios."""
        first = self.root[1]
        return np.concatenate([efforts[..., :first], efforts[..., first:] @ self.ratios], axis=-1)

    def summed_matrix(self, matrix: Array) -> Array:
        return self.summed(self.summed(matrix).swapaxes(-1, -2)).swapaxes(-1, -2)
