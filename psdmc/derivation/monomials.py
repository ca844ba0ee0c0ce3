"""Torque terms: monomials, which are products of joint variables, their numbers, and sparse lists of terms.

A monomial is a rate factor (|g|, qdd_j, qd_j^2 or qd_j qd_k) times one function of each joint's q. With s = sin q and c
= cos q, the functions are 1, s, c, s c, c^2 for a revolute joint. For a prismatic joint, they are 1, q, q^2. The
numbers of the functions are the digits of the monomial's code, a number in radix 5. The first joint's digit is the
highest.

A monomial's key is the number of the rate factor times 5^n plus the code. The columns of the matrix E of exponents are
in the order of keys: gravity, acceleration, centrifugal, Coriolis. Within each group, they are ordered by joint (pair),
then by code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.model.expansion import BLOCKS, RowBlocks
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import Array

Integers = NDArray[np.int64]

RADIX = 5
"""Digits of the largest basis."""

DECIMALS = 12
"""Decimal digits of a simple number: products of two lengths given to 0.1 mm have fewer."""

SIMPLE = 2e-13
"""Largest relative change of a number to a simple one. A small coefficient may multiply a large parameter: changed by
the noise of larger coefficients, it would cost digits of the torque."""


@dataclass(frozen=True, slots=True)
class Monomials:
    """The numbering for joints of these types."""

    types: tuple[JointType, ...]

    @property
    def n(self) -> int:
        return len(self.types)

    @property
    def codes(self) -> int:
        """Number of codes, 5^n."""
        return int(RADIX**self.n)

    def weight(self, joint: int) -> int:
        """Return the change of a monomial's code if the digit of this joint, the number of its function of q, increases
        by one."""
        return int(RADIX ** (self.n - 1 - joint))

    def digit(self, codes: Integers, joint: int) -> Integers:
        digits: Integers = (codes // self.weight(joint)) % RADIX
        return digits

    def tensor_codes(self, joints: Sequence[int], sizes: Sequence[int]) -> Integers:
        """Return the codes of the monomials in a flattened array of coefficients with one axis for each of these
        joints.

        The index along an axis is the number of the joint's function of q. `sizes` has the lengths of the axes.
        """
        codes = np.zeros(1, dtype=np.int64)
        for joint, size in zip(joints, sizes, strict=True):
            codes = (codes[:, None] + self.weight(joint) * np.arange(size)).reshape(-1)
        return codes

    def acceleration_rate(self, j: int) -> int:
        return 1 + j

    def velocity_rate(self, j: int, k: int) -> int:
        """Return the number of the factor qd_j qd_k among all products of rates, such as |g|, qdd_j, qd_j^2. j and k
        may be equal."""
        j, k = min(j, k), max(j, k)
        if j == k:
            return 1 + self.n + j
        before = j * (2 * self.n - j - 1) // 2
        return 1 + 2 * self.n + before + k - j - 1

    def rate_exponents(self) -> NDArray[np.uint8]:
        """Return (rates, 2n) the exponents of qd (n) and qdd (n) in each product of rates: |g|, qdd_j, qd_j^2, qd_j
        qd_k."""
        n = self.n
        table = np.zeros((1 + 2 * n + n * (n - 1) // 2, 2 * n), dtype=np.uint8)
        for j in range(n):
            table[self.acceleration_rate(j), n + j] = 1
            for k in range(j, n):
                table[self.velocity_rate(j, k), j] += 1
                table[self.velocity_rate(j, k), k] += 1
        return table

    def exponents(self, keys: Integers) -> NDArray[np.uint8]:
        """Return the matrix E (5n, p) uint8: exponents of the joint variables in p monomials, which are given by their
        keys.

        E has n rows each for q, sin q, cos q, qd and qdd.
        """
        rows = RowBlocks.of(self.n)
        table = np.zeros((BLOCKS * self.n, len(keys)), dtype=np.uint8)
        position = table[rows.position].reshape(-1, self.n, len(keys))
        rates, codes = np.divmod(keys, self.codes)
        for j, joint in enumerate(self.types):
            powers = np.array(joint.basis.exponents, dtype=np.uint8)
            position[:, j] = powers[self.digit(codes, j)].T
        table[rows.rates] = self.rate_exponents()[rates].T
        return table


class Terms(NamedTuple):
    """Torque terms value * monomial * parameter, as four arrays of one length. A monomial is a product of joint
    variables.

    row       index of the joint whose torque has the term, or of the row of another quantity
    monomial  number of the monomial: its code (functions of q) or key (with rates)
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
    return Terms(*map(np.concatenate, zip(*parts, strict=True)))


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


def merged(values: Array, noise: Array) -> Array:
    """Return the numbers with those that differ only by rounding made equal in magnitude. Signs stay.

    The same product of link lengths enters P, the torque coefficients, in several places with different last digits.
    The generated code shares sub-expressions only if coefficients are equal. Each group of numbers becomes the simplest
    number within the rounding error, and no number changes by more than its noise. Numbers are rounded here, before the
    model is compared with Newton-Euler, and nowhere else.

    values  (count,)
    noise   (count,) absolute uncertainty of each value
    """
    if not len(values):
        return values
    order = np.argsort(np.abs(values), kind="stable")
    size, reach = np.abs(values)[order], noise[order]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(size) > reach[1:]]))
    counts = np.diff(np.append(starts, len(size)))
    middle = np.add.reduceat(size, starts) / counts
    least = np.minimum.reduceat(reach, starts)
    # Each number to DECIMALS decimal digits where that moves it by no more than its noise.
    exponent = DECIMALS - 1 - np.floor(np.log10(np.where(middle > 0, middle, 1.0)))
    # An integer below 2^53 divided by a power of ten up to 10^22 is the double nearest to that decimal.
    power = 10.0 ** np.clip(exponent, 0, 22)
    decimal = np.round(middle * power) / power
    shared = np.where(np.abs(decimal - middle) <= np.minimum(least, SIMPLE * middle), decimal, middle)
    candidate = np.repeat(shared, counts)
    accepted = np.where(np.abs(candidate - size) <= reach, candidate, size)
    result = np.empty_like(values)
    result[order] = accepted
    return np.copysign(result, values)
