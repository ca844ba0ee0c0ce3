"""The numbers and names of the inline sincos in the generated C: views for `templates/trig/`.

    q = k pi/2 + r,  k = round(2 q / pi),  |r| <= pi/4        pi/2 in parts whose products with k are exact
    sin r = r - r^3 P(r^2)        cos r = 1 - r^2/2 + r^4 Q(r^2)

and k mod 4 says which of the two is sine, which cosine, and their signs. docs/trigonometry.md derives the
error bounds; tests/trig/minimax.py is where the numbers come from, and a test holds them to it.

How a generated C file gets it, `templates/trig/` being rendered with `trig=` one of these views:

    preamble.jinja         trig_preamble(prefix, real, far)       once per C file
    #if HAS_VECTORS
    types.jinja            vector_trig(prefix, real, lanes, far)  unless the file has such types itself
    sincos_vector.jinja    the same view                          <symbol>(const vec *x, vec *s, vec *c)
    #else
    sincos_scalar.jinja    scalar_trig(prefix, real, far)         <symbol>(const real *x, real *s, real *c)
    #endif
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from psdmc.errors import InternalError

Real = Literal["double", "float"]
Far = Literal["libm", "nan"]
"""What an angle beyond the limit gives: libm's sine and cosine on a rare branch, or NaN (freestanding)."""

HAS_VECTORS = "defined(__GNUC__) && (!defined(__i386__) || defined(__SSE2_MATH__))"
"""Compilers with GCC's vector extension, x87 aside: its excess precision would break the rounding of k."""

VECTOR_BYTES = (16, 32, 64)

SIGNED: dict[Real, str] = {"double": "long long", "float": "int"}
"""Signed integer as wide as a real, as C spells it and as GCC's builtins want it."""

MOVE_MASK: dict[tuple[Real, int], tuple[str, str, str]] = {
    ("double", 2): ("__SSE2__", "__builtin_ia32_movmskpd", "real"),
    ("double", 4): ("__AVX__", "__builtin_ia32_movmskpd256", "real"),
    ("double", 8): ("__AVX512DQ__", "__builtin_ia32_cvtq2mask512", "integer"),
    ("float", 4): ("__SSE2__", "__builtin_ia32_movmskps", "real"),
    ("float", 8): ("__AVX__", "__builtin_ia32_movmskps256", "real"),
    ("float", 16): ("__AVX512DQ__", "__builtin_ia32_cvtd2mask512", "integer"),
}
"""Sign bits of all lanes as one integer: macro where it exists, its name in GCC and clang, its operand."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """One precision's numbers; up to limit [rad], k times each part of pi/2 but the last is exact."""

    two_over_pi: float
    half_pi: tuple[float, ...]
    sin_terms: tuple[float, ...]
    cos_terms: tuple[float, ...]
    limit: float
    digits: int
    bits: int


NUMBERS: dict[Real, Numbers] = {
    "double": Numbers(
        two_over_pi=float.fromhex("0x1.45f306dc9c883p-1"),
        half_pi=(
            float.fromhex("0x1.921fb5444p+0"),
            float.fromhex("0x1.68c234c4cp-39"),
            float.fromhex("0x1.98a2e03707345p-77"),
        ),
        sin_terms=(
            float.fromhex("0x1.5555555555548p-3"),
            float.fromhex("-0x1.111111110f750p-7"),
            float.fromhex("0x1.a01a019bef683p-13"),
            float.fromhex("-0x1.71de355bf0914p-19"),
            float.fromhex("0x1.ae5e5196ad133p-26"),
            float.fromhex("-0x1.5d8d45baae607p-33"),
        ),
        cos_terms=(
            float.fromhex("0x1.555555555554bp-5"),
            float.fromhex("-0x1.6c16c16c15005p-10"),
            float.fromhex("0x1.a01a019c8c7ebp-16"),
            float.fromhex("-0x1.27e4f7ef0fb2cp-22"),
            float.fromhex("0x1.1ee9d9c92ad75p-29"),
            float.fromhex("-0x1.8fa5556f03cf5p-37"),
        ),
        limit=1e5,
        digits=53,
        bits=64,
    ),
    "float": Numbers(
        two_over_pi=float.fromhex("0x1.45f306p-1"),
        half_pi=(
            float.fromhex("0x1.9218p+0"),
            float.fromhex("0x1.ed5p-14"),
            float.fromhex("0x1.10bp-30"),
            float.fromhex("0x1.184698p-44"),
        ),
        sin_terms=(
            float.fromhex("0x1.555546p-3"),
            float.fromhex("-0x1.110774p-7"),
            float.fromhex("0x1.9951fep-13"),
        ),
        cos_terms=(
            float.fromhex("0x1.55554ap-5"),
            float.fromhex("-0x1.6c0c28p-10"),
            float.fromhex("0x1.99e81ap-16"),
        ),
        limit=1e3,
        digits=24,
        bits=32,
    ),
}


def c_number(value: float, real: Real) -> str:
    """A C99 literal that reads back exactly: hexadecimal, without trailing zeros."""
    mantissa, _, exponent = value.hex().partition("p")
    head, _, digits = mantissa.partition(".")
    digits = digits.rstrip("0")
    text = f"{head}.{digits}p{exponent}" if digits else f"{head}p{exponent}"
    return text + ("f" if real == "float" else "")


def polynomial(coefficients: tuple[float, ...], real: Real) -> str:
    """C expression in z and z2 = z^2, constant term first: pairs (Estrin), half as deep as Horner's form."""
    c = [c_number(value, real) for value in coefficients]
    pairs = [f"({' + z * '.join(c[i : i + 2])})" for i in range(0, len(c), 2)]
    text = pairs[-1]
    for pair in reversed(pairs[:-1]):
        text = f"({pair} + z2 * {text})"
    return text


@dataclass(frozen=True, slots=True)
class ReductionStep:
    """C names of one subtraction `to = of - turn`, turn = k part; what it rounds away goes to `lost`."""

    to: str
    of: str
    part: str
    turn: str
    lost: str


@dataclass(frozen=True, slots=True)
class AnySign:
    """C test whether any lane of `beyond` is negative: `c` where `guard` is defined, else `plain` < 0."""

    guard: str
    c: str
    plain: str


@dataclass(frozen=True, slots=True)
class Constants:
    """C text of one precision's numbers, for the templates; integers act on the bits of a real."""

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


@dataclass(frozen=True, slots=True)
class TrigPreamble:
    """View of preamble.jinja."""

    macro: str
    real: Real
    uses_libm: bool


@dataclass(frozen=True, slots=True)
class ScalarTrig:
    """View of sincos_scalar.jinja: vec is the real type itself, ivec an unsigned integer of its size."""

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


@dataclass(frozen=True, slots=True)
class VectorTrig:
    """View of sincos_vector.jinja and types.jinja: vec is lanes x real, ivec lanes x integer (signed)."""

    macro: str
    symbol: str
    far_symbol: str
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
    lanes: int
    bytes: int
    any_sign: AnySign


def trig_preamble(prefix: str, real: Real, far: Far = "libm") -> TrigPreamble:
    """View of preamble.jinja; prefix is the robot's identifier, as in every view here."""
    return TrigPreamble(_macro(prefix), real, far == "libm")


def scalar_trig(prefix: str, real: Real, far: Far = "libm") -> ScalarTrig:
    """View of sincos_scalar.jinja: <prefix>_sincos_f64 or _f32, angle and results behind pointers."""
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
        sign=f"{prefix}_bits_of_{suffix}({_plain(-0.0, real)})",
        limit=f"{prefix}_bits_of_{suffix}({_plain(NUMBERS[real].limit, real)})",
        odd="0 - (index & 1)",
        uses_libm=far == "libm",
        constants=constants(real),
    )


def vector_trig(
    prefix: str, real: Real, lanes: int, far: Far = "libm", vec: str | None = None, ivec: str | None = None
) -> VectorTrig:
    """View of sincos_vector.jinja: <prefix>_sincos_f64x8 and so on, for vectors of 16, 32 or 64 bytes.

    vec and ivec name types that the C file has; by default types.jinja's <prefix>_f64x8, <prefix>_i64x8.
    """
    bits = NUMBERS[real].bits
    size = lanes * bits // 8
    if size not in VECTOR_BYTES:
        raise InternalError(
            f"no sincos for {lanes} lanes of {real}: {size} bytes, expected one of {VECTOR_BYTES}"
        )
    suffix = f"{_suffix(real)}x{lanes}"
    vec = vec or f"{prefix}_{suffix}"
    ivec = ivec or f"{prefix}_i{bits}x{lanes}"
    return VectorTrig(
        macro=_macro(prefix),
        symbol=f"{prefix}_sincos_{suffix}",
        far_symbol=f"{prefix}_sincos_far_{suffix}",
        about=_about(real, far),
        real=real,
        integer=SIGNED[real],
        vec=vec,
        ivec=ivec,
        to_bits=f"({ivec})",
        to_real=f"({vec})",
        keep=f"{_macro(prefix)}_KEEP_{size}",
        sign=f"({ivec})({vec}){_filled(-0.0, real, lanes)}",
        limit=f"({ivec})({vec}){_filled(NUMBERS[real].limit, real, lanes)}",
        odd=f"(index << {bits - 1}) >> {bits - 1}",
        uses_libm=far == "libm",
        constants=constants(real),
        lanes=lanes,
        bytes=size,
        any_sign=_any_sign(real, lanes, vec, ivec),
    )


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
        zero=_plain(0.0, real),
        half=_plain(0.5, real),
        one=_plain(1.0, real),
        limit=_plain(numbers.limit, real),
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


def _any_sign(real: Real, lanes: int, vec: str, ivec: str) -> AnySign:
    """x86's move-mask where there is one; else all lanes or-ed together."""
    guard, builtin, operand = MOVE_MASK[real, lanes]
    cast = vec if operand == "real" else ivec
    return AnySign(
        guard, f"{builtin}(({cast})beyond) != 0", " | ".join(f"beyond[{lane}]" for lane in range(lanes))
    )


def _macro(prefix: str) -> str:
    return f"{prefix.upper()}_TRIG"


def _suffix(real: Real) -> str:
    return f"f{NUMBERS[real].bits}"


def _plain(value: float, real: Real) -> str:
    return repr(value) + ("f" if real == "float" else "")


def _filled(value: float, real: Real, lanes: int) -> str:
    """Initialiser of a vector with that value in every lane."""
    return "{" + ", ".join([_plain(value, real)] * lanes) + "}"


def _about(real: Real, far: Far) -> str:
    beyond = "libm's sine and cosine" if far == "libm" else "NaN"
    return (
        f"Sine and cosine, error below 1 ulp for |x| <= {_plain(NUMBERS[real].limit, 'double')} rad; "
        f"beyond, {beyond}. Needs round-to-nearest."
    )
