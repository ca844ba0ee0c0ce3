"""Base parameters as equations in standard parameters: "m2 + mx2/a2 - mx3/a3", with unit and value.

A standard parameter is named by its kind and the number of the joint, counted from the base: m2, mx2, Ixx3, Im1. It is
about the link frame. In a DH table, lengths have names, too. These names are used if a coefficient is a length, a
square, a product or a quotient of lengths, or the reciprocal of one of these. Every other coefficient is printed as a
number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from psdmc.reproducible import times
from psdmc.robot.inertia import LENGTH_ORDER
from psdmc.robot.mechanism import PARAMETER_NAMES, PARAMETERS_PER_LINK, Array, Joint, Mechanism


class Symbol(NamedTuple):
    """A quantity of one joint in an equation, such as mx2: letters, and the joint's number from 1."""

    letters: str
    number: int

    def __str__(self) -> str:
        return f"{self.letters}{self.number}"


class Power(NamedTuple):
    """A symbol and its exponent, 1 or more."""

    symbol: Symbol
    exponent: int = 1

    def __str__(self) -> str:
        return f"{self.symbol}" if self.exponent == 1 else f"{self.symbol}^{self.exponent}"


@dataclass(frozen=True, slots=True)
class Term:
    """One term of an equation of a base parameter: number * times * of / over, to be added or subtracted.

    of        the standard parameter
    is_minus  whether the term is subtracted
    number    decimal digits; None: one
    times     lengths in the numerator
    over      lengths in the denominator
    """

    of: Symbol
    is_minus: bool = False
    number: str | None = None
    times: tuple[Power, ...] = ()
    over: tuple[Power, ...] = ()

    def __str__(self) -> str:
        """The term without its sign."""
        product = " ".join([*([self.number] if self.number else []), *map(str, self.times), str(self.of)])
        if not self.over:
            return product
        divisor = " ".join(map(str, self.over))
        return f"{product}/({divisor})" if len(self.over) > 1 else f"{product}/{divisor}"


def equation(terms: Sequence[Term]) -> str:
    """Return the sum of the terms as one line of text, without a plus before the first term."""
    first, *others = terms
    return str(first) + "".join(f" {'-' if term.is_minus else '+'} {term}" for term in others)


RECOGNITION = 1e-9
"""Relative difference up to which a coefficient is written by a name. For display only: the numbers stay."""

DIGITS = 6
"""Significant digits of coefficients that have no name."""

SHORTEST = 1e-100
"""m; shorter ones have no name in equations: their squares would leave the range of doubles."""

_UNITS = ("kg", "kg m", "kg m^2")


@dataclass(frozen=True, slots=True)
class BaseParameter:
    """One base parameter: its equation, unit and value.

    equation  sum of standard parameters about the link frames, as text
    unit      kg, kg m or kg m^2
    value     SI; None if unknown
    terms     the terms of the equation as objects, from which the text is made
    """

    equation: str
    unit: str
    value: float | None
    terms: tuple[Term, ...] = ()


@dataclass(frozen=True, slots=True)
class _Known:
    """A number with a name, as a term writes it; `order` is its exponent of the metre."""

    value: float
    order: int
    times: tuple[Power, ...] = ()
    over: tuple[Power, ...] = ()
    number: str | None = None


def base_parameters(
    chain: Mechanism, B: Array, pivots: Sequence[int], values: Sequence[float | None]
) -> tuple[BaseParameter, ...]:
    """Return the equation, unit and value of each entry of theta_b.

    B       (l, 11n)  theta_b = B @ x, with the standard parameters x
    pivots  l indices into x: the standard parameter that is written first in each equation
    values  l values of base parameters, None if unknown
    """
    known = list(_known_numbers(dh_lengths(chain)))
    return tuple(
        _base_parameter(_terms(row, pivot, chain, known), _unit(pivot, chain), value)
        for row, pivot, value in zip(B, pivots, values, strict=True)
    )


def _base_parameter(terms: tuple[Term, ...], unit: str, value: float | None) -> BaseParameter:
    return BaseParameter(equation(terms), unit, value, terms)


def standard_symbol(index: int) -> Symbol:
    """Return the symbol of a standard parameter, such as m2, Ixx3 or Im1: its kind and the joint's number.

    index  index into the standard parameters x, 11 per link
    """
    joint, parameter = divmod(index, PARAMETERS_PER_LINK)
    return Symbol(PARAMETER_NAMES[parameter], joint + 1)


def dh_lengths(chain: Mechanism) -> dict[Symbol, float]:
    """Return the lengths a and d (m) in the DH table of a robot by symbol, such as a3. Zero lengths are left out. The
    result is empty for a robot from a URDF."""
    return {
        Symbol(letters, number): value
        for number, joint in enumerate(chain.joints, start=1)
        for letters, value in _row_lengths(joint, chain.convention)
        if value != 0.0
    }


def _row_lengths(joint: Joint, convention: str) -> list[tuple[str, float]]:
    if convention == "standard":
        x, _, z = joint.link_frame.translation.tolist()
        return [("a", x), ("d", z)]
    if convention == "modified":
        place = joint.placement
        return [
            ("a", float(place.translation[0])),
            ("d", float(times(place.rotation[:, 2], place.translation))),
        ]
    return []


def _order(index: int, chain: Mechanism) -> int:
    joint, parameter = divmod(index, PARAMETERS_PER_LINK)
    if parameter < len(LENGTH_ORDER):
        return LENGTH_ORDER[parameter]
    return chain.joints[joint].type.drive_order


def _unit(index: int, chain: Mechanism) -> str:
    return _UNITS[_order(index, chain)]


def _known_numbers(lengths: dict[Symbol, float]) -> Iterator[_Known]:
    """Named coefficients, simplest first."""
    items = [(name, value) for name, value in lengths.items() if abs(value) > SHORTEST]
    for name, value in items:
        once, squared = (Power(name),), (Power(name, 2),)
        yield _Known(value, 1, once)
        yield _Known(1.0 / value, -1, over=once)
        yield _Known(2.0 * value, 1, once, number="2")
        yield _Known(2.0 / value, -1, over=once, number="2")
        yield _Known(value**2, 2, squared)
        yield _Known(value**-2, -2, over=squared)
    for number, (name, value) in enumerate(items):
        for other, length in items[:number] + items[number + 1 :]:
            yield _Known(value / length, 0, (Power(name),), (Power(other),))
        for other, length in items[number + 1 :]:
            both = (Power(name), Power(other))
            yield _Known(value * length, 2, both)
            yield _Known(1.0 / (value * length), -2, over=both)


def _terms(row: Array, pivot: int, chain: Mechanism, known: list[_Known]) -> tuple[Term, ...]:
    """The pivot, then the others in the order of x."""
    others = [int(index) for index in np.flatnonzero(row) if index != pivot]
    pivots_order = _order(pivot, chain)
    found = (
        _term(float(row[index]), pivots_order - _order(index, chain), standard_symbol(index), known)
        for index in others
    )
    return (Term(standard_symbol(pivot)), *found)


def _term(value: float, order: int, of: Symbol, known: list[_Known]) -> Term:
    """value * of, the value's unit being m^order."""
    plain = [number for number in (1.0, 2.0, 0.5) if order == 0 and _close(abs(value), number)]
    if plain:
        return Term(of, value < 0, None if plain[0] == 1.0 else f"{plain[0]:g}")
    for named in known:
        if named.order == order and _close(abs(value), abs(named.value)):
            return Term(of, value * named.value < 0, named.number, named.times, named.over)
    return Term(of, value < 0, f"{abs(value):.{DIGITS}g}")


def _close(a: float, b: float) -> bool:
    return abs(a - b) <= RECOGNITION * abs(b)
