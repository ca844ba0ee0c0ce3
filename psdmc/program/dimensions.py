"""Dimensions of physical quantities, and the dimensions that operations give to their results.

A dimension consists of the exponents of mass, length and time. Angles have the dimension of pure numbers. None is the
dimension of zero, because zero can have any unit.
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from psdmc.errors import InternalError


class Dimension(NamedTuple):
    """The exponents of kg, m and s in a unit. The square root of a quantity can have exponents such as 1/2."""

    mass: float = 0
    length: float = 0
    time: float = 0

    def __str__(self) -> str:
        """The unit in SI, 'kg m^2/s^2'; '1' for numbers."""
        above: list[str] = []
        below: list[str] = []
        for word, power in zip(("kg", "m", "s"), self, strict=True):
            if power:
                size = abs(power)
                (above if power > 0 else below).append(word if size == 1 else f"{word}^{size:g}")
        under = f"/({' '.join(below)})" if len(below) > 1 else f"/{below[0]}" if below else ""
        return (" ".join(above) or "1") + under

    @property
    def order(self) -> float:
        """Return the exponent k with which a quantity is converted to the units inside a trace (a recorded function).
        If the unit of length there is u metres and that of energy is J, x in SI becomes x u^k."""
        return 2 * self.mass - self.length


Known = Dimension | None

NUMBER, LENGTH = Dimension(), Dimension(0, 1, 0)
MASS, MOMENT, INERTIA = Dimension(1), Dimension(1, 1), Dimension(1, 2)
ACCELERATION = Dimension(0, 1, -2)

_WORDS = {
    "1": NUMBER,
    "rad": NUMBER,
    "kg": MASS,
    "m": LENGTH,
    "s": Dimension(0, 0, 1),
    "N": Dimension(1, 1, -2),
    "J": Dimension(1, 2, -2),
    "W": Dimension(1, 2, -3),
}


@cache
def dimension_of(unit: str) -> Dimension:
    """Return the dimension of a unit such as 'kg m^2/s' or '1/(J s^2)'. All after the slash divides."""
    total = NUMBER
    for sign, part in zip((1, -1), unit.split("/"), strict=False):
        for factor in part.strip("() ").split():
            known = re.fullmatch(r"([A-Za-z]+|1)(?:\^(\d+))?", factor)
            if known is None or known[1] not in _WORDS:
                raise InternalError(f"unit {unit!r}: {factor!r} is none of {', '.join(_WORDS)}")
            total = times(total, _WORDS[known[1]], sign * int(known[2] or 1))
    if unit.count("/") > 1 or not unit.strip():
        raise InternalError(f"unit {unit!r}: write factors and one stroke, as in 'kg m^2/s'")
    return total


@cache
def times(a: Dimension, b: Dimension, power: float = 1) -> Dimension:
    """The dimension of a b^power."""
    return Dimension(a[0] + power * b[0], a[1] + power * b[1], a[2] + power * b[2])


def in_words(dimension: Known) -> str:
    """The unit, or what has none."""
    return "zero" if dimension is None else "a number" if dimension == NUMBER else str(dimension)


class Unlike(Exception):
    """This error says that an operation does not admit arguments of these dimensions together."""

    def __init__(self, *given: Known) -> None:
        super().__init__(" and ".join(map(in_words, given)))


def alike(*given: Known) -> Known:
    """Return the common dimension of values that are added or compared. Raises Unlike if theirs differ."""
    found = given[0]
    for each in given[1:]:
        if found is None:
            found = each
        elif each is not None and each != found:
            raise Unlike(*given)
    return found


def product(a: Known, b: Known) -> Known:
    return None if a is None or b is None else times(a, b)


def quotient(a: Known, b: Known) -> Known:
    return None if a is None else times(a, b or NUMBER, -1)


def root(a: Known) -> Known:
    return None if a is None else times(NUMBER, a, 0.5)


def chosen(a: Known, b: Known, x: Known, y: Known) -> Known:
    """Return the dimension of the result if a comparison of a and b selects x or y. Raises Unlike if a and b, or x and
    y, have different dimensions."""
    alike(a, b)
    return alike(x, y)


def number(*given: Known) -> Known:
    """Return the dimension of the result of functions such as exp, which is that of a pure number. Raises Unlike if an
    argument has another dimension."""
    if any(each is not None and each != NUMBER for each in given):
        raise Unlike(*given)
    return NUMBER


def angle(y: Known, x: Known) -> Known:
    """Return the dimension of the angle of two values of one dimension."""
    alike(y, x)
    return NUMBER


def raised(base: Known, exponent: Known, value: float | None = None) -> Known:
    """Return the dimension of a power. If the base has a unit, the value of the exponent must be known. Raises Unlike
    if it is not, or if the exponent has a unit."""
    if value is None or base is None:
        return number(base, exponent)
    number(exponent)
    return times(NUMBER, base, value)
