"""Centrifugal and Coriolis terms from the mass matrix, in coefficient space.

tau_i = sum over j, k of (dM_ij/dq_k - 1/2 dM_jk/dq_i) qd_j qd_k: Christoffel's formula before it is made
symmetric.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from psdmc.derivation.functions import Functions
from psdmc.derivation.terms import Integers, Terms, joined, selected, summed


def derivative(terms: Terms, functions: Functions, joint: int) -> Terms:
    """d/dq of one joint; functions are codes."""
    digits = functions.digit(terms.function, joint)
    weight = functions.weight(joint)
    parts: list[Terms] = []
    for digit, images in enumerate(functions.types[joint].basis.derivatives):
        chosen = selected(terms, digits == digit) if images else terms
        for image, factor in images:
            moved: Integers = chosen.function + (image - digit) * weight
            parts.append(Terms(chosen.row, moved, chosen.column, factor * chosen.value))
    return joined(parts)


def velocity_terms(
    mass_matrix: Mapping[tuple[int, int], Terms],
    functions: Functions,
    carried: Sequence[Sequence[int]],
    tolerance: float,
) -> Terms:
    """Torque terms (row the joint, function the key) of all products of joint rates.

    carried   the joints beyond each joint, of which alone its row of the mass matrix may depend
    """
    parts: list[Terms] = []
    for (a, b), terms in mass_matrix.items():
        for d in carried[a]:
            slope = derivative(terms, functions, d)
            parts.append(_placed(slope, functions, a, b, d, 1.0))
            if a != b:
                parts.append(_placed(slope, functions, b, a, d, 1.0))
            parts.append(_placed(slope, functions, d, a, b, -0.5 if a == b else -1.0))
    return summed(joined(parts), tolerance)


def _placed(slope: Terms, functions: Functions, row: int, j: int, k: int, factor: float) -> Terms:
    """A slope as a factor of qd_j qd_k in the torque of joint `row`."""
    key = functions.velocity_rate(j, k) * functions.codes
    return Terms(np.full_like(slope.row, row), slope.function + key, slope.column, factor * slope.value)


def acceleration_terms(mass_matrix: Mapping[tuple[int, int], Terms], functions: Functions) -> Terms:
    """Torque terms of M qdd."""
    parts: list[Terms] = []
    for (a, b), terms in mass_matrix.items():
        for row, j in ((a, b), (b, a))[: 1 if a == b else 2]:
            key = functions.acceleration_rate(j) * functions.codes
            parts.append(Terms(np.full_like(terms.row, row), terms.function + key, terms.column, terms.value))
    return joined(parts)


def slope_count(terms: Terms, functions: Functions, joint: int) -> int:
    """How many terms `derivative` makes."""
    images = [len(images) for images in functions.types[joint].basis.derivatives]
    counts = np.bincount(functions.digit(terms.function, joint), minlength=len(images))
    return int(counts[: len(images)] @ np.array(images))
