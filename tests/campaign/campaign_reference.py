"""What an oracle says of a robot at random states, and by how much something else differs from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from campaign_joints import ROOT_RATES
from campaign_oracles import Pinocchio, Textbook

Array = np.ndarray
States = tuple[Array, Array, Array]

RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these; a floating base's quaternions are of any direction."""

FEW = 50
"""States at which the mass matrix, nonlinear effects, gravity and forward dynamics are compared."""


def random_states(seed: int, n: int, count: int, is_floating: bool = False) -> States:
    """Of n joints of one coordinate, a floating base before them where the robot has one."""
    rng = np.random.default_rng([20, seed])
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, (count, n)) for limit in RANGES)
    if not is_floating:
        return q, qd, qdd
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    roots = [limit * rng.uniform(-1.0, 1.0, (count, ROOT_RATES)) for limit in RANGES]
    return np.hstack([roots[0][:, :3], turns, q]), np.hstack([roots[1], qd]), np.hstack([roots[2], qdd])


@dataclass(frozen=True, slots=True)
class Reference:
    """A robot's dynamics by an oracle: torques at all states, the rest at the first FEW.

    joint_scale  (nv,) each joint's largest torque over all states: what errors of torques are relative to
    """

    states: States
    few: States
    tau: Array
    mass: Array
    nonlinear: Array
    gravity: Array
    joint_scale: Array

    @staticmethod
    def of(oracle: Pinocchio | Textbook, states: States) -> Reference:
        few = tuple(vector[:FEW] for vector in states)
        q, qd, _ = few
        tau = oracle.torques(*states)
        largest = np.abs(tau).max(axis=0)
        scale = np.where(largest > 0, largest, 1.0)
        mass, nonlinear = oracle.mass_matrix(q), oracle.nonlinear_effects(q, qd)
        return Reference(states, few, tau, mass, nonlinear, oracle.gravity(q), scale)

    def is_singular_in(self, real: str) -> Array:
        """(few,) whether rounding the mass matrix to this precision may leave it indefinite, its diagonal made one: that
        changes eigenvalues by up to n units in the last place."""
        root = np.sqrt(np.einsum("sii->si", self.mass)).astype(np.float64)
        scaled = self.mass.astype(np.float64) / root[:, :, None] / root[:, None, :]
        smallest = np.linalg.eigvalsh(scaled).min(axis=1)
        return np.asarray(smallest < root.shape[1] * np.finfo(real).eps)

    def torque_error(self, found: Array, expected: Array) -> float:
        """Largest difference of any joint, relative to that joint's largest torque."""
        return float((np.abs(found - expected).max(axis=0) / self.joint_scale).max())

    def mass_error(self, found: Array) -> float:
        """Largest difference of any row, relative to that row's largest entry."""
        largest = np.abs(self.mass).max(axis=(0, 2))
        return float((np.abs(found - self.mass).max(axis=(0, 2)) / np.where(largest > 0, largest, 1.0)).max())

    def acceleration_error(self, found: Array) -> float:
        """The torques by which accelerations differ from those that the torques belong to, relative like errors of torques:
        a solver answers for them, not for the accelerations, which a small mass matrix magnifies."""
        moved = np.einsum("sij,sj->si", self.mass, found - self.few[2])
        return self.torque_error(moved, np.zeros_like(moved))
