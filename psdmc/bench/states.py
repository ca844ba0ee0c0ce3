"""Fresh random states, laid out as each contestant wants them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.robot.chain import Array, Chain

COUNT = 65_536
"""States per trial: with a thousand the branch predictor learns glibc's sincos by heart."""

REVOLUTE_RANGE = (np.radians(170.0), 3.0, 15.0)
PRISMATIC_RANGE = (0.3, 0.5, 3.0)
"""Largest q, qd, qdd drawn: rad, m and their rates. Limits of ordinary arms."""


@dataclass(frozen=True, eq=False)
class States:
    """`count` random states of a chain.

    q, qd, qdd  (count, n)
    """

    chain: Chain
    q: Array
    qd: Array
    qdd: Array

    @staticmethod
    def random(chain: Chain, count: int, seed: int) -> States:
        """Uniform within an ordinary arm's limits."""
        rng = np.random.default_rng(seed)
        ranges = np.array([REVOLUTE_RANGE if turns else PRISMATIC_RANGE for turns in chain.is_revolute])
        q, qd, qdd = (rng.uniform(-1.0, 1.0, (count, len(chain))) * ranges[:, k] for k in range(3))
        return States(chain, q, qd, qdd)

    @property
    def count(self) -> int:
        return len(self.q)

    @property
    def n(self) -> int:
        return self.q.shape[1]

    @cached_property
    def tau(self) -> Array:
        """(count, n) torques at these states, by psdmc's own Newton-Euler on arrays: what is checked against."""
        bodies = bodies_of(self.chain, self.chain.parameters)
        drives = drive_inertia_of(self.chain.parameters)
        q, qd, qdd = (list(values.T) for values in (self.q, self.qd, self.qdd))
        base = base_acceleration(self.chain)
        torques = inverse_dynamics(frames_of(self.chain), bodies, drives, q, qd, qdd, base)
        return np.stack(torques, axis=1)

    def inputs(self, function: str, lanes: int = 1) -> tuple[Array, Array, Array]:
        """q, qd and qdd (forward dynamics: tau), flat; with lanes > 1 in blocks [variable][lane]."""
        x = self.tau if function == "forward_dynamics" else self.qdd
        return self._laid_out(self.q, lanes), self._laid_out(self.qd, lanes), self._laid_out(x, lanes)

    def _laid_out(self, rows: Array, lanes: int) -> Array:
        blocks = rows.reshape(-1, lanes, self.n).transpose(0, 2, 1)
        return np.ascontiguousarray(blocks).ravel()
