"""Standard inertial parameters of one link (mass, first moments, inertia) about the link's frame. The module states the
conditions that they fulfil for a real body, and applies the assumption that some of them are zero."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETER_NAMES, PARAMETERS_PER_LINK, Array

INERTIA_NAMES = ("xx", "xy", "yy", "xz", "yz", "zz")
"""Order of the six inertia components within the standard parameters."""

LENGTH_ORDER = (0, 1, 1, 1, 2, 2, 2, 2, 2, 2)
"""Exponent of the metre in the unit of each of a body's standard parameters: kg, kg m, kg m^2."""

PRODUCT_NOISE = 1e-15
"""Relative to a link's largest first moment or inertia: smaller entries are rounding of changes of frames."""

PHYSICAL_TOLERANCE = 1e-6
"""Relative violation of a triangle inequality that is accepted, as files round inertias."""


def standard_parameters(mass: float, com: Array, inertia_com: Array) -> Array:
    """Return the standard parameters (10,) m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link frame.

    mass  kg, com (3,) m in the frame, inertia_com (6,) kg m^2 about the centre of mass (INERTIA_NAMES).
    An entry is NaN if it depends on a NaN; zero times an unknown number is zero.
    """
    moment = [_times(mass, r) for r in com]
    _, y, z = com
    xx, yy, zz = (_times(h, r) for h, r in zip(moment, com, strict=True))
    xy, xz, yz = _times(moment[0], y), _times(moment[0], z), _times(moment[1], z)
    shift = np.array([yy + zz, -xy, xx + zz, -xz, -yz, xx + yy])
    return np.concatenate([[mass], moment, np.asarray(inertia_com) + shift])


def about_com(parameters: Array) -> tuple[float, Array, Array]:
    """Return mass (not zero), centre (3,) and inertia about it (6,) from standard parameters."""
    mass = float(parameters[0])
    com = parameters[1:4] / mass if mass else np.zeros(3)
    shift = standard_parameters(mass, com, np.zeros(6))[4:]
    return mass, com, parameters[4:10] - shift


def without_noise(parameters: Array) -> Array:
    """Return the ten standard parameters of a link with entries set to zero that are only rounding errors."""
    clean = np.array(parameters, dtype=float)
    for group in (slice(1, 4), slice(4, 10)):
        size = np.max(np.abs(clean[group]))
        clean[group][np.abs(clean[group]) < PRODUCT_NOISE * size] = 0.0
    return clean + 0.0


def inertia_matrix(six: Array) -> Array:
    """Return the inertia matrix (3, 3) from six components Ixx, Ixy and so on (order of INERTIA_NAMES)."""
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def six_of(matrix: Array) -> Array:
    """Return the components Ixx, Ixy ... (INERTIA_NAMES) of a symmetric matrix (3, 3), of its upper triangle."""
    return matrix[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]


def physical_fault(mass: float, inertia_com: Array) -> str | None:
    """Return a text that says why no real body has this mass (kg) and this inertia (6,) about the centre of mass; None
    if a real body can have them. Unknown values are accepted.

    A real body has a positive mass (or all values are zero), and the principal moments fulfil the triangle inequality.
    This is equivalent to a positive semidefinite pseudo-inertia (Wensing, Kim, Slotine 2018).
    """
    if np.isnan(mass) or np.isnan(inertia_com).any():
        return None
    if mass == 0.0:
        return "inertia without mass" if np.any(inertia_com) else None
    moments = np.linalg.eigvalsh(inertia_matrix(inertia_com))
    small, middle, large = moments
    slack = PHYSICAL_TOLERANCE * max(abs(small), abs(large))
    if small < -slack:
        return f"negative principal moment of inertia {small:.3g} kg m^2"
    if small + middle < large - slack:
        # What is this small beside the largest moment is LAPACK's rounding: its digits differ between processors.
        a, b, c = np.where(np.abs(moments) <= slack, 0.0, moments)
        return f"principal moments break the triangle inequality ({a:.3g} + {b:.3g} < {c:.3g} kg m^2)"
    return None


def _times(a: float, b: float) -> float:
    return 0.0 if a == 0.0 or b == 0.0 else float(a * b)


# Parameters that are assumed zero: which values remain, and which parameter vectors are possible.
#
# A zero about the link frame ("Ixz") removes a parameter. A zero about the centre of mass ("rx", "Ixz@com") does not: the
# frame's Ixz is Ixz@com - m rx rz and can differ from zero while rx and rz do.
#
# The result is the span of all parameter vectors that fulfil the assumption. With the centre of mass r, the parameters
# about the link frame are
#
#     (m, m r, I_com + sum over i, j of m r_i r_j V_ij).
#
# V_ij are constant vectors. The monomials m, m r_i, m r_i r_j and the entries of I_com are linearly independent. So the
# vectors that multiply the remaining monomials span the result.
COM_NAMES = ("rx", "ry", "rz", *(f"I{name}@com" for name in INERTIA_NAMES))
ZERO_NAMES = (*PARAMETER_NAMES, *COM_NAMES)
"""Parameters of one link that may be assumed zero."""


def canonical(names: Collection[str]) -> tuple[str, ...]:
    """Return the names of all parameters of one link that are zero, in a fixed order. They are the parameters `names`,
    which the user assumes zero, and the parameters that are zero as a consequence. Without mass, all parameters of the
    body are zero. A first moment is zero if and only if the same coordinate of the centre of mass is zero."""
    said = set(names)
    if "m" in said:
        said |= set(PARAMETER_NAMES[:BODY_PARAMETERS]) | set(COM_NAMES)
    for axis in "xyz":
        if {f"m{axis}", f"r{axis}"} & said:
            said |= {f"m{axis}", f"r{axis}"}
    return tuple(name for name in ZERO_NAMES if name in said)


def link_span(names: Collection[str]) -> Array:
    """Return a basis (11, k), of k columns, of one link's possible parameters if the parameters `names` are zero. The
    basis is in reduced column echelon form."""
    zero = canonical(names)
    free = [axis for axis in "xyz" if f"r{axis}" not in zero]
    moments = [_unit(f"m{axis}") for axis in free]
    generators = [] if "m" in zero else [_unit("m"), *moments, *_second_moments(free)]
    generators += [_unit(f"I{name}") for name in INERTIA_NAMES if not {"m", f"I{name}@com"} & set(zero)]
    if "Im" not in zero:
        generators.append(_unit("Im"))
    struck = [PARAMETER_NAMES.index(name) for name in PARAMETER_NAMES if name in zero]
    columns = column_echelon(np.array(generators).reshape(-1, PARAMETERS_PER_LINK).T)
    return column_echelon(_vanishing_at(columns, struck))


def link_values(parameters: Array, names: Collection[str]) -> Array:
    """Return the standard parameters (11,) of a link, after the parameters that the user assumes zero are set to zero.

    Coordinates of the centre of mass, and inertias about the centre of mass, are set to zero first. Then the masses,
    first moments and inertias about the origin of the link frame follow.

    names  the parameters that are zero, such as "rx" (centre of mass), "Ixz@com" (about the centre of mass) or "Ixz"
           (about the origin)
    """
    zero = canonical(names)
    values = np.array(parameters, dtype=float)
    if any(name in COM_NAMES for name in zero) and not np.isnan(values[:BODY_PARAMETERS]).any():
        mass, com, inertia = about_com(values)
        for k, axis in enumerate("xyz"):
            com[k] = 0.0 if f"r{axis}" in zero else com[k]
        for k, name in enumerate(INERTIA_NAMES):
            inertia[k] = 0.0 if f"I{name}@com" in zero else inertia[k]
        values[:BODY_PARAMETERS] = standard_parameters(mass, com, inertia)
    possible = np.any(link_span(zero) != 0.0, axis=1)
    return np.where(possible, values, 0.0)


def block_diagonal(blocks: Sequence[Array]) -> Array:
    """Return the block-diagonal matrix (11 n, k) of n blocks with 11 rows each. The blocks have k columns together."""
    span = np.zeros((sum(b.shape[0] for b in blocks), sum(b.shape[1] for b in blocks)))
    row = column = 0
    for block in blocks:
        span[row : row + block.shape[0], column : column + block.shape[1]] = block
        row, column = row + block.shape[0], column + block.shape[1]
    return span


def parse_statements(
    statements: Iterable[str], link_names: Sequence[str], joint_names: Sequence[str], source: str
) -> tuple[tuple[str, ...], ...]:
    """Return the names of zero parameters per link, from texts such as "link5:rx" or "link5:Ixz@com". A joint's name
    can replace the name of its link.

    Raises InputError with every wrong text and the accepted names.
    """
    found: list[list[str]] = [[] for _ in link_names]
    problems = []
    for statement in statements:
        owner, _, name = statement.rpartition(":")
        index = next((known.index(owner) for known in (link_names, joint_names) if owner in known), None)
        if index is None:
            problems.append(f"'{statement}': no link '{owner}'")
        elif name not in ZERO_NAMES:
            problems.append(f"'{statement}': no parameter '{name}'")
        else:
            found[index].append(name)
    if problems:
        links, names = ", ".join(link_names), ", ".join(ZERO_NAMES)
        raise InputError(
            f"{source}: assume-zero " + "; ".join(problems),
            f"write LINK:NAME, links: {links}; names: {names}",
        )
    return tuple(tuple(names) for names in found)


def column_echelon(columns: Array, tolerance: float = 1e-12) -> Array:
    """Return columns (rows, k) in reduced column echelon form, without columns that depend on the others.

    The entries of links' spans are small integers, so the elimination is exact. `tolerance` only protects a division.
    """
    work = np.array(columns, dtype=float)
    rank = 0
    for row in range(work.shape[0]):
        pivots = np.flatnonzero(np.abs(work[row, rank:]) > tolerance)
        if pivots.size == 0:
            continue
        work[:, [rank, rank + pivots[0]]] = work[:, [rank + pivots[0], rank]]
        work[:, rank] /= work[row, rank]
        others = np.arange(work.shape[1]) != rank
        work[:, others] -= np.outer(work[:, rank], work[row, others])
        rank += 1
    return work[:, :rank] + 0.0


def leading_rows(span: Array) -> NDArray[np.int64]:
    """Return the row of the leading one of each of the k columns of a reduced echelon form, (k,)."""
    leads: NDArray[np.int64] = np.argmax(span != 0.0, axis=0).astype(np.int64)
    return leads


def outside(span: Array, x: Array) -> Array:
    """Return by how much each entry of x differs from a vector in the span of the columns of `span`. The vector has the
    leading entries of x. All differences are zero if x is in the span."""
    missed: Array = np.abs(x - span @ x[leading_rows(span)])
    return missed


def _vanishing_at(columns: Array, rows: Sequence[int]) -> Array:
    """Columns that span the combinations of the given ones whose entries at `rows` are zero."""
    order = [*rows, *(k for k in range(columns.shape[0]) if k not in rows)]
    reordered = column_echelon(columns[order])
    kept = reordered[:, ~np.any(reordered[: len(rows)] != 0.0, axis=0)]
    result = np.zeros_like(kept)
    result[order] = kept
    return result


def _unit(name: str) -> Array:
    vector = np.zeros(PARAMETERS_PER_LINK)
    vector[PARAMETER_NAMES.index(name)] = 1.0
    return vector


def _second_moments(free: Sequence[str]) -> list[Array]:
    """Coefficients of m r_i r_j: on the diagonal the two other moments of inertia, off it minus the product."""
    vectors = []
    for a, b in combinations_with_replacement(free, 2):
        if a == b:
            vectors.append(sum((_unit(f"I{c}{c}") for c in "xyz" if c != a), np.zeros(PARAMETERS_PER_LINK)))
        else:
            vectors.append(-_unit(f"I{a}{b}"))
    return vectors
