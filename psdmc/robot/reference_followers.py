"""Pinocchio's own reading of robots with mimic joints: every joint free, and the coordinates' dynamics by NumPy.

Pinocchio's own mimic joints are left alone: half of its algorithms refuse them, and a leader must come before its followers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.robot.coordinates import Following
from psdmc.robot.mechanism import Array, Mechanism
from psdmc.robot.reference import Reference


@dataclass(frozen=True, slots=True, eq=False)
class OnCoordinates:
    """A Reference's dynamics in the coordinates q, qd, qdd, tau (..., nv) of a robot whose joints may follow others."""

    free: Reference
    following: Following

    @staticmethod
    def of(reference: Reference, robot: Mechanism) -> OnCoordinates:
        return OnCoordinates(reference, Following.of(robot.coordinates, robot.types))

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array) -> Array:
        return self.following.summed(self.free.inverse_dynamics(*self.on_joints(q, qd, qdd)))

    def on_joints(self, q: Array, *rates: Array) -> tuple[Array, ...]:
        """(..., n) of every joint."""
        return self.following.positions(q), *map(self.following.rates, rates)

    @property
    def follows(self) -> bool:
        """Whether some joint follows another."""
        joints, coordinates = self.following.ratios.shape
        return bool(joints > coordinates)

    def forward_dynamics(self, q: Array, qd: Array, tau: Array) -> Array:
        if not self.follows:
            return self.free.forward_dynamics(q, qd, tau)
        load = tau - self.nonlinear_effects(q, qd)
        return np.asarray(np.linalg.solve(self.mass_matrix(q), load[..., None])[..., 0])

    def mass_matrix(self, q: Array) -> Array:
        whole = self.free.mass_matrix(self.following.positions(q))
        return self.following.summed(self.following.summed(whole), -2)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.following.summed(self.free.nonlinear_effects(*self.on_joints(q, qd)))

    def gravity(self, q: Array) -> Array:
        return self.following.summed(self.free.gravity(self.following.positions(q)))
