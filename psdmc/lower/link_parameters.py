"""A link's parameters in pseudo-inertia form: names, units, costs, and conversions from and to standard parameters.
This form has the integrals of xx, yy and zz over the mass in place of moments of inertia.

The torques are linear in these parameters. Parameters with independent regressor columns can be carriers: link parameters
that represent all others in generated code. Columns that double precision cannot distinguish are treated in extended
precision.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.coordinates import first_rates, has_mimic_joints, neutral, normalized
from psdmc.dynamics.parameters import joint_frame_map
from psdmc.dynamics.regressor import regressor, torque_rows
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.spatial import Body
from psdmc.lower.carriers import EFFECT, Careful, CarrierSpace, Long, Tableau, lightest
from psdmc.lower.reframe import Reframed
from psdmc.reproducible import combined, lengths, times
from psdmc.robot.graded import graded_pivots, halving_shares
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK, Array, Placement

PSEUDO_NAMES = ("m", "hx", "hy", "hz", "xx", "yy", "zz", "xy", "xz", "yz", "Im")
"""A link's parameters in pseudo-inertia form, in the order of carriers."""

LENGTH_ORDER = (0, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2)
"""Exponent of the metre in the unit of each parameter. The drive inertia of a sliding joint is kg and is treated apart."""

WEIGHTS = {
    "m": 6.0,
    "hx": 10.0,
    "hy": 10.1,
    "hz": 10.2,
    "xx": 4.0,
    "yy": 4.1,
    "zz": 4.2,
    "xy": 6.0,
    "xz": 6.1,
    "yz": 6.2,
    "Im": 1.0,
}
"""Operations that a parameter adds to Newton-Euler, roughly. Weights of the search's start."""


def pseudo_map() -> Array:
    """Return the (11, 11) matrix that converts a link's standard parameters to pseudo-inertia form, about an unchanged
    frame. In this form, the integrals of xx, yy and zz over the mass replace the moments of inertia."""
    matrix = np.zeros((11, 11))
    matrix[:4, :4] = np.eye(4)
    for row, inertia in enumerate((4, 6, 9), start=4):
        matrix[row, [4, 6, 9]] = 0.5
        matrix[row, inertia] -= 1.0
    for row, off_diagonal in ((7, 5), (8, 7), (9, 8)):
        matrix[row, off_diagonal] = -1.0
    matrix[10, 10] = 1.0
    return matrix


def link_map(place: Placement) -> Array:
    """Return the (11, 11) matrix that converts a link's standard parameters about the link frame to pseudo-inertia form
    about the joint frame. This form has integrals of xx, yy, zz in place of moments of inertia."""
    matrix = np.zeros((11, 11))
    matrix[:BODY_PARAMETERS, :BODY_PARAMETERS] = joint_frame_map(place)
    matrix[10, 10] = 1.0
    return np.asarray(times(pseudo_map(), matrix))


def bodies_from_carriers(
    n: int, carriers: Sequence[int], values: Sequence[Scalar], unit: float
) -> tuple[tuple[Body, ...], tuple[Scalar, ...]]:
    """Return the bodies and drive inertias of n links if the carriers (nonzero link parameters) have these values and
    all other parameters are zero.

    unit  m, the unit of all lengths in the result
    """
    rows: list[list[Scalar]] = [[0.0] * PARAMETERS_PER_LINK for _ in range(n)]
    powers = (2, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0)
    for carrier, value in zip(carriers, values, strict=True):
        link, name = divmod(carrier, PARAMETERS_PER_LINK)
        rows[link][name] = value * unit ** powers[name] if unit != 1.0 else value
    bodies = tuple(
        Body(row[0], (row[1], row[2], row[3]), (row[4], row[5], row[6], row[7], row[8], row[9]))
        for row in rows
    )
    return bodies, tuple(row[10] for row in rows)


# Regressor columns of the parameters, from which carriers are chosen


FAIR_GROWTH = 1e3
"""Largest ratio of the carriers' values to theta_b, lengths in the chain's unit. Where it is exceeded the carriers are
chosen more carefully: nearly parallel axes make columns that are small or nearly equal, and differences of large
values lose digits in double."""

MISS = 1e-13
"""Largest part of a column of the model that carriers may leave unexplained, as a share of the longest column. Rounding
leaves 1e-15; where more is left, the rank of the columns was decided wrongly."""

RANK = 1e-12
"""Smallest part that makes a column independent, as a share of the longest one, all columns brought to the same length.
See MISS."""

SAMPLED_JOINTS = 10
"""Robots with more joints are not sampled as a whole, unless joints follow others: what their summed torques depend on is
not found joint by joint."""

STATES, ROWS = 48, 2
"""Most states of the samples, and rows per column from which on a larger robot takes no more of them."""
SEED = 20211


def carrier_space(reframed: Reframed, representative: Array) -> CarrierSpace:
    """Return the possible sets of carriers of a model: link parameters that represent all others in generated code.

    representative  matrix from theta_b to standard parameters about the link frames
    """
    n = len(reframed.frames)
    is_sampled = n <= SAMPLED_JOINTS or has_mimic_joints(reframed.frames)
    samples = _sampled_columns(reframed) if is_sampled else _torque_rows(reframed)
    lift = _lifted(reframed, representative)
    unused_drives = [
        j for j in range(DRIVE, PARAMETERS_PER_LINK * n, PARAMETERS_PER_LINK) if not np.any(lift[j])
    ]
    samples[:, unused_drives] = 0.0
    columns = samples.astype(np.float64)
    scale = np.linalg.norm(columns, axis=0)
    scale[scale < 1e-12 * np.max(scale)] = 1.0
    compact = _in_their_span(columns / scale) * scale
    rank = len(compact)
    compact[:, np.linalg.norm(columns, axis=0) < 1e-12 * np.max(scale)] = 0.0
    basis = lightest(compact, [1.0] * compact.shape[1])
    target = _combined(samples, lift)
    whole = np.linalg.norm(target.astype(np.float64), axis=0)
    both = np.hstack([samples, target])
    space = CarrierSpace(compact, Tableau.of(both, basis), whole)
    units = _units(reframed, representative)
    if rank >= len(whole) and _is_fair(space, samples, target, units):
        return space
    return _careful_space(samples, target, units[0])


def every_parameter(reframed: Reframed, representative: Array) -> tuple[tuple[int, ...], Array]:
    """Return the indices of all link parameters that theta_b contains, and the (count, l) matrix from theta_b to their
    values.

    If code uses all of these parameters, no parameter represents another one, and small values keep their digits.
    """
    lift = _lifted(reframed, representative).astype(np.float64)
    reached = np.flatnonzero(lift.any(axis=1))
    return tuple(reached.tolist()), lift[reached]


def _lifted(reframed: Reframed, representative: Array) -> Long:
    """(11 n, l) theta_b to link parameters in pseudo-inertia form about the re-framed joint frames."""
    lift = np.zeros((PARAMETERS_PER_LINK * len(reframed.frames), representative.shape[1]), np.longdouble)
    for k, place in enumerate(reframed.link_frames):
        rows = slice(PARAMETERS_PER_LINK * k, PARAMETERS_PER_LINK * (k + 1))
        filled = np.flatnonzero(representative[rows].any(axis=0))
        lift[rows, filled] = times(link_map(place).astype(np.longdouble), representative[rows, filled])
    return lift


def _in_their_span(columns: Array) -> Array:
    """(rank, k) coordinates of k columns in an orthonormal basis of their span, by Householder's reflections with
    column pivots. Columns of which less than RANK is left beside the others count as dependent.

    Not LAPACK's: it shares such small matrices among all cores, which takes longer than one core needs.
    """
    rest, order = columns.copy(), np.arange(columns.shape[1])
    rank, least = 0, 0.0
    for j in range(min(columns.shape)):
        remaining = lengths(rest[j:, j:])
        pivot = j + int(np.argmax(remaining))
        left = remaining[pivot - j]
        least = least or RANK * left
        if left <= least:
            break
        rest[:, [j, pivot]], order[[j, pivot]] = rest[:, [pivot, j]], order[[pivot, j]]
        normal = rest[j:, j].copy()
        normal[0] += math.copysign(left, normal[0])
        along = combined(normal, rest[j:, j:]) * (2.0 / times(normal, normal))
        rest[j:, j:] -= normal[:, None] * along
        rank = j + 1
    coordinates = np.zeros((rank, len(order)))
    coordinates[:, order] = np.triu(rest[:rank])
    return coordinates


def _combined(columns: Long, weights: Long) -> Long:
    """columns @ weights, added column by column, as few weights are not zero."""
    total = np.zeros((len(columns), weights.shape[1]), columns.dtype)
    for row, column in zip(*np.nonzero(weights), strict=True):
        total[:, column] += columns[:, row] * weights[row, column]
    return total


def _careful_space(samples: Long, target: Long, units: Array) -> CarrierSpace:
    """The space with rank decided in extended precision, on columns in a common unit."""
    count = len(units)
    work = np.hstack([samples * units, target])
    longest = lengths(work[:, :count]).max()
    work /= longest
    limits = np.where(np.arange(work.shape[1]) < count, 1.0, np.inf)
    chosen, _, _ = graded_pivots(work, limits, halving_shares(EFFECT))
    rows = work[: len(chosen)] * longest
    rows[:, :count] /= units
    careful = Careful(rows, units)
    tableau = Tableau.of(rows, careful.lightest([1.0] * count))
    whole = lengths(rows[:, count:]).astype(np.float64)
    return CarrierSpace(rows[:, :count].astype(np.float64), tableau, whole, careful)


def _is_fair(space: CarrierSpace, samples: Long, target: Long, units: tuple[Array, Array]) -> bool:
    """Whether the first choice of carriers gives the model's columns with values that are no large multiples of theta_b
    in the chain's unit."""
    start = list(space.lightest([WEIGHTS[PSEUDO_NAMES[j % PARAMETERS_PER_LINK]] for j in range(space.count)]))
    transfer = space.transfer(start)
    missed = np.abs(_combined(samples[:, start], transfer) - target).max(initial=0.0)
    carriers, parameters = units
    growth = np.abs(transfer * parameters / carriers[start, None]).max(initial=0.0)
    return bool(growth <= FAIR_GROWTH and missed <= MISS * space.whole.max(initial=0.0))


def _units(reframed: Reframed, representative: Array) -> tuple[Array, Array]:
    """One unit of each carrier and of each base parameter in SI, for a unit of length near the chain's size."""
    longest = max(
        math.hypot(*translation)
        for frame, place in zip(reframed.frames, reframed.link_frames, strict=True)
        for translation in (frame.translation, place.translation.tolist())
    )
    unit = 2.0 ** round(math.log2(longest)) if longest > 0 else 1.0
    leads = np.argmax(representative != 0.0, axis=0) % PARAMETERS_PER_LINK
    carriers = np.tile(unit ** np.array(LENGTH_ORDER, dtype=np.float64), len(reframed.frames))
    return carriers, unit ** np.array(LENGTH_ORDER, dtype=np.float64)[leads]


def _torque_rows(reframed: Reframed) -> Long:
    """Compute (r, 11 n) rows that the torques depend on, in pseudo-inertia form, in extended precision. They only serve
    the rank; samples of all joints have thousands of rows."""
    here = [Placement.identity()] * len(reframed.frames)
    rows = torque_rows(reframed.frames, here, reframed.base_acceleration)
    back = np.round(np.linalg.inv(pseudo_map()))  # zeros and ones
    return np.asarray(times(rows.reshape(-1, PARAMETERS_PER_LINK), back).reshape(rows.shape))


def _sampled_columns(reframed: Reframed) -> Long:
    """(states nv, 11 n) regressor in pseudo-inertia form at fixed random states, in extended precision."""
    n, nv = len(reframed.frames), first_rates(reframed.frames)[-1]
    enough = -(-ROWS * PARAMETERS_PER_LINK * n // nv)
    states = STATES if n <= SAMPLED_JOINTS else min(STATES, enough)
    nq = len(neutral(reframed.frames))
    drawn = np.random.default_rng(SEED).uniform(-2.0, 2.0, size=(nq + 2 * nv, states)).astype(np.longdouble)
    q, qd, qdd = normalized(reframed.frames, drawn[:nq]), drawn[nq : nq + nv], drawn[nq + nv :]
    here = [Placement.identity()] * n
    rows = regressor(
        reframed.frames, here, range(11 * n), list(q), list(qd), list(qdd), reframed.base_acceleration
    )
    standard = np.zeros((nv, states, 11 * n), np.longdouble)
    for i, row in enumerate(rows):
        for column, value in row.items():
            standard[i, :, column] = value
    back = np.round(np.linalg.inv(pseudo_map()))  # zeros and ones
    return _combined(standard.reshape(-1, PARAMETERS_PER_LINK), back).reshape(nv * states, -1)
