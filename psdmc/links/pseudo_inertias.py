"""Pseudo-inertias (4 x 4 mass matrices) of links in fits, and the constraints and costs that keep them physical.

The constraints are positive definite pseudo-inertias and positive drive inertias. Rows of a pseudo-inertia can be zero
by assumption. The cost is a small distance from the bodies in the robot file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array

ORDINARY_BODY = (1.0, 1.0, 1.0, 5.0)
"""Diagonal of a pseudo-inertia: 5 kg spread over 0.1 m."""
THIN_BODY = 1e-3
"""Eigenvalues of the file's pseudo-inertias count as at least this share of the largest: some published bodies are no
distribution of mass, and others are points."""


def pseudo_inertia(link: Sequence[Any]) -> list[list[Any]]:
    """Return the pseudo-inertia (4 x 4 mass matrix) of a link with the parameters m, m r (3), Ixx, Ixy, Iyy, Ixz, Iyz,
    Izz.

    Lengths are in units of 0.1 m, so that all entries have similar size in the solver.
    """
    m, hx, hy, hz, ixx, ixy, iyy, ixz, iyz, izz = link
    half = 0.5 * (ixx + iyy + izz)
    t = 10.0
    return [
        [t * t * (half - ixx), -t * t * ixy, -t * t * ixz, t * hx],
        [-t * t * ixy, t * t * (half - iyy), -t * t * iyz, t * hy],
        [-t * t * ixz, -t * t * iyz, t * t * (half - izz), t * hz],
        [t * hx, t * hy, t * hz, m],
    ]


def reference_body(link: Array, held: list[int]) -> tuple[Array, bool]:
    """Return the pseudo-inertia near which a fit keeps a link, and whether it comes from the robot file. If the file
    gives no inertia, it is that of a 5 kg body of ordinary size.

    held  numbers of the rows and columns of the 4 x 4 matrix that are not zero by assumption; the others are left out
    """
    if not np.isfinite(link[:10]).all() or not link[0] > 0:
        return np.diag([ORDINARY_BODY[k] for k in held]), False
    body = np.array(pseudo_inertia(link[:10].tolist()))[np.ix_(held, held)]
    values, axes = np.linalg.eigh(body)
    return np.asarray((axes * np.maximum(values, THIN_BODY * values[-1])) @ axes.T), True


def held_rows(span: Array, start: int) -> list[int]:
    """Return the numbers (0 to 3) of the rows of a link's pseudo-inertia that are not zero by the model's assumptions.

    span   (11 n, k)  basis of the standard parameters x that the assumptions allow
    start  index of the link's first parameter in x (11 n,)
    """
    flat = flat_rows(span, start)
    return [k for k in range(4) if k not in flat and not vanishes(span, start, k)]


def flat_rows(span: Array, start: int) -> list[int]:
    """Return the numbers of the rows of a link's pseudo-inertia that are zero for every real body that the assumptions
    allow.

    If the moment of inertia about an axis is assumed zero, the link has no extent across that axis. An example is a rod
    along x whose Ixx is assumed zero.
    """
    rows: set[int] = set()
    for axis, inertia in enumerate((4, 6, 9)):
        if not np.any(np.abs(span[start + inertia]) > 1e-12):
            rows |= {k for k in range(3) if k != axis}
    return sorted(rows)


def flat_equations(span: Array, start: int) -> list[Array]:
    """Return linear equations in x, the (11 n,) standard parameters, for one link: each row times x is zero. Every real
    body that the assumptions allow fulfils the equations.

    start  index of the link's first parameter in x
    """
    if not np.any(span[start]):
        return []
    rows = []
    for k in flat_rows(span, start):
        for column in range(4):
            row = np.zeros(len(span))
            row[start : start + 10] = [pseudo_inertia(unit)[k][column] for unit in np.eye(10).tolist()]
            rows.append(row)
    return rows


def vanishes(span: Array, start: int, k: int) -> bool:
    """Return whether the assumptions make row k of a link's pseudo-inertia zero. An example is row z of a planar link
    without extent along z."""
    mass, moments = start, (start + 1, start + 2, start + 3)
    if k == 3:
        return not np.any(span[mass])
    inertia = span[[start + 4, start + 6, start + 9]]
    own = 0.5 * inertia.sum(axis=0) - inertia[k]
    return not np.any(span[moments[k]]) and not np.any(np.abs(own) > 1e-12)


@dataclass(frozen=True, slots=True)
class PhysicalOptions:
    """Bounds of the physically consistent fit, and weights of the distance from the bodies in the robot file.

    smallest        smallest eigenvalue of each link's pseudo-inertia, in kg, with lengths in units of 0.1 m
    smallest_drive  smallest value of each drive inertia that is a parameter, kg m^2
    known_body      weight of the distance (divergence) from the file's body, if the file has one. The divergence
                    compares two distributions of mass and does not depend on unit or frame (Lee, Wensing, Park 2020)
    unknown_body    weight of the distance from an ordinary body if the file has none: enough to keep the pseudo-inertia
                    positive definite
    """

    smallest: float = 1e-6
    smallest_drive: float = 1e-4
    known_body: float = 1.0
    unknown_body: float = 1e-2


def known_inner(model: DynamicsModel) -> Array:
    """Return the coordinates of the file's standard parameters in the basis `parameter_span`, which the assumptions
    allow. Unknown parameters count as zero."""
    span = model.mechanism.parameter_span
    known = np.nan_to_num(model.mechanism.parameters.reshape(-1))
    return np.asarray(np.linalg.lstsq(span, known, rcond=None)[0])


def link_terms(
    cp: Any, model: DynamicsModel, x: Any, link: int, options: PhysicalOptions
) -> tuple[list[Any], Any]:
    """Return the constraints for one link in a fit, and the weighted divergence (distance between distributions of
    mass) from the body in the robot file.

    The constraints keep the pseudo-inertia and the drive inertia above their bounds. A link that is assumed massless
    has no divergence, and only the constraint of the drive inertia.
    """
    start = PARAMETERS_PER_LINK * link
    span: Array = model.mechanism.parameter_span
    constraints: list[Any] = []
    if np.any(span[start + 10]):
        constraints.append(x[start + 10] >= options.smallest_drive)
    if not np.any(span[start]):
        return constraints, 0.0
    held = held_rows(span, start)
    body = cp.bmat(pseudo_inertia([x[start + k] for k in range(10)]))
    constraints += [body[k, :] == 0 for k in flat_rows(span, start) if not vanishes(span, start, k)]
    block = body[held, :][:, held] if len(held) < 4 else body
    near, is_known = reference_body(model.mechanism.parameters[link], held)
    weight = options.known_body if is_known else options.unknown_body
    divergence = cp.trace(np.linalg.inv(near) @ block) - cp.log_det(block)
    return [*constraints, block >> options.smallest * np.eye(len(held))], weight * divergence


def require_cvxpy() -> Any:
    """Return the module cvxpy. Raises InputError with the remedy if cvxpy or its solver is not installed."""
    missing = [name for name in ("cvxpy", "clarabel") if find_spec(name) is None]
    if missing:
        raise InputError(
            f"physical consistency needs {' and '.join(missing)}, not installed here",
            "pip install 'psdmc[calibrate]', or see the unconstrained fit with --no-physical",
        )
    return import_module("cvxpy")
