"""Applies the assumption that some parameters of a link are zero. Computes which values remain, and which parameter
vectors are possible.

A zero about the link frame ("Ixz") removes a parameter. A zero about the centre of mass ("rx", "Ixz@com") does not: the
frame's Ixz is Ixz@com - m rx rz and can differ from zero while rx and rz do.

The result is the span of all parameter vectors that fulfil the assumption. With the centre of mass r, the parameters
about the link frame are

    (m, m r, I_com + sum over i, j of m r_i r_j V_ij).

V_ij are constant vectors. The monomials m, m r_i, m r_i r_j and the entries of I_com are linearly independent. So the
vectors that multiply the remaining monomials span the result.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.robot.inertia import INERTIA_NAMES, about_com, standard_parameters
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETER_NAMES, PARAMETERS_PER_LINK, Array

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
    generators = [] if "m" in zero else [_unit("m"), *_moments(zero), *_second_moments(zero)]
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
        index = _index(owner, link_names, joint_names)
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

    The entries in this module are small integers, so the elimination is exact. `tolerance` only protects a division.
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


def _index(owner: str, link_names: Sequence[str], joint_names: Sequence[str]) -> int | None:
    for names in (link_names, joint_names):
        if owner in names:
            return names.index(owner)
    return None


def _unit(name: str) -> Array:
    vector = np.zeros(PARAMETERS_PER_LINK)
    vector[PARAMETER_NAMES.index(name)] = 1.0
    return vector


def _moments(zero: Collection[str]) -> list[Array]:
    return [_unit(f"m{axis}") for axis in "xyz" if f"r{axis}" not in zero]


def _second_moments(zero: Collection[str]) -> list[Array]:
    """Coefficients of m r_i r_j: on the diagonal the two other moments of inertia, off it minus the product."""
    free = [axis for axis in "xyz" if f"r{axis}" not in zero]
    vectors = []
    for a, b in combinations_with_replacement(free, 2):
        if a == b:
            vectors.append(sum((_unit(f"I{c}{c}") for c in "xyz" if c != a), np.zeros(PARAMETERS_PER_LINK)))
        else:
            vectors.append(-_unit(f"I{a}{b}"))
    return vectors
