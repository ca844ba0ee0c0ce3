"""The certificate: the finished model against recursive Newton-Euler, on states that derivation never saw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics as newton_euler
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.dynamics.regressor import regressor
from psdmc.errors import DerivationError, InternalError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import Mechanism

Array = NDArray[np.float64]

States = tuple[list[Array], list[Array], list[Array]]
"""q, qd and qdd, a list of n arrays each."""

SEED = 19_041_490
SAMPLES = 64
"""Fresh states per certificate."""

RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these."""

WORST_ALLOWED = 1e-8
"""A certificate beyond this is no rounding, unless the robot's numbers make it so."""

ROUNDING = 1e-12
"""Share of a joint's largest contribution that rounding can add to its torque: evaluating some thousand terms in double."""

SCALES = "check the units of masses, inertias and lengths: these do not belong to one robot"


def certificate(model: DynamicsModel) -> Array:
    """(n,) largest torque error per joint relative to that joint's largest torque.

    The model's own parameters where they are known, else random ones from the span.
    Where one exceeds WORST_ALLOWED: DerivationError if the robot's own numbers are the cause (they overflow, or a joint's
    torque is a small difference of large contributions), else InternalError.
    """
    rng = np.random.default_rng(SEED)
    x, theta = _parameters(model, rng)
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, size=(SAMPLES, model.n)) for limit in RANGES)
    chain = model.mechanism
    states = (list(q.T), list(qd.T), list(qdd.T))
    with np.errstate(over="ignore", invalid="ignore"):
        expected = newton_euler(
            frames_of(chain), bodies_of(chain, x), drive_inertia_of(x), *states, base_acceleration(chain)
        )
        reference = np.stack([np.broadcast_to(torque, (SAMPLES,)) for torque in expected], axis=1)
        errors = relative_errors(model.torques_for(theta, q, qd, qdd), reference)
        if not np.all(errors <= WORST_ALLOWED):
            raise _failure(chain, x, states, reference, errors)
    return errors


def _failure(
    chain: Mechanism, x: Array, states: States, reference: Array, errors: Array
) -> DerivationError | InternalError:
    """Who is to blame for errors beyond WORST_ALLOWED: the robot's numbers or psdmc."""
    largest = np.abs(reference).max(axis=0)
    cancelled = _contributions(chain, x, states) / np.where(largest > 0, largest, 1.0)
    worst = int(np.argmax(np.where(np.isfinite(errors), errors, np.inf)))
    name = f"'{chain.name}': joint '{chain.joint_names[worst]}'"
    if not np.isfinite(cancelled).all():
        return DerivationError(f"{name}: its torque overflows double precision", SCALES)
    if np.all(errors <= np.maximum(WORST_ALLOWED, ROUNDING * cancelled)):
        return DerivationError(
            f"{name}: its torque is the difference of contributions {cancelled[worst]:.1g} times as large; double "
            f"precision leaves errors of {errors[worst]:.2g} of it",
            SCALES,
        )
    return InternalError(
        f"joint '{chain.joint_names[worst]}': the derived model is off Newton-Euler by "
        f"{errors[worst]:.2g} of its largest torque"
    )


def _contributions(chain: Mechanism, x: Array, states: States) -> Array:
    """(n,) largest sum of the magnitudes that all parameters contribute to each joint's torque."""
    values = np.abs(x.reshape(-1))
    wanted = frozenset(np.flatnonzero(values).tolist())
    places = [joint.link_frame for joint in chain.joints]
    q, qd, qdd = states
    rows = regressor(frames_of(chain), places, wanted, q, qd, qdd, base_acceleration(chain))
    sums = [sum(np.abs(entry) * values[p] for p, entry in row.items()) for row in rows]
    return np.array([np.max(total) for total in sums])


def relative_errors(values: Array, reference: Array) -> Array:
    """(n,) largest difference per column relative to the column's largest magnitude; absolute where that is
    zero."""
    largest = np.abs(reference).max(axis=0)
    errors: Array = np.abs(values - reference).max(axis=0) / np.where(largest > 0, largest, 1.0)
    return errors


def _parameters(model: DynamicsModel, rng: np.random.Generator) -> tuple[Array, Array]:
    """Standard and base parameters to certify with."""
    if model.theta_b is not None:
        return np.nan_to_num(model.mechanism.parameters.reshape(-1)), np.asarray(model.theta_b)
    span = model.mechanism.parameter_span
    x: Array = span @ rng.normal(size=span.shape[1])
    return x, model.B @ x
