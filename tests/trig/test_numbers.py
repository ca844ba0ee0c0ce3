"""psdmc/backends/trig_numbers.py holds the numbers that minimax.py derives, and they are what the error bounds assume."""

from __future__ import annotations

from fractions import Fraction

import minimax
import mpmath as mp
import pytest
from slow_cases import slow_but_for

from psdmc.backends.c.trig import c_number, polynomial
from psdmc.backends.trig_numbers import NUMBERS, Real
from psdmc.target.target import VectorUnit

EXACT_PARTS = {"double": 2, "float": 3}
INDEX_DIGITS = {"double": 16, "float": 10}

each_real = pytest.mark.parametrize("real", ["double", "float"])


@pytest.mark.parametrize("real", slow_but_for(["double"], ["double", "float"]))
def test_the_coefficients_are_the_minimax_fit(real: Real) -> None:
    numbers = NUMBERS[real]
    digits, terms = minimax.DIGITS[real], minimax.TERMS[real]

    of_sin = minimax.rounded_fit(minimax.sin_rest, minimax.sin_weight, terms, digits)
    of_cos = minimax.rounded_fit(minimax.cos_rest, minimax.cos_weight, terms, digits)

    assert [c.hex() for c in numbers.sin_terms] == [float(c).hex() for c in of_sin]
    assert [c.hex() for c in numbers.cos_terms] == [float(c).hex() for c in of_cos]


@pytest.mark.parametrize(("real", "of_sin", "of_cos"), [("double", -57.8, -63.8), ("float", -27.8, -32.9)])
def test_the_polynomials_are_as_close_as_the_documentation_says(
    real: Real, of_sin: float, of_cos: float
) -> None:
    sin_terms = [mp.mpf(c) for c in NUMBERS[real].sin_terms]
    cos_terms = [mp.mpf(c) for c in NUMBERS[real].cos_terms]

    assert minimax.greatest_error(sin_terms, minimax.sin_rest, minimax.sin_weight) < 2**of_sin
    assert minimax.greatest_error(cos_terms, minimax.cos_rest, minimax.cos_weight) < 2**of_cos


@each_real
def test_half_pi_is_the_sum_of_its_parts_and_their_multiples_are_exact(real: Real) -> None:
    numbers = NUMBERS[real]
    parts = minimax.half_pi_parts(EXACT_PARTS[real], numbers.digits, INDEX_DIGITS[real])

    assert [part.hex() for part in numbers.half_pi] == [float(part).hex() for part in parts]
    assert numbers.limit * 2 / mp.pi < 2 ** INDEX_DIGITS[real] - 1
    assert min(numbers.half_pi) > 0
    for part in numbers.half_pi[:-1]:
        mantissa = Fraction(part).numerator
        odd = mantissa // (mantissa & -mantissa)
        assert abs(odd).bit_length() + INDEX_DIGITS[real] <= numbers.digits


def test_two_over_pi_is_the_nearest_number() -> None:
    for real, numbers in NUMBERS.items():
        assert numbers.two_over_pi == minimax.round_to(2 / mp.pi, minimax.DIGITS[real])


def test_literals_read_back_exactly() -> None:
    for value in (0.1, 1.5, -3.0, 2.0**52 * 1.5, 1e-300):
        assert float.fromhex(c_number(value, "double")) == value
    assert c_number(1.5, "float") == "0x1.8p+0f"


def test_polynomials_are_nested_in_pairs() -> None:
    assert polynomial((1.0, 2.0, 3.0), "double") == "((0x1p+0 + z * 0x1p+1) + z2 * (0x1.8p+1))"


def test_a_vector_of_odd_size_is_refused() -> None:
    with pytest.raises(ValueError, match="vectors of 24 bytes"):
        VectorUnit(24)
