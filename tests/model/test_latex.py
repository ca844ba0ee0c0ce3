"""Equations in LaTeX, and as terms whose values are those of B."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bundled import bundled_model
from matplotlib.mathtext import MathTextParser

from psdmc.model.equations import Power, Symbol, Term, dh_lengths, number_latex, symbol_latex
from psdmc.robot.mechanism import PARAMETER_NAMES, PARAMETERS_PER_LINK

ROBOTS = ["two_link_full", "scara", "denso_wall", "kr6", "rounded_arm"]


def test_two_link_as_a_reader_would_write_it() -> None:
    assert bundled_model("two_link_full").to_latex().splitlines()[1:4] == [
        r"\theta_{0} &= m_{1} + \frac{m_{x,1}}{a_{1}} - \frac{m_{x,2}}{a_{2}} && = 1.76515\ \mathrm{kg} \\",
        r"\theta_{1} &= m_{y,1} && = 0\ \mathrm{kg\,m} \\",
        r"\theta_{2} &= I_{zz,1} + a_{1}\, m_{x,1} && = -0.465\ \mathrm{kg\,m^{2}} \\",
    ]


@pytest.mark.parametrize("name", ROBOTS)
def test_a_typesetter_reads_every_equation(name: str) -> None:
    """matplotlib's parser of TeX, line by line: it knows no environments."""
    first, *lines, last = bundled_model(name).to_latex().splitlines()
    assert (first, last) == (r"\begin{aligned}", r"\end{aligned}")
    assert len(lines) == bundled_model(name).l
    parser = MathTextParser("path")
    for line in lines:
        parser.parse(f"${line.removesuffix(' ' + 2 * chr(92)).replace('&', '')}$")


def power(value: Power, lengths: dict[str, float]) -> float:
    return lengths[str(value.symbol)] ** value.exponent


def coefficient(term: Term, lengths: dict[str, float]) -> float:
    number = float(term.number or 1.0) * (-1.0 if term.is_minus else 1.0)
    above = math.prod(power(p, lengths) for p in term.times)
    return number * above / math.prod(power(p, lengths) for p in term.over)


@pytest.mark.parametrize("name", ROBOTS)
def test_terms_have_the_values_of_B(name: str) -> None:
    model = bundled_model(name)
    lengths = {str(symbol): value for symbol, value in dh_lengths(model.mechanism).items()}
    found = np.zeros_like(model.B)
    for row, parameter in zip(found, model.base_parameters, strict=True):
        for term in parameter.terms:
            place = PARAMETER_NAMES.index(term.of.letters)
            row[PARAMETERS_PER_LINK * (term.of.number - 1) + place] = coefficient(term, lengths)
    assert np.allclose(found, model.B, rtol=1e-5, atol=0.0)


def test_symbols_and_powers_of_ten() -> None:
    assert [symbol_latex(Symbol(letters, 12)) for letters in ("m", "mx", "Ixx", "Im", "a", "d")] == [
        "m_{12}",
        "m_{x,12}",
        "I_{xx,12}",
        "I_{m,12}",
        "a_{12}",
        "d_{12}",
    ]
    assert number_latex("-1.5e-07") == r"-1.5 \times 10^{-7}"
    assert number_latex("1e+20") == r"1 \times 10^{20}"
    assert number_latex("0.25") == "0.25"
