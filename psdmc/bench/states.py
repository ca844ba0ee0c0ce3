"""Fresh random states, laid out as each contestant wants them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.dynamics.scalar import ZERO, Vector
from psdmc.robot.chain import Array, Chain

COUNT = 65_536
"""States per trial: with a thousand the branch predictor learns glibc's sincos by heart."""

CACHE_LINE = 64
"""Every contestant's arrays start at one, as a careful user's would; where malloc puts them is luck."""


def at_cache_line(size: int) -> Array:
    """(size,) zeros that start at a cache line."""
    spare = CACHE_LINE // 8
    memory = np.zeros(size + spare)
    first = -memory.ctypes.data // 8 % spare
    return memory[first : first + size]


def moved(array: Array) -> Array:
    """A copy elsewhere, made while the array still takes its own place."""
    copy = at_cache_line(len(array))
    copy[:] = array
    return copy


@dataclass(frozen=True, eq=False)
class States:
    """`count` random states of a chain.

    q, qd, qdd  (count, n)
    """

    chain: Chain
    q: Array
    qd: Array
    qdd: Array
    _layouts: dict[tuple[str, int], Array] = field(default_factory=dict, repr=False)

    @staticmethod
    def random(chain: Chain, count: int, seed: int) -> States:
        """Uniform within an ordinary arm's limits."""
        rng = np.random.default_rng(seed)
        ranges = np.array([joint.ordinary for joint in chain.types])
        q, qd, qdd = (rng.uniform(-1.0, 1.0, (count, len(chain))) * ranges[:, k] for k in range(3))
        return States(chain, q, qd, qdd)

    @property
    def count(self) -> int:
        return len(self.q)

    @property
    def n(self) -> int:
        return len(self.chain)

    @cached_property
    def tau(self) -> Array:
        """(count, n) torques at these states."""
        return self._torques(self.q, self.qd, self.qdd, base_acceleration(self.chain))

    def expected(self, function: str) -> Array:
        """(count, outputs) what a function must put out, by psdmc's own Newton-Euler on arrays.

        Regressors: the torques, which each one's parameters must turn it into.
        """
        zero, base = np.zeros_like(self.q), base_acceleration(self.chain)
        if function in ("inverse_dynamics", "regressor"):
            return self.tau
        if function == "forward_dynamics":
            return self.qdd
        if function == "nonlinear_effects":
            return self._torques(self.q, self.qd, zero, base)
        if function == "gravity":
            return self._torques(self.q, zero, zero, base)
        if function == "mass_matrix":
            units = (np.broadcast_to(unit, self.q.shape) for unit in np.eye(self.n))
            return np.hstack([self._torques(self.q, zero, unit, ZERO) for unit in units])
        raise ValueError(f"nothing to check {function} against")

    def inputs(self, function: str, lanes: int = 1) -> tuple[Array, Array, Array]:
        """q, qd and qdd (forward dynamics: tau), flat; with lanes > 1 in blocks [variable][lane]."""
        x = "tau" if function == "forward_dynamics" else "qdd"
        return self._laid_out("q", lanes), self._laid_out("qd", lanes), self._laid_out(x, lanes)

    def move(self) -> None:
        """Put all inputs elsewhere. Which physical pages an array gets decides whose lines collide in the caches: up to
        a fifth of a batch call's time. Moved between trials, that is a part of the spread and not luck of the run."""
        for key, array in self._layouts.items():
            self._layouts[key] = moved(array)

    def _laid_out(self, name: str, lanes: int) -> Array:
        """Shared by all contestants, so that none finds a cache colder than another."""
        if (name, lanes) not in self._layouts:
            rows: Array = getattr(self, name)
            blocks = rows.reshape(-1, lanes, self.n).transpose(0, 2, 1)
            flat = at_cache_line(rows.size)
            flat[:] = blocks.ravel()
            self._layouts[name, lanes] = flat
        return self._layouts[name, lanes]

    def _torques(self, q: Array, qd: Array, qdd: Array, base: Vector) -> Array:
        bodies = bodies_of(self.chain, self.chain.parameters)
        drives = drive_inertia_of(self.chain.parameters)
        q_, qd_, qdd_ = (list(values.T) for values in (q, qd, qdd))
        torques = inverse_dynamics(frames_of(self.chain), bodies, drives, q_, qd_, qdd_, base)
        return np.stack([np.broadcast_to(torque, len(q)) for torque in torques], axis=1)
