"""The numbers and names in the generated C code of sine and cosine: data for the templates in `templates/trig/`.

    q = k pi/2 + r,  k = round(2 q / pi),  |r| <= pi/4        pi/2 in parts whose products with k are exact
    sin r = r - r^3 P(r^2)        cos r = 1 - r^2/2 + r^4 Q(r^2)

k mod 4 decides which of the two polynomials gives the sine and which the cosine, and their signs. docs/trigonometry.md
derives the error bounds. tests/trig/minimax.py computes the coefficients, and a test compares them with these.

A generated C file includes these templates of `templates/trig/`. Each gets the result of one function as `trig`:

    preamble.jinja         trig_preamble(prefix, real, far)       once per C file
    #if HAS_VECTORS                                               (psdmc/target/target.py)
    types.jinja            vector_trig(prefix, real, unit, far)   unless the file has such types itself
    sincos_vector.jinja    the same result                        <symbol>(const vec *x, vec *s, vec *c)
    #else
    sincos_scalar.jinja    scalar_trig(prefix, real, far)         <symbol>(const real *x, real *s, real *c)
    #endif
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from psdmc.backends.trig_numbers import NUMBERS, Real
from psdmc.target.target import Trig, VectorUnit

Far = Literal["libm", "nan"]
"""The result for an angle beyond the limit: libm's sine and cosine on a rare branch, or NaN (freestanding)."""


def far_of(trig: Trig) -> Far:
    """Return how the generated code computes the sine of an angle outside the range of its own sine function. 'libm'
    stands for the C library; 'nan' means that the result is NaN."""
    return "nan" if trig == "freestanding" else "libm"


SIGNED: dict[Real, str] = {"double": "long long", "float": "int"}
"""Signed integer as wide as a real, in C's spelling for GCC's builtins."""


@dataclass(frozen=True, slots=True)
class AnySign:
    """C test of whether one lane of the integer vector `*bits` is negative. If the C macro `guard` is defined, the test
    is `c`, an instruction of the processor. Otherwise, it is `plain` < 0."""

    guard: str
    c: str
    plain: str


@dataclass(frozen=True, slots=True)
class TrigPreamble:
    """View of preamble.jinja."""

    macro: str
    real: Real
    uses_libm: bool


@dataclass(frozen=True, slots=True)
class ScalarTrig:
    """The data of the template sincos_scalar.jinja. The C type vec is the real type (float or double). ivec is an
    unsigned integer type of the size of vec (in vectors: signed).

    rounded  integer type of k, the angle divided by pi/2 and rounded
    """

    macro: str
    symbol: str
    about: str
    real: Real
    integer: str
    vec: str
    ivec: str
    to_bits: str
    to_real: str
    keep: str
    sign: str
    limit: str
    odd: str
    uses_libm: bool
    constants: Constants
    rounded: str


@dataclass(frozen=True, slots=True)
class VectorTrig(ScalarTrig):
    """The data of the templates sincos_vector.jinja and types.jinja. The C type vec is a vector of `lanes` real
    numbers, and ivec is a vector of `lanes` signed integers."""

    near_symbol: str
    far_symbol: str
    any_symbol: str
    about_near: str
    lanes: int
    bytes: int
    any_sign: AnySign


def trig_preamble(prefix: str, real: Real, far: Far = "libm") -> TrigPreamble:
    """Return the data of the template preamble.jinja. In this module, `prefix` is the robot's identifier, and `far`
    says how angles outside the usual range are computed."""
    return TrigPreamble(_macro(prefix), real, far == "libm")


def scalar_trig(prefix: str, real: Real, far: Far = "libm", short: bool = False) -> ScalarTrig:
    """Return the data of the template sincos_scalar.jinja, for the C function <prefix>_sincos_f64 or _f32. This
    function takes pointers to the angle and to the two results.

    short  True: the rounded number of quarter revolutions has the C type int. This avoids a function call on machines
           without wider integers
    """
    suffix = _suffix(real)
    return ScalarTrig(
        macro=_macro(prefix),
        symbol=f"{prefix}_sincos_{suffix}",
        about=_about(real, far),
        real=real,
        integer=SIGNED[real],
        vec=real,
        ivec=f"unsigned {SIGNED[real]}",
        to_bits=f"{prefix}_bits_of_{suffix}",
        to_real=f"{prefix}_{suffix}_of_bits",
        keep=f"{_macro(prefix)}_KEEP_SCALAR",
        sign=f"{prefix}_bits_of_{suffix}({plain_number(-0.0, real)})",
        limit=f"{prefix}_bits_of_{suffix}({plain_number(NUMBERS[real].limit, real)})",
        odd="0 - (index & 1)",
        uses_libm=far == "libm",
        constants=constants(real),
        rounded="int" if short else SIGNED[real],
    )


def vector_trig(prefix: str, real: Real, unit: VectorUnit, far: Far = "libm") -> VectorTrig:
    """Return the data of the template sincos_vector.jinja, for a C function <prefix>_sincos_f64x8 and so on. `unit` is
    the kind of SIMD registers that the function uses. The vector types are called <prefix>_f64x8, <prefix>_i64x8 and so
    on, as in types.jinja."""
    bits = NUMBERS[real].bits
    lanes = unit.bytes * 8 // bits
    suffix = f"{_suffix(real)}x{lanes}"
    vec, ivec = f"{prefix}_{suffix}", f"{prefix}_i{bits}x{lanes}"
    return VectorTrig(
        macro=_macro(prefix),
        symbol=f"{prefix}_sincos_{suffix}",
        near_symbol=f"{prefix}_sincos_near_{suffix}",
        far_symbol=f"{prefix}_sincos_far_{suffix}",
        any_symbol=f"{prefix}_any_sign_{suffix}",
        about=_about(real, far),
        about_near=f"{_accuracy(real)}; beyond, the sign bit of far. Needs round-to-nearest.",
        real=real,
        integer=SIGNED[real],
        vec=vec,
        ivec=ivec,
        to_bits=f"({ivec})",
        to_real=f"({vec})",
        keep=f"{_macro(prefix)}_KEEP_{unit.bytes}",
        sign=f"({ivec})({vec}){_filled(-0.0, real, lanes)}",
        limit=f"({ivec})({vec}){_filled(NUMBERS[real].limit, real, lanes)}",
        odd=f"(index << {bits - 1}) >> {bits - 1}",
        uses_libm=far == "libm",
        constants=constants(real),
        rounded=SIGNED[real],
        lanes=lanes,
        bytes=unit.bytes,
        any_sign=_any_sign(real, unit, lanes, vec, ivec),
    )


def _any_sign(real: Real, unit: VectorUnit, lanes: int, vec: str, ivec: str) -> AnySign:
    """The unit's instruction for it where there is one; else all lanes or-ed together."""
    plain, mask = " | ".join(f"(*bits)[{lane}]" for lane in range(lanes)), unit.sign_mask
    if mask is None:
        return AnySign("", "", plain)
    cast = vec if mask.operand == "real" else ivec
    builtin = mask.float64 if real == "double" else mask.float32
    return AnySign(mask.macro, f"{builtin}(({cast})*bits) != 0", plain)


def _macro(prefix: str) -> str:
    return f"{prefix.upper()}_TRIG"


def _suffix(real: Real) -> str:
    return f"f{NUMBERS[real].bits}"


def _filled(value: float, real: Real, lanes: int) -> str:
    """Initialiser of a vector with that value in every lane."""
    return "{" + ", ".join([plain_number(value, real)] * lanes) + "}"


def _about(real: Real, far: Far) -> str:
    beyond = "libm's sine and cosine" if far == "libm" else "NaN"
    return f"{_accuracy(real)}; beyond, {beyond}. Needs round-to-nearest."


def _accuracy(real: Real) -> str:
    limit = plain_number(NUMBERS[real].limit, "double")
    return f"Sine and cosine, error below 1 ulp for |x| <= {limit} rad"


# The numbers of the inline sincos as C text


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
