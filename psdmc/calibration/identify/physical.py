"""Finds physically consistent parameters: every link's pseudo-inertia is positive definite, and every drive inertia is
positive.

The pseudo-inertia is the 4 x 4 matrix of the integrals of 1, r and r r^T over a link's mass. It is positive if and only
if the link's parameters belong to a distribution of mass (Wensing, Kim, Slotine 2018). Then the mass matrix is positive
definite everywhere, and forward dynamics exist.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.log import Array
from psdmc.dynamics.parameters import inertia_matrix, second_moments
from psdmc.errors import InputError, InternalError
from psdmc.links.pseudo_inertias import PhysicalOptions, known_inner, link_terms, require_cvxpy
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

SETTLING = 1e-6
"""Weight of the distance from the prior's standard parameters (SI, squared), relative to a squared standard deviation:
it determines what theta_b leaves open and changes nothing that theta_b fixes."""


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Lower limits R x >= r on linear combinations of standard parameters x, such as a smallest mass of a link.

    The standard parameters are mass, first moments, inertia and drive inertia of each of n links, 11 per link.

    rows   (k, 11 n) R, one row per limit
    sides  (k,) r, the limits
    names  k names of the limits, for messages
    """

    rows: Array
    sides: Array
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.names)

    def reached(self, x: Array) -> tuple[str, ...]:
        """Return the names of the limits at which the standard parameters x (11 n,) lie: R x equals r up to rounding."""
        if not self.names:
            return ()
        room = self.rows @ x - self.sides
        near = room < REACHED * np.maximum(np.abs(self.rows) @ np.abs(x), np.abs(self.sides))
        return tuple(name for name, is_near in zip(self.names, near.tolist(), strict=True) if is_near)


REACHED = 1e-5
"""Distance from a bound, relative to its terms, below which the solver has stopped there."""
NO_BOUNDS = Bounds(np.zeros((0, 0)), np.zeros(0), ())


class NotPhysical(InputError):
    """This error says that no physically possible parameters were found near an estimate."""


@dataclass(frozen=True, slots=True, eq=False)
class Physical:
    """The physically possible parameters nearest to an estimate.

    x         (11 n,) standard parameters (masses, first moments, inertias, drive inertias of n links)
    values    (l + k,) the corresponding l base parameters theta_b = B x, then k friction values and offsets
    distance  distance of `values` from the estimate, in standard deviations
    """

    x: Array
    values: Array
    distance: float


def nearest_physical(
    model: DynamicsModel,
    values: Array,
    whitening: Array,
    never_negative: NDArray[np.bool_] | None = None,
    options: PhysicalOptions | None = None,
    limits: Array | None = None,
    fixed: NDArray[np.bool_] | None = None,
    bounds: Bounds = NO_BOUNDS,
) -> Physical:
    """Return the physically possible parameters that are nearest to an estimate of base parameters and friction.

    An estimate has l base parameters theta_b, followed by k friction values and offsets.

    values          (l + k,) the estimate
    whitening       (l + k, l + k) W: the cost of a candidate v is |W (v - values)|^2 in variances (Estimate.whitening)
    never_negative  (l + k,) True: this entry of the result may not be negative
    limits          (m, l + k) m further rows; the product of each with the result may not be negative
    fixed           (l + k,) True: this entry keeps its value
    bounds          lower limits on combinations of standard parameters

    For a linear fit, the cost is the increase of the sum of squares, plus the prior in directions that the data do not
    show. Raises InputError if cvxpy is missing, NotPhysical if no solution is found.
    """
    cp: Any = require_cvxpy()
    bounded = np.zeros(len(values), dtype=bool) if never_negative is None else never_negative
    sides = np.zeros((0, len(values))) if limits is None else limits
    held = np.zeros(len(values), dtype=bool) if fixed is None else fixed
    demands = _Demands(bounded, sides, held, bounds)
    for k, share in enumerate(EASED):
        try:
            near = _nearest(cp, model, values, share * whitening, demands, options or PhysicalOptions())
        except NotPhysical:
            if k == len(EASED) - 1:
                raise
        else:
            return replace(near, distance=near.distance / share)
    raise InternalError("no physical estimate was tried")


@dataclass(frozen=True, slots=True, eq=False)
class _Demands:
    """The conditions that the solution must fulfil beside being physical, as in `nearest_physical`."""

    never_negative: NDArray[np.bool_]
    limits: Array
    fixed: NDArray[np.bool_]
    bounds: Bounds


EASED = (1.0, 0.1, 0.01, 1e-3)
"""Shares of the fit's certainty that are tried. Where the fit contradicts every body by ten thousand standard
deviations, no solver can weigh it against a body's shape; with less certainty it can, and the solution hardly
differs."""


def _nearest(
    cp: Any,
    model: DynamicsModel,
    values: Array,
    whitening: Array,
    demands: _Demands,
    options: PhysicalOptions,
) -> Physical:
    """The solution of one attempt; NotPhysical where the solver finds none, or one that is not physical."""
    bounded, limits = demands.never_negative, demands.limits
    l, span = model.l, model.mechanism.parameter_span
    inner = cp.Variable(span.shape[1])
    size = 1.0 / np.linalg.norm(whitening, axis=0)[l:]
    extra = cp.Variable(len(size)) if len(size) else None  # in standard deviations from its estimate
    x = span @ inner
    theta = model.B @ x
    away = theta - values[:l] if extra is None else cp.hstack([theta - values[:l], cp.multiply(size, extra)])
    loss = cp.sum_squares(np.linalg.qr(whitening, mode="r") @ away)
    constraints, divergence = [], 0.0
    for link in range(len(model.mechanism)):
        own, unlike = link_terms(cp, model, x, link, options)
        constraints += own
        divergence += unlike
    if extra is not None and bounded[l:].any():
        held = np.flatnonzero(bounded[l:])
        constraints.append(extra[held] >= -values[l:][held] / size[held])
    if extra is not None and len(limits):
        constraints.append(
            limits[:, :l] @ theta + (limits[:, l:] * size) @ extra >= -limits[:, l:] @ values[l:]
        )
    if len(demands.bounds):
        constraints.append(demands.bounds.rows @ x >= demands.bounds.sides)
    still = np.flatnonzero(demands.fixed)
    constraints += [theta[k] == values[k] for k in still[still < l]]
    constraints += [extra[k - l] == 0 for k in still[still >= l]] if extra is not None else []
    settle = SETTLING * cp.sum_squares(inner - known_inner(model))
    problem = cp.Problem(cp.Minimize(loss + settle + divergence), constraints)
    with warnings.catch_warnings():  # cvxpy warns of reduced accuracy; the result is checked below
        warnings.simplefilter("ignore", UserWarning)
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            raise NotPhysical("physical consistency: clarabel failed") from None
    if inner.value is None:
        within = f" within the {len(demands.bounds)} bounds of [[bodies]]" if len(demands.bounds) else ""
        raise NotPhysical(f"physical consistency: clarabel found no solution{within} ({problem.status})")
    found = np.asarray(span @ inner.value)
    require_physical(model, found)
    rest = np.zeros(0) if extra is None else values[l:] + size * np.asarray(extra.value)
    if bounded[l:].any() and float(rest[bounded[l:]].min()) < -SOLVER_SLACK * float(np.abs(rest).max()):
        raise NotPhysical(f"physical consistency: friction came out at {float(rest[bounded[l:]].min()):.3g}")
    rest = np.where(bounded[l:], np.maximum(rest, 0.0), rest)
    whole = np.concatenate([model.B @ found, rest])
    whole = np.where(demands.fixed, values, whole)
    return Physical(found, whole, float(np.linalg.norm(whitening @ (whole - values))))


def whitening_of(covariance: Array) -> Array:
    """Return the whitening matrix W (m, m) of a covariance matrix (m, m): W^T W is the inverse of the covariance.

    The function inverts the matrix of correlations, because variances of different units differ by many orders.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-30))
    correlation = covariance / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
    return np.asarray(np.linalg.inv(np.linalg.cholesky(correlation)) / scale)


def require_physical(model: DynamicsModel, x: Array) -> None:
    """Raise NotPhysical if the standard parameters x (11 n,) give a link's pseudo-inertia a negative eigenvalue.

    The pseudo-inertia is the 4 x 4 matrix of a link's mass, first and second moments. Small negative values from
    rounding are accepted. This check does not rely on the status that the solver reports.
    """
    for joint, link in zip(model.mechanism.joints, x.reshape(-1, PARAMETERS_PER_LINK), strict=True):
        matrix = np.zeros((4, 4))
        matrix[:3, :3] = second_moments(inertia_matrix(link))
        matrix[:3, 3] = matrix[3, :3] = link[1:4]
        matrix[3, 3] = link[0]
        smallest = float(np.linalg.eigvalsh(matrix)[0])
        if smallest < -ROUNDING * float(np.abs(matrix).max()):
            raise NotPhysical(
                f"physical consistency: link {joint.link_name} came out with pseudo-inertia {smallest:.3g}"
            )


SOLVER_SLACK = 1e-5
"""Share of the largest friction or offset by which the solver may exceed a bound; the bound then counts as kept."""
ROUNDING = 1e-7
"""Negative eigenvalue of a pseudo-inertia, relative to its largest entry, that counts as zero: the solver keeps
constraints to 1e-8. The mass matrix is checked separately."""
