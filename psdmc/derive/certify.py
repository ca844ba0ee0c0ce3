"""The certificate: the finished model against recursive Newton-Euler, on states that derivation never saw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics as newton_euler
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.errors import InternalError
from psdmc.model import evaluate
from psdmc.model.dynamics_model import DynamicsModel

Array = NDArray[np.float64]

SEED = 19_041_490
SAMPLES = 64
"""Fresh states per certificate."""

RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these."""

WORST_ALLOWED = 1e-8
"""A certificate beyond this is no rounding: something in psdmc is wrong."""


def certificate(model: DynamicsModel) -> Array:
    """(n,) largest torque error per joint relative to that joint's largest torque.

    The model's own parameters where they are known, else random ones from the span.
    InternalError where an error exceeds WORST_ALLOWED.
    """
    rng = np.random.default_rng(SEED)
    x, theta = _parameters(model, rng)
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, size=(SAMPLES, model.n)) for limit in RANGES)
    chain = model.chain
    expected = newton_euler(
        frames_of(chain),
        bodies_of(chain, x),
        drive_inertia_of(x),
        list(q.T),
        list(qd.T),
        list(qdd.T),
        base_acceleration(chain),
    )
    reference = np.stack([np.broadcast_to(torque, (SAMPLES,)) for torque in expected], axis=1)
    errors = relative_errors(evaluate.torques_for(model, theta, q, qd, qdd), reference)
    worst = int(np.argmax(errors))
    if not errors[worst] <= WORST_ALLOWED:
        raise InternalError(
            f"joint '{chain.joint_names[worst]}': the derived model is off Newton-Euler by "
            f"{errors[worst]:.2g} of its largest torque"
        )
    return errors


def relative_errors(values: Array, reference: Array) -> Array:
    """(n,) largest difference per column relative to the column's largest magnitude; absolute where that is
    zero."""
    largest = np.abs(reference).max(axis=0)
    errors: Array = np.abs(values - reference).max(axis=0) / np.where(largest > 0, largest, 1.0)
    return errors


def _parameters(model: DynamicsModel, rng: np.random.Generator) -> tuple[Array, Array]:
    """Standard and base parameters to certify with."""
    if model.theta_b is not None:
        return np.nan_to_num(model.chain.parameters.reshape(-1)), np.asarray(model.theta_b)
    span = model.chain.parameter_span
    x: Array = span @ rng.normal(size=span.shape[1])
    return x, model.B @ x
