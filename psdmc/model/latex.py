"""The equations of a model as LaTeX, of symbols that psdmc chooses and numbers, without a file's names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from psdmc.model.equations import BaseParameter, Power, Symbol, Term

UNKNOWN = r"\text{unknown}"

DIGITS = 6
"""Significant digits of a value, as `psdmc show` prints them."""

_EXPONENT = re.compile(r"e([+-])0*(\d+)")
_LETTERS = re.compile(r"(I|m)?([a-z]*)")
"""Of standard parameters and lengths: m, mx, Ixx, Im, a, d."""


def equations_latex(parameters: Sequence[BaseParameter]) -> str:
    """Return an `aligned` environment (amsmath) with a line for each base parameter: its symbol, its equation and its
    value.

    Entries of theta_b are numbered from 0, as in C and Python; joints are numbered from 1.
    """
    lines = [
        rf"\theta_{{{k}}} &= {terms_latex(parameter.terms)} && = {_valued(parameter)}"
        for k, parameter in enumerate(parameters)
    ]
    return aligned(lines)


def aligned(lines: Iterable[str]) -> str:
    """The lines as an `aligned` environment."""
    body = " \\\\\n".join(lines)
    return f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}"


def terms_latex(terms: Sequence[Term]) -> str:
    """A sum; empty for none."""
    signed = [f"{'-' if term.is_minus else '+'} {_term(term)}" for term in terms]
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


def _term(term: Term) -> str:
    number = [number_latex(term.number)] if term.number else []
    product = r"\, ".join([*number, *map(_power, term.times), symbol_latex(term.of)])
    if not term.over:
        return product
    return rf"\frac{{{product}}}{{{_product(term.over)}}}"


def _product(powers: Sequence[Power]) -> str:
    return r"\, ".join(map(_power, powers))


def _power(power: Power) -> str:
    base = symbol_latex(power.symbol)
    return base if power.exponent == 1 else f"{base}^{{{power.exponent}}}"


def _valued(parameter: BaseParameter) -> str:
    if parameter.value is None:
        return UNKNOWN
    unit = parameter.unit.replace("^2", "^{2}").replace(" ", r"\,")
    return rf"{number_latex(f'{parameter.value:.{DIGITS}g}')}\ \mathrm{{{unit}}}"
