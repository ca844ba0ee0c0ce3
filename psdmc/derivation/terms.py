"""Sparse lists of torque terms. A term has a monomial, a parameter, the joint whose torque it belongs to, and a factor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class Terms(NamedTuple):
    """Torque terms value * monomial * parameter, as four arrays of one length. A monomial is a product of joint
    variables.

    row       index of the joint whose torque has the term, or of the row of another quantity
    monomial  number of the monomial: its code (functions of q) or key (with rates), see monomials.py
    column    index of the parameter
    value     factor
    """

    row: Integers
    monomial: Integers
    column: Integers
    value: Array


def joined(parts: Sequence[Terms]) -> Terms:
    """All terms one after the other."""
    if not parts:
        none = np.zeros(0, dtype=np.int64)
        return Terms(none, none, none, np.zeros(0))
    return Terms(
        np.concatenate([part.row for part in parts]),
        np.concatenate([part.monomial for part in parts]),
        np.concatenate([part.column for part in parts]),
        np.concatenate([part.value for part in parts]),
    )


def selected(terms: Terms, chosen: NDArray[np.bool_] | Integers) -> Terms:
    """Return some of the torque terms, chosen by a boolean mask or by a list of indices."""
    row, monomial, column, value = terms
    return Terms(row[chosen], monomial[chosen], column[chosen], value[chosen])


def summed(terms: Terms, tolerance: float) -> Terms:
    """Return the terms sorted by row, monomial and column, with the values of equal positions added.

    Sums whose magnitude is at most `tolerance` are left out.
    """
    if not len(terms.value):
        return terms
    columns = int(terms.column.max()) + 1
    monomials = int(terms.monomial.max()) + 1
    key = (terms.row * monomials + terms.monomial) * columns + terms.column
    order = np.argsort(key, kind="stable")
    key = key[order]
    starts = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    values = np.add.reduceat(terms.value[order], starts)
    kept = np.abs(values) > tolerance
    rest, column = np.divmod(key[starts[kept]], columns)
    row, monomial = np.divmod(rest, monomials)
    return Terms(row, monomial, column, values[kept])


def times_matrix(terms: Terms, matrix: Array, tolerance: float) -> Terms:
    """Return torque terms in new parameters, of which the old parameters are linear combinations.

    matrix     (old, new) factors of the new parameters in each old parameter
    tolerance  largest magnitude of a coefficient that counts as zero
    """
    right = sparse.csr_array(matrix)
    counts = np.diff(right.indptr)[terms.column]
    source = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(source)) - np.repeat(np.cumsum(counts) - counts, counts)
    place = right.indptr[terms.column][source] + within
    spread = Terms(
        terms.row[source],
        terms.monomial[source],
        right.indices[place].astype(np.int64),
        terms.value[source] * right.data[place],
    )
    return summed(spread, tolerance)


def restricted(terms: Terms, columns: Integers) -> Terms:
    """Return the terms of the given columns only, renumbered in the order given."""
    number = np.full(int(max(terms.column.max(initial=0), columns.max(initial=0))) + 1, -1)
    number[columns] = np.arange(len(columns))
    place = number[terms.column]
    return selected(terms._replace(column=place), place >= 0)
