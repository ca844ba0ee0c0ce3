"""A few states and what every generated function must give there, by psdmc.dynamics on arrays: no lowering is involved.

An emitted package's self-test compares with them on the user's machine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.kinematics import jacobian
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.scalar import ZERO, Scalar, Vector
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_parameters import random_parameters
from psdmc.robot.small import times

Array = NDArray[np.float64]

COUNT = 4
"""States kept: the self-test repeats them to fill batches, so that four show every entry without swelling the package."""

CANDIDATES = 32
"""States drawn; those whose mass matrices are best conditioned are kept, because forward dynamics loses digits with it."""

SEED = 2021
RANGES = {"q": np.pi, "qd": 3.0, "qdd": 5.0, "qd_r": 3.0, "qdd_r": 5.0}
"""rad or m and their rates: each vector is drawn from plus or minus these."""

LOAD = 0.25
"""Share of another physical robot's parameters that the check of run-time parameters adds to the robot's own."""

WORST_CONDITION = 1e7
"""Condition number of M beyond which a state says nothing about forward dynamics."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceStates:
    """k states, and the outputs that belong to them.

    given     vector name -> (k, n): q, qd, qdd, qd_r, qdd_r; tau and tau_theta, the torques of (q, qd, qdd) with the
              compiled-in parameters and with theta_b
    expected  kernel name (a function's, with _theta for parameters at run time) -> (k, outputs), matrices row by row
    theta_b   (l,) the run-time parameters of the _theta kernels; not the robot's own, so that a kernel that
              ignored them would be seen
    Where M(q) is not positive definite at the states, forward dynamics has no entry.
    """

    given: Mapping[str, Array]
    expected: Mapping[str, Array]
    theta_b: Array

    def __post_init__(self) -> None:
        shapes = {np.shape(array) for array in self.given.values()}
        if len(shapes) != 1 or len(next(iter(shapes))) != 2 or 0 in next(iter(shapes)):
            raise ValueError(f"reference states have shapes {sorted(shapes)}, expected one (k, n)")
        count = next(iter(shapes))[0]
        wrong = [name for name, array in self.expected.items() if len(array) != count or array.ndim != 2]
        if wrong:
            raise ValueError(f"reference values of {wrong[0]} are not {count} rows")
        object.__setattr__(self, "given", MappingProxyType(dict(self.given)))
        object.__setattr__(self, "expected", MappingProxyType(dict(self.expected)))


def reference_states(model: DynamicsModel, count: int = COUNT) -> ReferenceStates:
    """States of a model and every function's values there; those that need the unknown theta_b are left out."""
    rng = np.random.default_rng(SEED)
    given = {name: limit * rng.uniform(-1.0, 1.0, (CANDIDATES, model.n)) for name, limit in RANGES.items()}
    theta_b = _other_parameters(model)
    oracles = {"_theta": _Oracle(model, theta_b)}
    if model.theta_b is not None:
        oracles[""] = _Oracle(model, np.asarray(model.theta_b))
    conditions = np.max([oracle.conditions(given["q"]) for oracle in oracles.values()], axis=0)
    best = np.sort(np.argsort(np.round(np.log10(conditions), 6), kind="stable")[:count])
    given = {name: array[best] for name, array in given.items()}
    expected: dict[str, Array] = {}
    for suffix, oracle in oracles.items():
        values = oracle.values(given)
        given[f"tau{suffix}"] = values["inverse_dynamics"]
        expected |= {f"{name}{suffix}": value for name, value in values.items()}
        if conditions[best].max() < WORST_CONDITION:
            expected[f"forward_dynamics{suffix}"] = given["qdd"]
    expected |= _without_parameters(model, given)
    return ReferenceStates(given, expected, theta_b)


def _other_parameters(model: DynamicsModel) -> Array:
    other: Array = times(model.B, random_parameters(model.chain))
    return other if model.theta_b is None else model.theta_b + LOAD * other


class _Oracle:
    """The functions that depend on parameters, for one theta_b."""

    def __init__(self, model: DynamicsModel, theta_b: Array) -> None:
        x = times(model.representative, theta_b)
        chain = model.chain
        self.n = model.n
        self.frames, self.base = frames_of(chain), base_acceleration(chain)
        self.bodies, self.drives = bodies_of(chain, x), drive_inertia_of(x)

    def conditions(self, q: Array) -> Array:
        """Condition number of M(q) per state; infinite where it is not positive definite."""
        values = np.linalg.eigvalsh(self.mass_matrix(q).reshape(-1, self.n, self.n))
        with np.errstate(divide="ignore"):
            return np.where(values[:, 0] > 0.0, np.abs(values[:, -1] / values[:, 0]), np.inf)

    def values(self, given: Mapping[str, Array]) -> dict[str, Array]:
        """All but forward dynamics, (k, outputs)."""
        q, qd, qdd = given["q"], given["qd"], given["qdd"]
        rest = np.zeros_like(q)
        return {
            "inverse_dynamics": self._torques(q, qd, qdd, self.base),
            "mass_matrix": self.mass_matrix(q),
            "nonlinear_effects": self._torques(q, qd, rest, self.base),
            "coriolis_matrix": self._coriolis_matrix(q, qd),
            "gravity": self._torques(q, rest, rest, self.base),
        }

    def mass_matrix(self, q: Array) -> Array:
        return _matrix(mass_matrix(self.frames, self.bodies, self.drives, list(q.T)), len(q))

    def _coriolis_matrix(self, q: Array, qd: Array) -> Array:
        """Column j is what the velocities qd do where qd_r is joint j's unit rate."""
        rest = np.zeros_like(q)
        units = [np.broadcast_to(unit, q.shape) for unit in np.eye(self.n)]
        columns = [self._torques(q, qd, rest, ZERO, qd_r=unit) for unit in units]
        return np.stack(columns, axis=-1).reshape(len(q), -1)

    def _torques(self, q: Array, qd: Array, qdd: Array, base: Vector, qd_r: Array | None = None) -> Array:
        rates = None if qd_r is None else list(qd_r.T)
        states = (list(q.T), list(qd.T), list(qdd.T))
        torques = inverse_dynamics(self.frames, self.bodies, self.drives, *states, base, qd_r=rates)
        return _columns(torques, len(q))


def _without_parameters(model: DynamicsModel, given: Mapping[str, Array]) -> dict[str, Array]:
    """Regressors and the tip's Jacobian."""
    frames = frames_of(model.chain)
    q, qd, qdd, qd_r, qdd_r = (list(given[name].T) for name in ("q", "qd", "qdd", "qd_r", "qdd_r"))
    rows = jacobian(frames, model.chain.tip_body, model.chain.tip, q)
    return {
        "regressor": _regressor(model, q, qd, qdd, None),
        "regressor_slotine_li": _regressor(model, q, qd, qdd_r, qd_r),
        "jacobian": _matrix(rows, len(given["q"])),
    }


def _regressor(
    model: DynamicsModel,
    q: Sequence[Array],
    qd: Sequence[Array],
    qdd: Sequence[Array],
    qd_r: Sequence[Array] | None,
) -> Array:
    lift, chain = model.representative, model.chain
    wanted = np.flatnonzero(lift.any(axis=1)).tolist()
    places = [joint.link_frame for joint in chain.joints]
    base = base_acceleration(chain)
    rows = regressor(frames_of(chain), places, frozenset(wanted), q, qd, qdd, base, qd_r)
    count = len(q[0])
    full = np.stack([_columns([row.get(c, 0.0) for c in wanted], count) for row in rows], axis=1)
    in_base: Array = times(full, lift[wanted])
    return in_base.reshape(count, -1)


def _matrix(rows: Sequence[Sequence[Scalar]], count: int) -> Array:
    return np.hstack([_columns(row, count) for row in rows])


def _columns(values: Sequence[Scalar], count: int) -> Array:
    """(count, len(values)) from numbers or (count,) arrays."""
    return np.stack([np.broadcast_to(np.asarray(v, dtype=np.float64), (count,)) for v in values], axis=1)
