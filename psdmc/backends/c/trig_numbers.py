"""The numbers of the inline sincos as C text."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.backends.trig_numbers import NUMBERS, Real


def c_number(value: float, real: Real) -> str:
    """Return a C99 constant that has exactly the given value when it is compiled: hexadecimal, without trailing zeros."""
    mantissa, _, exponent = value.hex().partition("p")
    head, _, digits = mantissa.partition(".")
    digits = digits.rstrip("0")
    text = f"{head}.{digits}p{exponent}" if digits else f"{head}p{exponent}"
    return text + ("f" if real == "float" else "")


def polynomial(coefficients: tuple[float, ...], real: Real) -> str:
    """Return a C expression of a polynomial in z. The expression uses C variables z and z2 = z^2. The coefficients
    begin with the constant term.

    Terms are evaluated in pairs (Estrin's scheme), which has a dependency chain half as long as that of Horner's form.
    """
    c = [c_number(value, real) for value in coefficients]
    pairs = [f"({' + z * '.join(c[i : i + 2])})" for i in range(0, len(c), 2)]
    text = pairs[-1]
    for pair in reversed(pairs[:-1]):
        text = f"({pair} + z2 * {text})"
    return text


def plain_number(value: float, real: Real) -> str:
    """Return a decimal C literal, for the few constants that are short decimal numbers."""
    return repr(value) + ("f" if real == "float" else "")


@dataclass(frozen=True, slots=True)
class ReductionStep:
    """C names for one subtraction `to = of - turn` that reduces an angle. `turn` is k, the number of quarter
    revolutions, times `part`, a part of pi/2. The rounding error of the subtraction is added to `lost`."""

    to: str
    of: str
    part: str
    turn: str
    lost: str


@dataclass(frozen=True, slots=True)
class Constants:
    """The constants of the sine and cosine code for float or double, as C text. The integers are positions of bits and
    shifts in the binary form of a real number."""

    two_over_pi: str
    magic: str
    half_pi_first: str
    half_pi_next: tuple[ReductionStep, ...]
    half_pi_rest: str
    all_lost: str
    r: str
    sin_polynomial: str
    cos_polynomial: str
    zero: str
    half: str
    one: str
    limit: str
    sign_place: int
    sign_shift: int
    libm_sin: str
    libm_cos: str


def constants(real: Real) -> Constants:
    """NUMBERS[real] as C text."""
    numbers = NUMBERS[real]
    places = numbers.digits - 1
    steps = _reduction_steps(real)
    return Constants(
        two_over_pi=c_number(numbers.two_over_pi, real),
        magic=c_number(1.5 * 2.0**places, real),
        half_pi_first=c_number(numbers.half_pi[0], real),
        half_pi_next=steps,
        half_pi_rest=c_number(numbers.half_pi[-1], real),
        all_lost=" + ".join(step.lost for step in steps),
        r=steps[-1].to,
        sin_polynomial=polynomial(numbers.sin_terms, real),
        cos_polynomial=polynomial(numbers.cos_terms, real),
        zero=plain_number(0.0, real),
        half=plain_number(0.5, real),
        one=plain_number(1.0, real),
        limit=plain_number(numbers.limit, real),
        sign_place=numbers.bits - 1,
        sign_shift=numbers.bits - 2,
        libm_sin="sin" if real == "double" else "sinf",
        libm_cos="cos" if real == "double" else "cosf",
    )


def _reduction_steps(real: Real) -> tuple[ReductionStep, ...]:
    """One for each exact part of pi/2 after the first."""
    parts = NUMBERS[real].half_pi[1:-1]
    return tuple(
        ReductionStep(f"r{i}", f"r{i - 1}", c_number(part, real), f"turn{i}", f"lost{i}")
        for i, part in enumerate(parts, start=2)
    )
