"""Centrifugal and Coriolis terms, computed from the coefficients of the mass matrix.

tau_i = sum over j, k of (dM_ij/dq_k - 1/2 dM_jk/dq_i) qd_j qd_k: Christoffel's formula before it is made symmetric.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from psdmc.derivation.monomials import Monomials
from psdmc.derivation.terms import Integers, Terms, joined, selected, summed


def derivative(terms: Terms, monomials: Monomials, joint: int) -> Terms:
    """Return the derivative of mass matrix terms by the position q of one joint.

    A term has a product of functions of q (numbered by its code, see monomials.py) and a factor.
    """
    digits = monomials.digit(terms.monomial, joint)
    weight = monomials.weight(joint)
    parts: list[Terms] = []
    for digit, images in enumerate(monomials.types[joint].basis.derivatives):
        chosen = selected(terms, digits == digit) if images else terms
        for image, factor in images:
            moved: Integers = chosen.monomial + (image - digit) * weight
            parts.append(Terms(chosen.row, moved, chosen.column, factor * chosen.value))
    return joined(parts)


def velocity_terms(
    mass_matrix: Mapping[tuple[int, int], Terms],
    monomials: Monomials,
    carried: Sequence[Sequence[int]],
    tolerance: float,
) -> Terms:
    """Return the torque terms with all products of joint rates, from the terms of the mass matrix.

    In the result, the row is the joint, and the monomial includes the rates (its key, see monomials.py).

    carried    for each joint, the joints that it moves; its row of the mass matrix depends on no others
    tolerance  largest magnitude of a coefficient that counts as zero
    """
    parts: list[Terms] = []
    for (a, b), terms in mass_matrix.items():
        for d in carried[a]:
            slope = derivative(terms, monomials, d)
            parts.append(_placed(slope, monomials, a, b, d, 1.0))
            if a != b:
                parts.append(_placed(slope, monomials, b, a, d, 1.0))
            parts.append(_placed(slope, monomials, d, a, b, -0.5 if a == b else -1.0))
    return summed(joined(parts), tolerance)


def _placed(slope: Terms, monomials: Monomials, row: int, j: int, k: int, factor: float) -> Terms:
    """A slope as a factor of qd_j qd_k in the torque of joint `row`."""
    key = monomials.velocity_rate(j, k) * monomials.codes
    return Terms(np.full_like(slope.row, row), slope.monomial + key, slope.column, factor * slope.value)


def acceleration_terms(mass_matrix: Mapping[tuple[int, int], Terms], monomials: Monomials) -> Terms:
    """Torque terms of M qdd."""
    parts: list[Terms] = []
    for (a, b), terms in mass_matrix.items():
        for row, j in ((a, b), (b, a))[: 1 if a == b else 2]:
            key = monomials.acceleration_rate(j) * monomials.codes
            parts.append(Terms(np.full_like(terms.row, row), terms.monomial + key, terms.column, terms.value))
    return joined(parts)


def slope_count(terms: Terms, monomials: Monomials, joint: int) -> int:
    """Number of terms that `derivative` makes."""
    images = [len(images) for images in monomials.types[joint].basis.derivatives]
    counts = np.bincount(monomials.digit(terms.monomial, joint), minlength=len(images))
    return int(counts[: len(images)] @ np.array(images))
