"""SIMD vector registers that a target may have, and the macros and types by which the C code uses them."""

from __future__ import annotations

from dataclasses import dataclass

HAS_VECTORS = "defined(__GNUC__) && (!defined(__i386__) || defined(__SSE2_MATH__))"
"""C condition: the compiler has GCC's vector extension and no x87, whose excess precision would break the rounding of
the inline sine."""

FLOATS_STAY = "(!defined(__FLT_EVAL_METHOD__) || __FLT_EVAL_METHOD__ == 0)"
"""C condition: expressions of floats are floats. Where they are doubles (s390x with -std=c99) a vector of floats times one
is an error, and the inline sine of floats rounds otherwise."""

LANE_BLOCK_BYTES = 64
"""Bytes of one variable in a block of the lane-by-lane layout. The same for every target: R_LANES is part of the
interface."""


@dataclass(frozen=True, slots=True)
class SignMask:
    """The processor instruction that puts the sign bits of all numbers in a SIMD vector into one integer.

    macro             macro that compilers predefine if the instruction exists
    float64, float32  name of the instruction in GCC and clang, for vectors of these types
    operand           type of the operand: 'real' or 'integer'
    """

    macro: str
    float64: str
    float32: str
    operand: str


@dataclass(frozen=True, slots=True)
class Narrower:
    """Narrower vector registers for the sines of a single state. They are for processors on which wide registers slow
    the other code, which computes single numbers.

    unit    the narrower registers
    unless  C condition that selects processors on which wide registers do not slow the other code
    """

    unit: VectorUnit
    unless: str


@dataclass(frozen=True, slots=True)
class VectorUnit:
    """A kind of SIMD vector registers, each of the size `bytes`.

    macro      macro that compilers predefine if the registers exist; the narrowest unit of a target needs none
    sign_mask  the instruction that collects sign bits; None: signs are read number by number
    narrower   registers for sines within code that computes single numbers; None: this kind
    half       registers of half the size on the same processors; None if not available or not needed
    """

    bytes: int
    macro: str = ""
    sign_mask: SignMask | None = None
    narrower: Narrower | None = None
    half: VectorUnit | None = None

    def __post_init__(self) -> None:
        if self.bytes not in (16, 32, 64):
            raise ValueError(f"no sincos for vectors of {self.bytes} bytes, expected 16, 32 or 64")


SSE2 = VectorUnit(
    16, "__SSE2__", SignMask("__SSE2__", "__builtin_ia32_movmskpd", "__builtin_ia32_movmskps", "real")
)
AVX = VectorUnit(
    32,
    "__AVX__",
    SignMask("__AVX__", "__builtin_ia32_movmskpd256", "__builtin_ia32_movmskps256", "real"),
    half=SSE2,
)
AVX512 = VectorUnit(
    64,
    "__AVX512F__",
    SignMask("__AVX512DQ__", "__builtin_ia32_cvtq2mask512", "__builtin_ia32_cvtd2mask512", "integer"),
    Narrower(AVX, unless="defined(__znver3__) || defined(__znver4__) || defined(__znver5__)"),
    half=AVX,
)
"""Intel's cores close one of their two ports for scalar arithmetic while instructions of 64 bytes wait; AMD's do not.
Compilers that do not know an AMD processor with AVX-512 yet take it for Zen 3."""
NEON = VectorUnit(16, "__ARM_NEON")

WIDEST_FIRST = (AVX512, AVX, SSE2)
