"""The MODEL evaluated in NumPy straight from its definition: slow, obvious, and the reference for everything
faster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from psdmc.dynamics.composite_body import mass_matrix as composite_bodies
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics as newton_euler
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.dynamics.regressor import regressor as standard_regressor
from psdmc.dynamics.scalar import Scalar
from psdmc.errors import InputError

if TYPE_CHECKING:
    from psdmc.model.dynamics_model import DynamicsModel

Array = NDArray[np.float64]

CHUNK_BYTES = 64 * 2**20
"""Function values held at once."""


def states(model: DynamicsModel, **vectors: ArrayLike) -> tuple[tuple[int, ...], list[Array]]:
    """The broadcast leading shape, and each vector as (states, n) float64; InputError where a shape does not
    fit."""
    arrays = {name: np.asarray(value, dtype=np.float64) for name, value in vectors.items()}
    for name, array in arrays.items():
        if array.ndim == 0 or array.shape[-1] != model.n:
            raise InputError(
                f"{name} has shape {array.shape}, expected (..., {model.n}) for {model.n} joints",
                "the last axis runs over " + ", ".join(model.joint_names),
            )
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError as error:
        found = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InputError(f"shapes do not broadcast: {found}", "make leading axes equal or one") from error
    return shape[:-1], [np.broadcast_to(a, shape).reshape(-1, model.n) for a in arrays.values()]


def function_values(model: DynamicsModel, q: Array, qd: Array, qdd: Array) -> Array:
    """(p, states) values of y from (states, n) arrays: products of the rows of E, gravity functions times
    |g|."""
    exponents = expanded(model)[0]
    rows = np.concatenate([q.T, np.sin(q).T, np.cos(q).T, qd.T, qdd.T])
    strength = np.where(exponents[3 * model.n :].any(axis=0), 1.0, np.linalg.norm(model.chain.gravity))
    values: Array = np.repeat(strength[:, None], q.shape[0], axis=1)
    for powers, row in zip(exponents, rows, strict=True):
        for power in (1, 2):
            chosen = powers == power
            if chosen.any():
                values[chosen] *= row**power
    return values


def expanded(model: DynamicsModel) -> tuple[NDArray[np.uint8], tuple[sparse.csr_array, ...]]:
    """E and P; InputError where the model has none."""
    if model.E is None or model.P is None:
        raise InputError("this model was derived without E and P", "derive it again without --no-expand")
    return model.E, model.P


def known(model: DynamicsModel) -> Array:
    """theta_b; InputError while it is unknown."""
    if model.theta_b is None:
        raise InputError(
            f"the base parameters of '{model.chain.name}' are unknown", "calibrate, or give all inertias"
        )
    return model.theta_b


def inverse_dynamics(model: DynamicsModel, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """tau (..., n), N m or N, from states (..., n). Without E and P by Newton-Euler on the same base
    parameters."""
    return torques_for(model, known(model), q, qd, qdd)


def torques_for(model: DynamicsModel, theta: Array, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Inverse dynamics with base parameters (l,) that are not the model's own."""
    shape, arrays = states(model, q=q, qd=qd, qdd=qdd)
    if model.P is None:
        return newton_euler_torques(model, theta, arrays).reshape(*shape, model.n)
    weights = _weights(model.P, theta)
    return _by_chunks(model, arrays, lambda y: (weights @ y).T).reshape(*shape, model.n)


def regressor(model: DynamicsModel, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
    """Y (..., n, l) with tau = Y theta_b."""
    shape, arrays = states(model, q=q, qd=qd, qdd=qdd)
    if model.P is None:
        return _standard_regressor(model, arrays).reshape(*shape, model.n, model.l)
    transposed = [matrix.T.tocsr() for matrix in model.P]

    def rows(y: Array) -> Array:
        return np.stack([matrix @ y for matrix in transposed]).transpose(2, 0, 1)

    return _by_chunks(model, arrays, rows).reshape(*shape, model.n, model.l)


def nonlinear_effects(model: DynamicsModel, q: ArrayLike, qd: ArrayLike) -> Array:
    """h(q, qd) = C(q, qd) qd + g(q), (..., n)."""
    return inverse_dynamics(model, q, qd, np.zeros(model.n))


def gravity(model: DynamicsModel, q: ArrayLike) -> Array:
    """g(q), (..., n)."""
    return inverse_dynamics(model, q, np.zeros(model.n), np.zeros(model.n))


def mass_matrix(model: DynamicsModel, q: ArrayLike) -> Array:
    """M(q), (..., n, n): column j is what the functions with qdd_j give for qdd_j = 1."""
    theta = known(model)
    shape, (angles,) = states(model, q=q)
    if model.P is None:
        return composite_mass_matrix(model, angles).reshape(*shape, model.n, model.n)
    exponents, matrices = expanded(model)
    weights = _weights(matrices, theta)
    columns = [np.flatnonzero(exponents[4 * model.n + j]) for j in range(model.n)]
    parts = [weights[:, own] for own in columns]

    def columns_of(y: Array) -> Array:
        return np.stack([part @ y[own] for part, own in zip(parts, columns, strict=True)]).transpose(2, 1, 0)

    rest, unit = np.zeros_like(angles), np.ones_like(angles)
    return _by_chunks(model, [angles, rest, unit], columns_of).reshape(*shape, model.n, model.n)


def _weights(matrices: Sequence[sparse.csr_array], theta: Array) -> sparse.csr_array:
    """(n, p) what each function weighs in each torque; sparse, whose sums do not hang on the number of
    threads."""
    return sparse.csr_array(np.stack([matrix @ theta for matrix in matrices]))


def _by_chunks(model: DynamicsModel, arrays: list[Array], result: Callable[[Array], Array]) -> Array:
    """result(function values) for few enough states at a time, put together along the states."""
    count = len(arrays[0])
    size = max(1, CHUNK_BYTES // (8 * max(1, expanded(model)[0].shape[1])))
    starts = range(0, max(count, 1), size)
    parts = [result(function_values(model, *(a[start : start + size] for a in arrays))) for start in starts]
    return np.concatenate(parts)


def newton_euler_torques(model: DynamicsModel, theta: Array, arrays: list[Array]) -> Array:
    """tau (states, n) of base parameters (l,) along q, qd, qdd (states, n): quick for any p, E and P are not used."""
    x = model.representative @ theta
    q, qd, qdd = (list(array.T) for array in arrays)
    chain = model.chain
    bodies, drives = bodies_of(chain, x), drive_inertia_of(x)
    torques = newton_euler(frames_of(chain), bodies, drives, q, qd, qdd, base_acceleration(chain))
    return _columns(torques, len(arrays[0]))


def composite_mass_matrix(model: DynamicsModel, q: Array) -> Array:
    """M(q) (states, n, n) from (states, n) by composite bodies that have the model's theta_b: quick for any p."""
    x = model.representative @ known(model)
    chain = model.chain
    rows = composite_bodies(frames_of(chain), bodies_of(chain, x), drive_inertia_of(x), list(q.T))
    return np.stack([_columns(row, len(q)) for row in rows], axis=1)


def _standard_regressor(model: DynamicsModel, arrays: list[Array]) -> Array:
    lift = model.representative
    wanted = np.flatnonzero(lift.any(axis=1)).tolist()
    q, qd, qdd = (list(array.T) for array in arrays)
    chain = model.chain
    placements = [joint.link_frame for joint in chain.joints]
    rows = standard_regressor(
        frames_of(chain), placements, frozenset(wanted), q, qd, qdd, base_acceleration(chain)
    )
    count = len(arrays[0])
    full = np.stack([_columns([row.get(c, 0.0) for c in wanted], count) for row in rows], axis=1)
    result: Array = full @ lift[wanted]
    return result


def _columns(values: Sequence[Scalar], count: int) -> Array:
    """(count, len(values)) from scalars or (count,) arrays."""
    return np.stack([np.broadcast_to(np.asarray(v, dtype=np.float64), (count,)) for v in values], axis=1)
