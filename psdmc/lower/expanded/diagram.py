"""Polynomials as nested Horner forms, in which parts that are equal up to a constant factor are shared. The data
structure is called a diagram.

The method is from PSDM-2021, section 4.1. Each term of a polynomial is a product of powers of variables, such as sin q1
or qd2. A row of the matrix of exponents belongs to one variable. The variables are taken in some order. Terms that
agree in the exponents of all later variables form a group. Each group becomes a node: a small polynomial in the
variable just taken. The coefficients of the node are nodes of the later variables.

The diagram is built from the last (innermost) variable outward, so that the nodes within each group are known. The
group is scaled until its leading coefficient is one, and looked up among the nodes of its variable. Its factor is
passed outward. Decision diagrams with multiplicative edge values are the same thing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.lower.expanded.terms import Terms

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

NOTHING, ONE = 0, 1
"""Node numbers: no child, and the constant one. Others count from 2, innermost row first."""

LEADING_SHARE = 0.323
"""A group is scaled by the highest power whose coefficient is at least this part of its largest: rounding is
magnified by no more than its inverse, and ratios of one half still count as equal. (0.0123 loses two digits
and gains nothing.)"""


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """All m nodes (small polynomials) of one variable in a diagram. The value of a node is the sum over powers k = 0..2
    of ratio[k] * child[k] * variable ** k.

    row    number of the variable, a row of the terms' exponents
    first  number of the first node
    child  (m, 3) int    numbers of nodes that are factors of the coefficients; they belong to variables further in
    ratio  (m, 3) float  constant factors of the coefficients; zero if there is no child; the leading one is 1
    """

    row: int
    first: int
    child: Integers
    ratio: Array


@dataclass(frozen=True, slots=True, eq=False)
class Diagram:
    """All polynomials as nodes, each a small polynomial in one variable. Levels are ordered from the innermost
    variable. Polynomial `output[k]` is factor[k] times node root[k]."""

    levels: tuple[Level, ...]
    output: Integers
    root: Integers
    factor: Array


def nested_horner(terms: Terms, rows: Sequence[int]) -> Diagram:
    """Return all polynomials in `terms` as a Diagram of nested Horner forms.

    rows  the variables (rows of the exponents), outermost first
    """
    if len(terms) == 0:
        return Diagram((), terms.output, np.zeros(0, dtype=np.int64), np.zeros(0))
    order, differs = _sorted(terms, rows)
    constants = Constants()
    coefficient, uncertainty = terms.coefficient[order], terms.uncertainty[order]
    exponents, output = terms.exponents[:, order], terms.output[order]
    node = np.full(len(terms), ONE, dtype=np.int64)
    member = np.arange(len(terms))
    levels: list[Level] = []
    count = 2
    for depth in reversed(range(len(rows))):
        row = rows[depth]
        power = exponents[row][member]
        if not power.any():
            continue
        starts = differs[member] <= depth
        group = np.cumsum(starts) - 1
        parts = _Groups.gather(group, power, node, coefficient, uncertainty)
        level, node = parts.as_level(row, count, constants)
        coefficient, uncertainty = parts.leading()
        member = member[starts]
        if level is not None:
            levels.append(level)
            count += len(level.child)
    factor = constants.merged(coefficient, uncertainty / np.abs(coefficient))
    return Diagram(tuple(levels), output[member], node, factor)


def _sorted(terms: Terms, rows: Sequence[int]) -> tuple[Integers, Integers]:
    """Terms in order of output and rows; and how far out each differs from the one before.

    differs[t]: 0 where the output differs, else 1 + the position in `rows` of the outermost row that does.
    """
    keys = [terms.output, *(terms.exponents[row] for row in rows)]
    order = np.lexsort(keys[::-1])
    differs = np.full(len(terms), len(keys), dtype=np.int64)
    for position in reversed(range(len(keys))):
        key = keys[position][order]
        differs[1:][key[1:] != key[:-1]] = position
    differs[0] = 0
    return order, differs


@dataclass(frozen=True, slots=True, eq=False)
class _Groups:
    """The groups of one row before they are looked up: child, coefficient and uncertainty by power, (g, 3) each."""

    child: Integers
    coefficient: Array
    uncertainty: Array
    lead: Integers

    @staticmethod
    def gather(
        group: Integers, power: NDArray[np.uint8], node: Integers, coefficient: Array, uncertainty: Array
    ) -> _Groups:
        shape = (int(group[-1]) + 1, 3)
        child = np.full(shape, NOTHING, dtype=np.int64)
        values, doubts = np.zeros(shape), np.zeros(shape)
        child[group, power], values[group, power], doubts[group, power] = node, coefficient, uncertainty
        large = np.abs(values) >= LEADING_SHARE * np.abs(values).max(axis=1, keepdims=True)
        lead = 2 - np.argmax(large[:, ::-1], axis=1)
        return _Groups(child, values, doubts, lead)

    def leading(self) -> tuple[Array, Array]:
        """Each group's factor and its uncertainty."""
        index = np.arange(len(self.lead))
        return self.coefficient[index, self.lead], self.uncertainty[index, self.lead]

    def as_level(self, row: int, first: int, constants: Constants) -> tuple[Level | None, Integers]:
        """Return the new nodes of this variable, or None, and the node number of each group of terms. A group whose
        terms do not contain the variable is already a node of another variable."""
        node = self.child[:, 0].copy()
        contains: NDArray[np.bool_] = np.asarray(self.child[:, 1:].any(axis=1))
        if not contains.any():
            return None, node
        child = self.child[contains]
        table = np.concatenate([child.astype(np.float64), self._ratios(contains, constants)], axis=1)
        unique, inverse = np.unique(table, axis=0, return_inverse=True)
        node[contains] = first + inverse.ravel()
        return Level(row, first, unique[:, :3].astype(np.int64), unique[:, 3:]), node

    def _ratios(self, contains: NDArray[np.bool_], constants: Constants) -> Array:
        factor, doubt = (values[contains, None] for values in self.leading())
        value, uncertainty = self.coefficient[contains], self.uncertainty[contains]
        present = value != 0.0
        ratio = value / factor
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = uncertainty / np.abs(value) + doubt / np.abs(factor)
        relative[np.arange(len(value)), self.lead[contains]] = 0.0
        ratio[present] = constants.merged(ratio[present], relative[present])
        return ratio


def with_constants(diagram: Diagram, values: Mapping[int, float]) -> Diagram:
    """Return the diagram with constants in place of its innermost variables. Nodes of these variables become constant
    factors of the nodes around them.

    values  by row, the variable's value

    Raises ValueError if `values` has a number for a variable, but not for all variables further in.
    """
    inner = [level for level in diagram.levels if level.row in values]
    outer = diagram.levels[len(inner) :]
    if any(level.row in values for level in outer):
        raise ValueError("only the innermost rows can become constants")
    number = np.array([0.0, 1.0])
    for level in inner:
        powers = values[level.row] ** np.arange(3)
        sums = np.sum(number[level.child] * level.ratio * powers, axis=1)
        number = np.concatenate([number, sums])
    levels: list[Level] = []
    for level in outer:
        child, ratio = _numbers_as_factors(level.child, level.ratio, number)
        levels.append(Level(level.row, level.first, child, ratio))
    root, factor = _numbers_as_factors(diagram.root, diagram.factor, number)
    return Diagram(tuple(levels), diagram.output, root, factor)


def _numbers_as_factors(node: Integers, ratio: Array, number: Array) -> tuple[Integers, Array]:
    """Node and ratio arrays in which references to nodes that are numbers have become references to ONE, or to NOTHING
    where the number is zero."""
    is_number = node < len(number)
    value = np.where(is_number, number[np.where(is_number, node, ONE)], 1.0) * ratio
    return np.where(is_number, np.where(value == 0.0, NOTHING, ONE), node), value


def operations(diagram: Diagram) -> tuple[int, int]:
    """Return the number of multiplications and the number of additions that an evaluation of the diagram takes. Squares
    of variables are computed once."""
    multiplications, additions = 0, 0
    for level in diagram.levels:
        present = level.child != NOTHING
        additions += int(present.sum() - len(level.child))
        multiplications += _products_with_constants(level) + _products_with_row(level)
    scaled = np.abs(diagram.factor) != 1.0
    scaled &= diagram.root != ONE
    pairs = np.stack([diagram.root[scaled], np.abs(diagram.factor[scaled])], axis=1)
    return multiplications + len(np.unique(pairs, axis=0)), additions


def _products_with_constants(level: Level) -> int:
    """How many distinct products constant * child a level takes; the sign makes no difference."""
    scaled = (level.child > ONE) & (np.abs(level.ratio) != 1.0)
    pairs = np.stack([level.child[scaled], np.abs(level.ratio[scaled])], axis=1)
    return len(np.unique(pairs, axis=0))


def _products_with_row(level: Level) -> int:
    square, linear = level.child[:, 2] != NOTHING, level.child[:, 1] != NOTHING
    highest = np.where(square, 2, 1)
    index = np.arange(len(highest))
    is_row_itself = (level.child[index, highest] == ONE) & (np.abs(level.ratio[index, highest]) == 1.0)
    products = np.where(square & linear, 2, 1) - is_row_itself
    return int(products.sum()) + int((square & ~linear).any())


EXACT = (0.5, 1.0, 2.0)
"""Constants that are likely: a coefficient that may equal one of them becomes it."""

SMALLEST_UNCERTAINTY = 1e-15


class Constants:
    """A growing table of positive numbers. `merged` replaces each value by a number of the table that is equal within
    the uncertainty. Equal values then have equal bits.

    The most certain values are entered first and replace less certain ones near them. No value changes by more than the
    sum of two uncertainties, that of the value and that of the number in the table. No uncertain value joins two
    certain ones.
    """

    def __init__(self) -> None:
        self._entries: Array = np.array(EXACT)
        self._uncertainty: Array = np.full(len(EXACT), SMALLEST_UNCERTAINTY)

    def merged(self, values: Array, uncertainty: Array) -> Array:
        """Return, for each of k values, the number of the table that replaces it, with the value's sign. `uncertainty`
        is relative."""
        out = np.abs(values)
        uncertainty = np.maximum(uncertainty, SMALLEST_UNCERTAINTY)
        decade = np.floor(np.log10(uncertainty)).astype(int)
        for present in np.unique(decade):
            chosen = np.flatnonzero(decade == present)
            out[chosen] = self._looked_up(out[chosen], uncertainty[chosen])
        return np.copysign(out, values)

    def _looked_up(self, values: Array, uncertainty: Array) -> Array:
        """The nearest entries for values of about equal uncertainty; values that are near no entry become entries."""
        nearest = self._nearest(values)
        tolerance = (uncertainty + self._uncertainty[nearest]) * values
        known = np.abs(self._entries[nearest] - values) <= tolerance
        known &= self._uncertainty[nearest] <= 10.0 * uncertainty
        out = np.where(known, self._entries[nearest], values)
        if not known.all():
            unknown = np.flatnonzero(~known)
            out[unknown] = self._entered(values[unknown], uncertainty[unknown])
        return out

    def _nearest(self, values: Array) -> NDArray[np.int64]:
        right = np.clip(np.searchsorted(self._entries, values), 1, len(self._entries) - 1)
        is_left = values - self._entries[right - 1] < self._entries[right] - values
        return right - is_left

    def _entered(self, values: Array, uncertainty: Array) -> Array:
        """New entries for runs of neighbours: the value that is most certain, of equally certain ones the smallest. A
        value that this would move too far, as its run is long or the next value's doubt as large as that value, is in
        a run of its own."""
        order = np.lexsort((uncertainty, values))
        ordered, doubt = values[order], uncertainty[order]
        gap = np.diff(ordered) > (doubt[1:] + doubt[:-1]) * ordered[1:]
        run = np.concatenate([[0], np.cumsum(gap)])
        by_certainty = np.lexsort((ordered, doubt, run))
        first = by_certainty[np.searchsorted(run[by_certainty], np.arange(run[-1] + 1))]
        entries = ordered[first]
        self._insert(entries, doubt[first])
        too_far = np.abs(entries[run] - ordered) > (doubt + doubt[first][run]) * ordered
        out = np.empty_like(values)
        out[order] = entries[run]
        left = order[too_far]
        if len(left):
            out[left] = self._entered(values[left], uncertainty[left])
        return out

    def _insert(self, entries: Array, uncertainty: Array) -> None:
        joined = np.concatenate([self._entries, entries])
        order = np.argsort(joined, kind="stable")
        self._entries = joined[order]
        self._uncertainty = np.concatenate([self._uncertainty, uncertainty])[order]
