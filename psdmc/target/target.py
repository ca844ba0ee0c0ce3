"""The class Target describes the processor for which psdmc generates code: its vector registers, and the costs of its
operations. Only the files in this folder contain facts about processors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# Flags of C compilers, for builds of packages and for psdmc's own builds


ARITHMETIC = ("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")
"""Fused multiply-adds, and no errno or floating-point traps, which the C does not use."""

GCC_ONLY = ("-fno-tree-slp-vectorize",)
"""GCC packs pairs of one state's scalars into vectors and spends more on packing than it saves: mass matrix 7 %,
regressor up to 6 %. clang's own packing saves time in code for lanes."""


# Vector registers, and the macros and types by which C uses them


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


# Costs, by which psdmc chooses among equivalent programs


@dataclass(frozen=True, slots=True)
class Latency:
    """Number of processor cycles until the result of an operation can be used. Only the order of magnitude matters.

    fused   for a multiply-add; if the processor has none, for a product and a sum
    sincos  for the sine and cosine that psdmc writes into the code
    choice  for a comparison and the selection of a value by its result
    call    for an elementary function of the C library
    """

    load: int
    add: int
    mul: int
    fused: int
    div: int
    neg: int
    sincos: int
    choice: int
    call: int


@dataclass(frozen=True, slots=True)
class Costs:
    """Costs and thresholds by which psdmc chooses among equivalent programs. The unit of a weight is the cost of one
    addition. A lane is one element of a SIMD vector; code for lanes computes one state per lane.

    latency             processor cycles per operation, for the order of additions (fuse_sums)
    div, neg            weight of a division, of a change of sign
    fused               weight that a multiply-add saves compared with a product and a sum
    sincos              weight of one sincos (sine and cosine written into the code), which computes `angles_per_sincos`
                        angles
    choice              weight of a minimum, maximum, magnitude or selection
    call                weight of an elementary function of the C library; code for lanes calls it once per state
    angle               weight of each further angle in a sincos: to load it and to extract sine and cosine
    angles_per_sincos   angles per sincos in code for one state; 1 if the target has no vectors
    registers           number of registers for floating-point numbers; used if `spills_wait`
    spills_wait         whether a spilled value (without a register) delays the code, as on processors that run one
                        instruction after the other
    crowded             code for lanes uses the operation order of the code for one state, unless that order keeps this
                        many times more values alive
    worth_two_bodies    code for lanes gets a function body of its own if it is this factor cheaper
    worth_sharing       code for one state uses the arithmetic of the code for lanes if it costs at most this factor:
                        then one body is enough
    shared_from         number of additions in a function from which `worth_sharing` is considered
    loops_from          number of rows from which products of square matrices are loops in code for one state
    worth_limbs         equal limbs (such as legs) are computed in parallel lanes if the code is cheaper by at least
                        this factor
    limb_real           weight of moving one input or output of a limb into or out of its lane
    limb_shared         weight of copying one value of the robot's trunk into all lanes
    limb_sum            weight of a sum over the lanes
    longest_of_two      number of additions; a longer function with parameters at run time gets no second body, which
                        would take tens of kilobytes
    """

    latency: Latency
    div: float
    neg: float
    fused: float
    sincos: float
    choice: float
    call: float
    angle: float
    angles_per_sincos: int
    registers: int
    spills_wait: bool
    crowded: float
    worth_two_bodies: float
    worth_sharing: float
    shared_from: float
    longest_of_two: float
    worth_limbs: float
    limb_real: float
    limb_shared: float
    limb_sum: float
    loops_from: int

    @property
    def has_vectors(self) -> bool:
        """Return whether code that computes one state per SIMD lane differs from code for one state."""
        return self.angles_per_sincos > 1


# The target


Real = Literal["float64", "float32"]
Trig = Literal["inline", "libm", "freestanding"]
Form = Literal["single", "batch", "batch_soa"]
"""One state a call, one state per row, one state per lane."""

FORMS: tuple[Form, ...] = ("single", "batch", "batch_soa")


@dataclass(frozen=True, slots=True)
class Target:
    """A processor, and the form of the code that psdmc generates for this processor.

    about          description for people: what it is and what differs from the default
    real, trig     default of the precision and of the method of sines
    vectors        kinds of vector registers that the C code supports, widest first. The first kind whose macro is
                   defined is used, else the last; empty: plain C
    forms          forms of each function: for one state, for states in rows of an array, for one state per SIMD lane
    texts          whether the library contains tables of joint names, units and equations of parameters
    hosted         whether there is an operating system: shared libraries, position-independent code, threads
    cache_line     bytes of a cache line, which one prefetch loads
    blocks_ahead   how many blocks before their use a batch function prefetches its inputs
    flags          flags that the compiler must accept
    host_flags     flags for the machine at hand; the first that the compiler accepts is used. In a package, it is used
                   only if the package's user asks for it
    costs          costs by which psdmc chooses among programs
    tools          prefix of the names of the compiler and archiver; empty: those of the machine at hand
    """

    name: str
    about: str
    real: Real
    trig: Trig
    vectors: tuple[VectorUnit, ...]
    forms: tuple[Form, ...]
    texts: bool
    hosted: bool
    cache_line: int
    blocks_ahead: int
    flags: tuple[str, ...]
    host_flags: tuple[str, ...]
    costs: Costs
    tools: str = ""

    def __post_init__(self) -> None:
        widths = [unit.bytes for unit in self.vectors]
        if widths != sorted(set(widths), reverse=True):
            raise ValueError(f"{self.name}: vectors {widths} are not widest first")
        if not self.forms or self.forms != FORMS[: len(self.forms)]:
            raise ValueError(f"{self.name}: forms {self.forms} are no beginning of {FORMS}")
        if self.costs.has_vectors != bool(self.vectors):
            raise ValueError(f"{self.name}: {len(self.vectors)} vector units, but costs of another machine")

    @property
    def has_batches(self) -> bool:
        """Whether psdmc generates functions for many states."""
        return "batch" in self.forms
