"""Computes a robot's dynamics in NumPy for many states at once. Tests compare generated functions with these
results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.derivatives import inverse_dynamics_derivatives
from psdmc.dynamics.frames import Frame, base_acceleration, frames_of
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench, inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.dynamics.second_derivatives import inverse_dynamics_second_derivatives
from psdmc.dynamics.spatial import Body
from psdmc.friction.joints import FrictionInDynamics
from psdmc.reproducible import solved, times
from psdmc.robot.mechanism import Array, Mechanism

if TYPE_CHECKING:
    from psdmc.model.dynamics_model import DynamicsModel


@dataclass(frozen=True, eq=False)
class RobotOnArrays:
    """A robot whose links have standard parameters x that give the torques of the base parameters theta_b. Dynamics are
    computed in NumPy for many states at once.

    x         (11 n,) standard parameters about the link frames, 11 for each of n links
    lift      (11 n, l) matrix that gives x from the l base parameters
    friction  joint friction, which all torques with `qd` contain; None: they have none
    gravity   (k, 3) gravity of each of k states, m/s^2 in the base frame; None: that of `chain`
    """

    chain: Mechanism
    x: Array
    lift: Array
    friction: FrictionInDynamics | None = None
    gravity: Array | None = None

    @classmethod
    def of(cls, model: DynamicsModel, theta_b: Array) -> Self:
        """Return the robot of a model, with the base parameters `theta_b`."""
        return cls(model.mechanism, times(model.representative, theta_b), model.representative)

    @property
    def n(self) -> int:
        return len(self.chain)

    @property
    def nv(self) -> int:
        return self.chain.nv

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        return frames_of(self.chain)

    @cached_property
    def base_acceleration(self) -> Vector:
        if self.gravity is None:
            return base_acceleration(self.chain)
        x, y, z = -self.gravity.T
        return (x, y, z)

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        return bodies_of(self.chain, self.x)

    @cached_property
    def drives(self) -> list[float]:
        return drive_inertia_of(self.x)

    @cached_property
    def solids(self) -> tuple[Body, ...]:
        """Return the links' bodies with the robot's known standard parameters, not with those made from theta_b."""
        return bodies_of(self.chain, self.chain.parameters)

    def torques(
        self,
        q: Array,
        qd: Array,
        qdd: Array,
        base_acceleration: Vector,
        qd_r: Array | None = None,
        external: Mapping[int, Wrench] = NO_WRENCHES,
    ) -> Array:
        """Return the joint torques (k, n) M qdd + C(q, qd) qd_r for k states. C(q, qd) is the Coriolis matrix; without
        qd_r, it multiplies qd.

        `base_acceleration` is the acceleration of the base, which includes gravity. `external` are the wrenches on the
        links.
        """
        rates = None if qd_r is None else list(qd_r.T)
        given = (list(q.T), list(qd.T), list(qdd.T))
        torques = inverse_dynamics(
            self.frames, self.bodies, self.drives, *given, base_acceleration, qd_r=rates, external=external
        )
        found = columns(torques, len(q))
        return found if self.friction is None else found + columns(self.friction.torques(*given[:2]), len(q))

    def torque_derivatives(
        self, q: Array, qd: Array, qdd: Array, external: Mapping[int, Wrench] = NO_WRENCHES
    ) -> tuple[Array, Array, Array]:
        """Return the derivatives of the joint torques by q, by qd and by qdd, an array (k, n, n) each, for k states.
        Row i has the derivatives of tau[i]."""
        given = (list(q.T), list(qd.T), list(qdd.T))
        found = inverse_dynamics_derivatives(
            self.frames, self.bodies, self.drives, *given, self.base_acceleration, external=external
        )
        by_q, by_qd, by_qdd = (matrix(rows, len(q)) for rows in found[:3])
        if self.friction is not None:
            own = np.arange(self.nv)
            for block, slopes in zip((by_q, by_qd), self.friction.slopes(*given[:2]), strict=True):
                block[:, own, own] += columns(slopes, len(q))
        return by_q, by_qd, by_qdd

    def torque_hessian(self, q: Array, qd: Array, qdd: Array, weights: Array) -> Array:
        """(k, 3 nv, 3 nv) second derivatives of the weighted torques by (q, qd, qdd)."""
        given = (list(q.T), list(qd.T), list(qdd.T), list(weights.T))
        found = inverse_dynamics_second_derivatives(self.frames, self.bodies, *given, self.base_acceleration)
        hessian = matrix(found.hessian, len(q))
        if self.friction is not None:
            q_q, q_qd, qd_qd = (weights * columns(each, len(q)) for each in self.friction.bends(*given[:2]))
            own, rate = np.arange(self.nv), np.arange(self.nv) + self.nv
            for rows, others, block in (
                (own, own, q_q),
                (own, rate, q_qd),
                (rate, own, q_qd),
                (rate, rate, qd_qd),
            ):
                hessian[:, rows, others] += block
        return hessian

    def accelerations(self, q: Array, qd: Array, tau: Array) -> Array:
        """(k, n) joint accelerations."""
        bias = self.torques(q, qd, np.zeros_like(qd), self.base_acceleration)
        return solved(self.mass_matrix(q), (tau - bias)[..., None])[..., 0]

    def mass_matrix(self, q: Array) -> Array:
        """(k, nv, nv)"""
        return matrix(mass_matrix(self.frames, self.bodies, self.drives, list(q.T)), len(q))


def columns(values: Sequence[Scalar], count: int) -> Array:
    """(count, len(values)) from numbers or (count,) arrays."""
    found = np.empty((count, len(values)))
    for i, value in enumerate(values):
        found[:, i] = value
    return found


def matrix(rows: Sequence[Sequence[Scalar]], count: int) -> Array:
    """Return an array (count, rows, columns), with one matrix for each of `count` states. The entries of `rows` are
    numbers, or arrays (count,) with a value per state."""
    return np.stack([columns(row, count) for row in rows], axis=1)


def entries(values: Any, count: int) -> Array:
    """Return an array (count, ...) with one entry for each of `count` states. `values` are a number, an array (count,),
    or nested sequences of them."""
    if isinstance(values, list | tuple):
        return np.stack([entries(value, count) for value in values], axis=1)
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (count,))
