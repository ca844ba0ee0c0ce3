"""Rewrites torque terms of mimic joints, as in parallelograms, in the variables of their leaders.

A mimic joint's angle is a sum of leaders' angles with whole ratios, so its sine and cosine are sums of products of theirs.
In exponentials, with f q for each frequency f of a leader's angle q, such products are sums of frequencies. The terms of
a parallelogram then cancel exactly where they must, and frequencies up to two remain: the functions 1, s, c, s c, c^2.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from scipy import sparse

from psdmc.derivation.memory import UNEXPANDED
from psdmc.derivation.monomials import Integers, Monomials, Terms, times_matrix
from psdmc.dynamics.frames import Frame
from psdmc.errors import DerivationError
from psdmc.reproducible import cosine, sine
from psdmc.robot.joints.basis import TRIGONOMETRIC
from psdmc.robot.mechanism import Array

WAVES: tuple[dict[int, complex], ...] = (
    {0: 1.0},
    {-1: 0.5j, 1: -0.5j},
    {-1: 0.5, 1: 0.5},
    {-2: 0.25j, 2: -0.25j},
    {-2: 0.25, 0: 0.5, 2: 0.25},
)
"""1, s, c, s c and c^2 as sums of exp(i f q), by the frequency f."""

FUNCTIONS: dict[int, dict[int, complex]] = {
    0: {0: 1.0},
    1: {2: 1.0, 1: 1.0j},
    -1: {2: 1.0, 1: -1.0j},
    2: {4: 2.0, 0: -1.0, 3: 2.0j},
    -2: {4: 2.0, 0: -1.0, 3: -2.0j},
}
"""exp(i f q), by the frequency f, as a sum of the functions 1, s, c, s c and c^2, by their numbers."""

Sum = dict[tuple[int, ...], complex]
"""Factors by frequencies of the leaders' angles; of a sliding leader, by the power of its position."""


def coupled(
    terms: Terms, frames: Sequence[Frame], monomials: Monomials, zero: float
) -> tuple[Terms, Monomials]:
    """Return the terms of the torques of all joints as terms of the leaders' torques, in the leaders' variables, and the
    numbering of these.

    Sums whose magnitude is at most `zero` are left out. Raises DerivationError if a mimic joint's ratio is no whole number,
    or if a leader's sine and cosine occur with higher powers than two.
    """
    leaders = [i for i, frame in enumerate(frames) if frame.mimic is None]
    number = {i: k for k, i in enumerate(leaders)}
    shares = np.zeros((len(frames), len(leaders)))
    for i, frame in enumerate(frames):
        own = ((i, 1.0),) if frame.mimic is None else frame.mimic.shares
        for leader, ratio in own:
            shares[i, number[leader]] += ratio
    target = Monomials(tuple(monomials.types[i] for i in leaders))
    rates, codes = np.divmod(terms.monomial, monomials.codes)
    distinct, place = np.unique(codes, return_inverse=True)
    count = int(terms.column.max(initial=0)) + 1
    found = times_matrix(Terms(rates, place * count + terms.column, terms.row, terms.value), shares, 0.0)
    found = times_matrix(
        Terms(found.column, found.monomial, found.row, found.value), _rates(shares, monomials, target), 0.0
    )
    place, column = np.divmod(found.monomial, count)
    waves, matrix = _waves(distinct, frames, shares, monomials)
    found = times_matrix(Terms(found.row, found.column * count + column, place, found.value), matrix, zero)
    digits = _functions(waves, np.unique(found.column), target)
    found = times_matrix(found, digits, zero)
    rates, column = np.divmod(found.monomial, count)
    return Terms(found.row, rates * target.codes + found.column, column, found.value.real), target


def _rates(shares: Array, monomials: Monomials, target: Monomials) -> Array:
    """Products of all joints' rates as sums of products of the leaders' rates: |g|, qdd_j, qd_j qd_k."""
    n, own = monomials.n, target.n
    found = np.zeros((len(monomials.rate_exponents()), len(target.rate_exponents())))
    found[0, 0] = 1.0
    for j in range(n):
        for a in range(own):
            found[monomials.acceleration_rate(j), target.acceleration_rate(a)] = shares[j, a]
        for k, a, b in itertools.product(range(j, n), range(own), range(own)):
            found[monomials.velocity_rate(j, k), target.velocity_rate(a, b)] += shares[j, a] * shares[k, b]
    return found


def _waves(
    codes: Integers, frames: Sequence[Frame], shares: Array, monomials: Monomials
) -> tuple[list[tuple[int, ...]], sparse.csr_array]:
    """The frequencies of all waves, and a matrix of factors of each in the functions with these codes."""
    digits = [monomials.digit(codes, j).tolist() for j in range(monomials.n)]
    one: Sum = {(0,) * shares.shape[1]: 1.0}
    of_joint = [
        {digit: _of_joint(j, digit, frames, shares, monomials) for digit in {*digits[j]}}
        for j in range(monomials.n)
    ]
    numbers: dict[tuple[int, ...], int] = {}
    entries: list[tuple[int, int, complex]] = []
    for row, own in enumerate(zip(*digits, strict=True)):
        found = one
        for j, digit in enumerate(own):
            found = _product(found, of_joint[j][digit]) if digit else found
        entries += [(row, numbers.setdefault(wave, len(numbers)), value) for wave, value in found.items()]
    rows, columns, values = (np.array(part) for part in zip(*entries, strict=True))
    return list(numbers), sparse.csr_array((values, (rows, columns)), shape=(len(codes), len(numbers)))


def _product(a: Sum, b: Sum) -> Sum:
    found: Sum = {}
    for (first, x), (second, y) in itertools.product(a.items(), b.items()):
        wave = tuple(map(sum, zip(first, second, strict=True)))
        found[wave] = found.get(wave, 0.0) + x * y
    return found


def _of_joint(j: int, digit: int, frames: Sequence[Frame], shares: Array, monomials: Monomials) -> Sum:
    """One function of joint j's position, in the leaders' variables."""
    mimic, own = frames[j].mimic, shares[j].tolist()
    offset = 0.0 if mimic is None else float(mimic.offset)
    leaders = (j,) if mimic is None else mimic.leaders
    none = (0,) * len(own)
    if any(monomials.types[k].basis is not monomials.types[j].basis for k in leaders):
        raise DerivationError("E and P: an angle follows a sliding joint", UNEXPANDED)
    if monomials.types[j].basis is TRIGONOMETRIC:
        if any(ratio != round(ratio) for ratio in own):
            raise DerivationError(
                f"E and P: a joint follows with the ratio {max(own, key=abs):g}, no whole number", UNEXPANDED
            )
        return {
            tuple(round(f * ratio) for ratio in own): value * complex(cosine(f * offset), sine(f * offset))
            for f, value in WAVES[digit].items()
        }
    line: Sum = {none: offset} if offset else {}
    for k in np.flatnonzero(own).tolist():
        line[tuple(int(i == k) for i in range(len(own)))] = own[k]
    found: Sum = {none: 1.0}
    for _ in range(digit):
        found = _product(found, line)
    return found


def _functions(waves: Sequence[tuple[int, ...]], used: Integers, target: Monomials) -> sparse.csr_array:
    """A matrix from waves to codes of functions of the leaders' positions."""
    entries: list[tuple[int, int, complex]] = []
    for row in used.tolist():
        codes: dict[int, complex] = {0: 1.0}
        for k, (power, joint) in enumerate(zip(waves[row], target.types, strict=True)):
            if abs(power) > 2:
                raise DerivationError(
                    f"E and P: sine and cosine of joint {k + 1} occur with the power {abs(power)}, expected two at most",
                    UNEXPANDED,
                )
            parts = FUNCTIONS[power] if joint.basis is TRIGONOMETRIC else {power: 1.0 + 0.0j}
            codes = {
                code + target.weight(k) * digit: value * factor
                for code, value in codes.items()
                for digit, factor in parts.items()
            }
        entries += [(row, code, value) for code, value in codes.items()]
    rows, columns, values = (np.array(part) for part in zip(*entries, strict=True))
    return sparse.csr_array((values, (rows, columns)), shape=(len(waves), target.codes))
