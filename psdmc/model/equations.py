"""Base parameters as equations in standard parameters: "m2 + mx2/a2 - mx3/a3", with unit and value; also as LaTeX and as
a table.

A standard parameter is named by its kind and the number of the joint, counted from the base: m2, mx2, Ixx3, Im1. It is
about the link frame. In a DH table, lengths have names, too. These names are used if a coefficient is a length, a
square, a product or a quotient of lengths, or the reciprocal of one of these. Every other coefficient is printed as a
number. LaTeX has these symbols, too, and no name of a file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from psdmc.errors import ToolchainError
from psdmc.reproducible import times
from psdmc.robot.inertia import LENGTH_ORDER
from psdmc.robot.mechanism import PARAMETER_NAMES, PARAMETERS_PER_LINK, Array, Joint, Mechanism

if TYPE_CHECKING:
    import pandas as pd


RECOGNITION = 1e-9
"""Relative difference up to which a coefficient is written by a name. For display only: the numbers stay."""

DIGITS = 6
"""Significant digits of values, and of coefficients that have no name."""

SHORTEST = 1e-100
"""m; shorter ones have no name in equations: their squares would leave the range of doubles."""

_UNITS = ("kg", "kg m", "kg m^2")

LINES = 12
"""Most lines of a repr."""

LABEL = 40
"""Most characters of an equation in a label, but for its first term."""

BETWEEN_TERMS = re.compile(r" (?=[-+] )")

_EXPONENT = re.compile(r"e([+-])0*(\d+)")
_LETTERS = re.compile(r"(I|m)?([a-z]*)")
"""Of standard parameters and lengths: m, mx, Ixx, Im, a, d."""


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


class BaseParameters(tuple[BaseParameter, ...]):
    """A tuple with the equation, unit and value of each entry of theta_b. Printed, it is a table."""

    __slots__ = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Return a label for each base parameter, such as 'theta_b[7] Izz2 + a2 mx2', with its index and equation.
        Labels are cut to LABEL characters."""
        return tuple(f"theta_b[{k}] {_first_terms(parameter.equation)}" for k, parameter in enumerate(self))

    def plain(self) -> list[dict[str, Any]]:
        """Return a JSON object per base parameter: number from 0, label, whole equation, unit, value or None."""
        named = enumerate(zip(self.labels, self, strict=True))
        return [
            {"index": k, "name": name, "equation": each.equation, "unit": each.unit, "value": each.value}
            for k, (name, each) in named
        ]

    def to_frame(self) -> pd.DataFrame:
        """Return a pandas data frame with one row per base parameter: equation, value (NaN if unknown) and unit. The
        index, theta_b, runs from 0 to l - 1.

        Raises ToolchainError if pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError as error:
            raise ToolchainError("to_frame() needs pandas", "pip install 'psdmc[notebook]'") from error
        columns = {
            "equation": [parameter.equation for parameter in self],
            "value": [float("nan") if parameter.value is None else parameter.value for parameter in self],
            "unit": [parameter.unit for parameter in self],
        }
        return pd.DataFrame(columns, index=pd.RangeIndex(len(self), name="theta_b"))

    def to_latex(self) -> str:
        """Return all equations with values and units, as an `aligned` environment of amsmath.

        Entries of theta_b are numbered from 0, as in C and Python; joints are numbered from 1.
        """
        lines = [
            rf"\theta_{{{k}}} &= {terms_latex(parameter.terms)} && = {_value_latex(parameter)}"
            for k, parameter in enumerate(self)
        ]
        body = " \\\\\n".join(lines)
        return f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}"

    def __repr__(self) -> str:
        head = f"{len(self)} base parameters"
        lines = [f"  {k}: {_shown(parameter)}" for k, parameter in enumerate(self[: LINES - 1])]
        if len(self) > len(lines):
            lines[-1] = f"  ... and {len(self) - len(lines) + 1} more"
        return "\n".join([head, *lines])

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{k}</td><td>{escape(parameter.equation)}</td><td>{value_text(parameter)}</td>"
            f"<td>{escape(parameter.unit)}</td></tr>"
            for k, parameter in enumerate(self)
        )
        head = "<tr><th>theta_b</th><th>equation</th><th>value</th><th>unit</th></tr>"
        return f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>"

    def _repr_latex_(self) -> str:
        return f"$$\n{self.to_latex()}\n$$"


def _first_terms(equation: str) -> str:
    """An equation, or as many of its terms as a label has room for."""
    first, *others = BETWEEN_TERMS.split(equation)
    for term in others:
        if len(first) + len(term) > LABEL:
            return f"{first} + ..."
        first = f"{first} {term}"
    return first


def value_text(parameter: BaseParameter) -> str:
    """The value with six digits, or 'unknown'."""
    return "unknown" if parameter.value is None else f"{parameter.value:.{DIGITS}g}"


def _shown(parameter: BaseParameter) -> str:
    equation = parameter.equation
    short = equation if len(equation) <= 80 else f"{equation[:76]} ..."
    return (
        f"{short} = {value_text(parameter)} {parameter.unit if parameter.value is not None else ''}".rstrip()
    )


def base_parameters(
    chain: Mechanism, B: Array, pivots: Sequence[int], values: Sequence[float | None]
) -> BaseParameters:
    """Return the equation, unit and value of each entry of theta_b.

    B       (l, 11n)  theta_b = B @ x, with the standard parameters x
    pivots  l indices into x: the standard parameter that is written first in each equation
    values  l values of base parameters, None if unknown
    """
    known = list(_known_numbers(dh_lengths(chain)))
    found = []
    for row, pivot, value in zip(B, pivots, values, strict=True):
        terms = _terms(row, pivot, chain, known)
        found.append(BaseParameter(equation(terms), _UNITS[_order(pivot, chain)], value, terms))
    return BaseParameters(found)


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


@dataclass(frozen=True, slots=True)
class _Known:
    """A number with a name, as a term writes it; `order` is its exponent of the metre."""

    value: float
    order: int
    times: tuple[Power, ...] = ()
    over: tuple[Power, ...] = ()
    number: str | None = None


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


def terms_latex(terms: Sequence[Term]) -> str:
    """A sum; empty for none."""
    signed = [f"{'-' if term.is_minus else '+'} {_term_latex(term)}" for term in terms]
    return " ".join(signed).removeprefix("+ ")


def number_latex(text: str) -> str:
    """Return a decimal number as LaTeX, with its exponent as a power of ten."""

    def power(found: re.Match[str]) -> str:
        sign = found[1].removeprefix("+")
        return rf" \times 10^{{{sign}{found[2]}}}"

    return _EXPONENT.sub(power, text)


def symbol_latex(symbol: Symbol) -> str:
    """Return a symbol as LaTeX: m3 as m_{3}, mx3 as m_{x,3}, Ixx3 as I_{xx,3}, a3 as a_{3}."""
    found = _LETTERS.fullmatch(symbol.letters)
    if found is None or not found[1] or not found[2]:
        return rf"{symbol.letters}_{{{symbol.number}}}"
    return rf"{found[1]}_{{{found[2]},{symbol.number}}}"


def _term_latex(term: Term) -> str:
    number = [number_latex(term.number)] if term.number else []
    product = r"\, ".join([*number, *map(_power_latex, term.times), symbol_latex(term.of)])
    if not term.over:
        return product
    divisor = r"\, ".join(map(_power_latex, term.over))
    return rf"\frac{{{product}}}{{{divisor}}}"


def _power_latex(power: Power) -> str:
    base = symbol_latex(power.symbol)
    return base if power.exponent == 1 else f"{base}^{{{power.exponent}}}"


def _value_latex(parameter: BaseParameter) -> str:
    if parameter.value is None:
        return r"\text{unknown}"
    unit = parameter.unit.replace("^2", "^{2}").replace(" ", r"\,")
    return rf"{number_latex(f'{parameter.value:.{DIGITS}g}')}\ \mathrm{{{unit}}}"
