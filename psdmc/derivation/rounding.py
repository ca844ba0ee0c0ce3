"""Replaces numbers that differ only by rounding by one number, the simplest one within the rounding error.

The same product of link lengths enters P, the torque coefficients, in several places with different last digits. The
generated code for expanded torques shares sub-expressions only if coefficients are equal. Numbers are rounded here,
before the model is compared with Newton-Euler, and nowhere else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DIGITS = 12
"""Decimal digits of a simple number: products of two lengths given to 0.1 mm have fewer."""

SIMPLE = 2e-13
"""Largest relative change of a number to a simple one. A small coefficient may multiply a large parameter: changed by
the noise of larger coefficients, it would cost digits of the torque."""


def merged(values: Array, noise: Array) -> Array:
    """Return the numbers with those that differ only by rounding made equal in magnitude. Signs stay.

    No number changes by more than its noise.

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
    # Each number to DIGITS decimal digits where that moves it by no more than its noise.
    exponent = DIGITS - 1 - np.floor(np.log10(np.where(middle > 0, middle, 1.0)))
    # An integer below 2^53 divided by a power of ten up to 10^22 is the double nearest to that decimal.
    power = 10.0 ** np.clip(exponent, 0, 22)
    decimal = np.round(middle * power) / power
    shared = np.where(np.abs(decimal - middle) <= np.minimum(least, SIMPLE * middle), decimal, middle)
    candidate = np.repeat(shared, counts)
    accepted = np.where(np.abs(candidate - size) <= reach, candidate, size)
    result = np.empty_like(values)
    result[order] = accepted
    return np.copysign(result, values)
