"""Finds the physically possible load that is nearest to an estimate."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.physical import NotPhysical
from psdmc.calibration.logs.log import Array
from psdmc.dynamics.parameters import inertia_matrix, inertia_of, second_moments
from psdmc.links.link_bodies import pseudo_inertia
from psdmc.links.link_terms import require_cvxpy

LOAD = 10


def nearest_load(values: Array, whitening: Array, never_negative: NDArray[np.bool_]) -> Array:
    """Return the physically possible values of a load, with friction, that are nearest to an estimate.

    The first ten entries of `values` are mass, first moments and inertia of the load. The load may be a point or a rod.
    The cost of a candidate v is |W (v - values)|^2, W the whitening matrix. Entries that are marked in `never_negative`
    are friction values. Raises NotPhysical if the solver fails.
    """
    cp = require_cvxpy()
    size = 1.0 / np.linalg.norm(whitening, axis=0)
    step = cp.Variable(len(values))  # in standard deviations from the estimate
    v = values + cp.multiply(size, step)
    body = cp.bmat(pseudo_inertia([v[k] for k in range(LOAD)]))
    held = np.flatnonzero(never_negative)
    constraints = [body >> 0, *([v[held] >= 0.0] if len(held) else [])]
    loss = cp.sum_squares(np.linalg.qr(whitening, mode="r") @ cp.multiply(size, step))
    problem = cp.Problem(cp.Minimize(loss), constraints)
    with warnings.catch_warnings():  # cvxpy warns of reduced accuracy; the result is a body whatever that is
        warnings.simplefilter("ignore", UserWarning)
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            raise NotPhysical("physical consistency of the load: clarabel failed") from None
    if step.value is None:
        raise NotPhysical(f"physical consistency of the load: no solution ({problem.status})")
    found = values + size * np.asarray(step.value)
    return np.asarray(np.where(never_negative, np.maximum(found, 0.0), found))


def about_centre(load: Array) -> tuple[float, Array, Array]:
    """Return mass (kg), centre of mass (3,) and inertia about the centre of mass (3, 3) of a load from its ten
    parameters.

    The ten parameters are mass, first moments and inertia about the frame's origin. Second moments that rounding made
    negative become zero. The centre and the inertia of a load without mass are zero.
    """
    mass = float(load[0])
    if not mass > 0.0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    com = load[1:4] / mass
    second = second_moments(inertia_matrix(load)) - mass * np.outer(com, com)
    values, axes = np.linalg.eigh(second)
    return mass, com, inertia_of((axes * np.maximum(values, 0.0)) @ axes.T)
