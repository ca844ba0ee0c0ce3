"""Simulates elastic joints: the motion of the links behind motors whose motion is prescribed.

This is the model of Spong (1987). A spring and a damper connect the motor and the link of each elastic joint. A rotor's
kinetic energy comes from its own rotation alone. The unknowns are the deflections (motor minus link position), so that
the deflections of stiff joints keep their digits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp
from scipy.optimize import root

from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import Array
from psdmc.errors import InputError

RELATIVE_ERROR = 1e-8
"""Of the deflections, per step of the integrator."""
ABSOLUTE_ERRORS = 1e-13, 1e-10
"""rad and rad/s (m, m/s), per step."""
FASTEST = 1e3
"""rad/s: joints that oscillate or settle faster are integrated by an implicit method, which steps over the oscillation."""
LONGEST_STEP = 1e-2
"""s: no reversal of a motion below 10 Hz is stepped over."""
LARGEST_DEFLECTION = 1.0
"""rad (m), of a resting joint."""
POSES = 20
"""Rows of a motion at which the fastest oscillation is computed."""

Motion = Callable[[float], tuple[Array, Array, Array]]
"""From the time to new arrays of positions, speeds and accelerations (n,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Elastic:
    """A robot with elastic joints, whose motors move as prescribed.

    model      Pinocchio's model of the links; its armature has only the drive inertias of rigid joints
    stiffness  (n,) N m/rad (N/m); 0: the joint is rigid
    damping    (n,) N m s/rad (N s/m)
    motors     motion of the motors, divided by their gear ratios
    held       further torques (n,) that act against the links, by their positions, such as those of a harness
    names      names of the joints, for messages
    own        (m,) indices of the elastic joints
    upper      (m, m) the entries that Pinocchio computes of a symmetric matrix
    data       Pinocchio's memory for the model
    """

    model: Any
    stiffness: Array
    damping: Array
    motors: Motion
    held: Callable[[Array], Array]
    names: tuple[str, ...]
    own: Any = field(init=False)
    upper: Any = field(init=False)
    data: Any = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "own", np.flatnonzero(self.stiffness > 0))
        object.__setattr__(self, "upper", np.triu(np.ones((len(self.own), len(self.own)), dtype=bool)))
        object.__setattr__(self, "data", self.model.createData())

    def links(self, times: Array) -> tuple[Array, Array, Array]:
        """Return positions, speeds and accelerations of the links, each (N, n), at growing times (N,) from 0 s on.

        At 0 s, springs balance the torques of the prescribed motion. Raises InputError if they cannot.
        """
        grid = np.unique(np.concatenate([[0.0], times]))
        errors = np.repeat(ABSOLUTE_ERRORS, len(self.own))
        kept = {"rtol": RELATIVE_ERROR, "atol": errors, "max_step": LONGEST_STEP, "t_eval": grid}
        fast = self._fastest(grid) > FASTEST
        method = {"method": "Radau", "jac": self._jacobian} if fast else {"method": "DOP853"}
        found = solve_ivp(self._change, (0.0, grid[-1]), self._balanced(), **kept, **method)
        if not found.success:
            names = listed([self.names[k] for k in self.own])
            raise InputError(
                f"joint(s) {names}: their elasticity cannot be integrated: {found.message}",
                "give the joints more joint_damping, or a joint_stiffness that carries their links",
            )
        rows = [self._states(t, x)[:3] for t, x in zip(grid, found.y.T, strict=True)]
        at = np.searchsorted(grid, times)
        q, qd, qdd = (np.array(part)[at] for part in zip(*rows, strict=True))
        return q, qd, qdd

    def _inertia(self, q: Array) -> Array:
        """Mass matrix of the links that hang on elastic joints."""
        whole = pin.crba(self.model, self.data, q)[self.own][:, self.own]
        return np.asarray(np.where(self.upper, whole, whole.T))

    def _states(self, t: float, x: Array) -> tuple[Array, Array, Array, Array]:
        """Positions, speeds and accelerations (n,) of the links, from deflections and their rates (2 m,), and
        accelerations (m,) of the deflections."""
        q, qd, qdd = self.motors(t)
        own = self.own
        ahead = qdd[own]
        q[own] -= x[: len(own)]
        qd[own] -= x[len(own) :]
        qdd[own] = 0.0
        spring = self.stiffness[own] * x[: len(own)] + self.damping[own] * x[len(own) :]
        against = pin.rnea(self.model, self.data, q, qd, qdd) + self.held(q)
        qdd[own] = np.linalg.solve(self._inertia(q), spring - against[own])
        return q, qd, qdd, ahead - qdd[own]

    def _change(self, t: float, x: Array) -> Array:
        return np.concatenate([x[len(self.own) :], self._states(t, x)[3]])

    def _jacobian(self, t: float, x: Array) -> Array:
        """Change of the rates by the springs and dampers, which are what is fast."""
        own, theta = self.own, self.motors(t)[0]
        m = len(own)
        theta[own] -= x[:m]
        per = np.linalg.inv(self._inertia(theta))
        return np.block(
            [[np.zeros((m, m)), np.eye(m)], [-per * self.stiffness[own], -per * self.damping[own]]]
        )

    def _balanced(self) -> Array:
        """Deflections and zero rates (2 m,) at 0 s, with which the links accelerate as the motors do."""
        own = self.own
        theta, rate, acceleration = self.motors(0.0)

        def left(turn: Array) -> Array:
            q = theta.copy()
            q[own] -= turn / self.stiffness[own]
            torque = pin.rnea(self.model, self.data, q, rate, acceleration) + self.held(q)
            return np.asarray(turn - torque[own])

        found = root(left, -left(np.zeros(len(own))), tol=1e-12)
        bent = found.x / self.stiffness[own]
        balanced = np.abs(found.fun).max() <= 1e-6 * max(np.abs(found.x).max(), 1.0)
        if not balanced or np.abs(bent).max() > LARGEST_DEFLECTION:
            names = listed([self.names[k] for k in own])
            raise InputError(
                f"joint(s) {names}: no deflection of at most {LARGEST_DEFLECTION:g} rad (m) at which the springs carry the "
                "links",
                "give the joints a larger joint_stiffness",
            )
        return np.concatenate([bent, np.zeros(len(own))])

    def _fastest(self, times: Array) -> float:
        """The fastest oscillation or decay of the joints, rad/s."""
        rates = []
        for t in times[:: -(-len(times) // POSES)]:
            jacobian = self._jacobian(t, np.zeros(2 * len(self.own)))
            rates.append(np.abs(np.linalg.eigvals(jacobian)).max())
        return float(max(rates))
