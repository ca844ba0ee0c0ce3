"""Physically consistent parameters: every link's pseudo-inertia positive definite, every drive inertia positive.

Wensing, Kim, Slotine 2018: a link is a distribution of mass just when the 4 x 4 matrix of its integrals of 1, r and r r^T
is positive. Then the mass matrix is positive definite everywhere, and forward dynamics exist.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from psdmc.calibrate.log import Array
from psdmc.dynamics.parameters import inertia_matrix, second_moments
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.chain import PARAMETERS_PER_LINK

SETTLING = 1e-6
"""Pull beside a squared standard deviation: settles what theta_b leaves open, moves nothing that it fixes."""


@dataclass(frozen=True, slots=True)
class PhysicalOptions:
    """How far inside.

    smallest        eigenvalue of each link's pseudo-inertia, relative to the largest mass and length scale 0.1 m
    smallest_drive  kg m^2, of each drive inertia that is a parameter
    pull            weight of small parameters beside the data's: squares of x (SI) against the share of the torque's
                    power that is left unexplained. Settles what the data barely see
    """

    smallest: float = 1e-6
    smallest_drive: float = 1e-4
    pull: float = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Physical:
    """theta_b = B x of physical standard parameters x (11 n,), and all values of the fit they are part of."""

    x: Array
    theta_b: Array
    values: Array


def physically_consistent(
    model: DynamicsModel,
    columns: Array,
    target: Array,
    weights: Array,
    options: PhysicalOptions | None = None,
    unit_loss: float | None = None,
) -> Physical:
    """The weighted least-squares fit among parameters that a real robot could have.

    columns    (N, n, l + extra)  the first l belong to theta_b, the others are free;  target, weights (N, n)
    unit_loss  sum of squares that counts as one beside `pull`; None: the target's
    InputError where cvxpy is missing or no solution is found.
    """
    options = options or PhysicalOptions()
    cp: Any = _cvxpy()
    l = model.l
    span: Array = model.chain.parameter_span
    unit = np.linalg.norm((columns * weights[:, :, None]).reshape(-1, columns.shape[2]), axis=0)
    unit[unit == 0] = 1.0
    rows = (columns * weights[:, :, None]).reshape(-1, columns.shape[2]) / unit
    factor: Array = np.linalg.qr(np.column_stack([rows, (target * weights).reshape(-1)]), mode="r")  # type: ignore[assignment]
    free = cp.Variable(columns.shape[2] - l)
    inner = cp.Variable(span.shape[1])
    x = span @ inner
    values = cp.hstack([cp.multiply(unit[:l], model.B @ x), free])
    loss = cp.sum_squares(factor[:, :-1] @ values - factor[:, -1])
    size = float(np.linalg.norm(factor[:, -1])) ** 2 if unit_loss is None else unit_loss
    constraints = [
        c for link in range(len(model.chain)) for c in _link_constraints(cp, model, x, link, options)
    ]
    problem = cp.Problem(cp.Minimize(loss / size + options.pull * cp.sum_squares(inner)), constraints)
    with warnings.catch_warnings():  # cvxpy warns of reduced accuracy; what matters is checked below
        warnings.simplefilter("ignore", UserWarning)
        problem.solve(solver=cp.CLARABEL)
    if inner.value is None:
        raise InputError(f"physical consistency: clarabel found no solution ({problem.status})")
    found = np.asarray(span @ inner.value)
    _require_physical(model, found)
    theta_b = model.B @ found
    return Physical(found, theta_b, np.concatenate([theta_b, np.asarray(free.value) / unit[l:]]))


def _require_physical(model: DynamicsModel, x: Array) -> None:
    """The solver's word, held against the pseudo-inertias themselves; none may be negative beyond rounding."""
    for joint, link in zip(model.chain.joints, x.reshape(-1, PARAMETERS_PER_LINK), strict=True):
        matrix = np.zeros((4, 4))
        matrix[:3, :3] = second_moments(inertia_matrix(link))
        matrix[:3, 3] = matrix[3, :3] = link[1:4]
        matrix[3, 3] = link[0]
        smallest = float(np.linalg.eigvalsh(matrix)[0])
        if smallest < -ROUNDING * float(np.abs(matrix).max()):
            raise InputError(
                f"physical consistency: link {joint.link_name} came out with pseudo-inertia {smallest:.3g}"
            )


ROUNDING = 1e-9
"""Negative eigenvalue of a pseudo-inertia, relative to its largest entry, that counts as zero."""


def nearest_physical(
    model: DynamicsModel, theta_b: Array, covariance: Array, options: PhysicalOptions | None = None
) -> Physical:
    """The physical base parameters nearest to an estimate, in units of its standard deviations (Mahalanobis)."""
    options = replace(options or PhysicalOptions(), pull=SETTLING)
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-30))
    correlation = covariance / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
    whitened = np.linalg.inv(np.linalg.cholesky(correlation)) / scale
    return physically_consistent(
        model, whitened[:, None, :], (whitened @ theta_b)[:, None], np.ones((len(scale), 1)), options, 1.0
    )


def _link_constraints(
    cp: Any, model: DynamicsModel, x: Any, link: int, options: PhysicalOptions
) -> list[Any]:
    """Pseudo-inertia above its bound; a link that the chain assumes massless has none."""
    start = PARAMETERS_PER_LINK * link
    span: Array = model.chain.parameter_span
    constraints: list[Any] = []
    if np.any(span[start + 10]):
        constraints.append(x[start + 10] >= options.smallest_drive)
    if not np.any(span[start]):
        return constraints
    m, hx, hy, hz, ixx, ixy, iyy, ixz, iyz, izz = (x[start + k] for k in range(10))
    half = 0.5 * (ixx + iyy + izz)
    # metres to tenths: entries of one size, which the solver likes
    t = 10.0
    matrix = cp.bmat(
        [
            [t * t * (half - ixx), -t * t * ixy, -t * t * ixz, t * hx],
            [-t * t * ixy, t * t * (half - iyy), -t * t * iyz, t * hy],
            [-t * t * ixz, -t * t * iyz, t * t * (half - izz), t * hz],
            [t * hx, t * hy, t * hz, m],
        ]
    )
    held = [k for k in range(4) if not _vanishes(span, start, k)]
    block = matrix[held, :][:, held] if len(held) < 4 else matrix
    return [*constraints, block >> options.smallest * np.eye(len(held))]


def _vanishes(span: Array, start: int, k: int) -> bool:
    """Whether the assumptions leave the k-th row of a pseudo-inertia zero (a planar link has no extent along z)."""
    mass, moments = start, (start + 1, start + 2, start + 3)
    if k == 3:
        return not np.any(span[mass])
    inertia = span[[start + 4, start + 6, start + 9]]
    own = 0.5 * inertia.sum(axis=0) - inertia[k]
    return not np.any(span[moments[k]]) and not np.any(np.abs(own) > 1e-12)


def _cvxpy() -> Any:
    try:
        import cvxpy
    except ImportError as error:
        raise InputError(
            "physical consistency needs cvxpy and clarabel", "pip install 'psdmc[calibrate]'"
        ) from error
    return cvxpy
