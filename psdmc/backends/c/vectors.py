"""The SIMD vectors of a package, and the code of sines and cosines on these vectors, as data for the templates.

A lane of a vector holds one state, one angle of a state, or one limb such as a leg.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from psdmc.backends.c.expressions import c_real
from psdmc.backends.c.limb_rows import FOUR
from psdmc.backends.c.lines import GROUP
from psdmc.backends.c.trig import (
    ScalarTrig,
    TrigPreamble,
    VectorTrig,
    far_of,
    scalar_trig,
    trig_preamble,
    vector_trig,
)
from psdmc.backends.info import EmitOptions
from psdmc.target.target import FLOATS_STAY, HAS_VECTORS, LANE_BLOCK_BYTES, VectorUnit


@dataclass(frozen=True, slots=True)
class TransposeStage:
    """One step of Eklundh's transposition of a matrix in SIMD registers. In this step, the vectors i and i + distance
    exchange groups of `distance` lanes.

    distance       difference of the numbers of the two vectors, in lanes of each group
    first, second  C text of the lane numbers that form the new vectors i and i + distance; the lanes of both old
                   vectors are numbered from 0 to 2 width - 1
    """

    distance: int
    first: str
    second: str


@dataclass(frozen=True, slots=True)
class VectorWidth:
    """One SIMD vector size of a target machine.

    lanes    number of real numbers in a vector
    unit     registers of the machine
    integer  C integer type with the size of one real number
    """

    lanes: int
    unit: VectorUnit
    integer: str

    @property
    def angles(self) -> VectorWidth:
        """Return the vector size with which code for one state computes the sines of several angles at once. The size
        is for machines whose widest vectors have the size of this object. It is smaller than the widest size if wide
        vectors would slow the other code."""
        narrower = self.unit.narrower
        if narrower is None:
            return self
        return replace(self, lanes=self.lanes * narrower.unit.bytes // self.unit.bytes, unit=narrower.unit)

    @property
    def stages(self) -> tuple[TransposeStage, ...]:
        """Return the steps that transpose a block of `lanes` vectors with `lanes` real numbers each in registers."""
        distances = [1 << k for k in range(self.lanes.bit_length() - 1)]
        return tuple(transpose_stage(self.lanes, distance) for distance in distances)

    @property
    def piece(self) -> int:
        """Return how many neighbouring entries of an output row are stored at once in groups of outputs."""
        return min(self.lanes, GROUP)

    @property
    def piece_stages(self) -> tuple[TransposeStage, ...]:
        """Return the steps that transpose, in registers, a square block of `piece` vectors with `piece` lanes each."""
        return tuple(stage for stage in self.stages if stage.distance < self.piece)


def vector_widths(options: EmitOptions) -> tuple[VectorWidth, ...]:
    """Return the vector widths of the target, widest first."""
    integer = "long long" if options.real == "float64" else "int"
    return tuple(
        VectorWidth(unit.bytes // options.real_bytes, unit, integer) for unit in options.target.vectors
    )


def transpose_stage(width: int, distance: int) -> TransposeStage:
    """Return the step of a transposition that exchanges groups of `distance` lanes between vectors of `width`."""
    first = [k - distance + width if k & distance else k for k in range(width)]
    second = [k + width if k & distance else k + distance for k in range(width)]
    return TransposeStage(distance, ", ".join(map(str, first)), ", ".join(map(str, second)))


# Vectors with one real number per limb, such as a leg


NARROWEST = 16
"""Bytes of the narrowest vector."""


@dataclass(frozen=True, slots=True)
class LimbWidth:
    """A C vector type that holds one real number for each of `count` limbs (such as legs). It consists of one or more
    registers of `lanes` numbers each. Lanes after the last limb repeat the first limb."""

    count: int
    lanes: int

    @property
    def parts(self) -> int:
        """Registers."""
        return -(-self.count // self.lanes)

    @property
    def filled(self) -> str:
        """Return the C initialiser of a vector of limbs from macro arguments, one per limb (such as a leg)."""
        names = [names_of(self.count)[k if k < self.count else 0] for k in range(self.parts * self.lanes)]
        parts = (names[k : k + self.lanes] for k in range(0, len(names), self.lanes))
        return ", ".join(f"{{{', '.join(part)}}}" for part in parts)

    @property
    def whole(self) -> int:
        """Parts without a lane to spare."""
        return self.count // self.lanes

    @property
    def folds(self) -> tuple[str, ...]:
        """Return the lane orders with which the lanes of a register are summed. In each step, one half of the lanes is
        added to the other half, until two lanes are left."""
        distances = [self.lanes >> k for k in range(1, self.lanes.bit_length() - 1)]
        return tuple(", ".join(str(lane ^ distance) for lane in range(self.lanes)) for distance in distances)

    @property
    def piece(self) -> int:
        """Return how many neighbouring outputs of one limb a vector holds when it is stored, at most four."""
        return min(self.lanes, FOUR)

    @property
    def stages(self) -> tuple[TransposeStage, ...]:
        """Return the steps that transpose, in registers, a square block of `piece` vectors with `piece` lanes each."""
        return tuple(transpose_stage(self.lanes, distance) for distance in (1, 2) if distance < self.piece)

    @property
    def beyond(self) -> tuple[int, ...]:
        """Return the lanes of the last register that hold limbs (such as legs), if the limbs do not fill the register."""
        return tuple(range(self.count % self.lanes))


class NamedByCount:
    """C names of types and macros that contain a number of limbs, such as limbs4 for four legs."""

    __slots__ = ()
    count: int

    @property
    def name(self) -> str:
        return f"limbs{self.count}"

    @property
    def macro(self) -> str:
        return self.name.upper()


@dataclass(frozen=True, slots=True)
class LimbVector(NamedByCount):
    """The C vector types for one number of limbs, such as four legs. Each machine of the target uses the widest type
    that it supports.

    widths   possible register sizes, widest first
    integer  C integer type with the size of one real number
    """

    count: int
    widths: tuple[LimbWidth, ...]
    integer: str

    @property
    def in_fours(self) -> bool:
        """Return whether the number of limbs is a multiple of four, so that vectors of four have no empty lane."""
        return self.count % FOUR == 0

    @property
    def arguments(self) -> str:
        return ", ".join(names_of(self.count))


def names_of(count: int) -> list[str]:
    """Names of macro arguments, one per limb."""
    return [f"limb{k}" for k in range(count)]


def limb_vectors(counts: Collection[int], options: EmitOptions) -> tuple[LimbVector, ...]:
    """Return the C vector types for groups of limbs, whose numbers of limbs are `counts`."""
    narrowest = NARROWEST // options.real_bytes
    integer = "long long" if options.real == "float64" else "int"
    widest = max((unit.bytes // options.real_bytes for unit in options.target.vectors), default=1)
    found = []
    for count in sorted(set(counts)):
        enough = max(narrowest, 1 << (count - 1).bit_length())
        lanes = [narrowest << k for k in range(8) if narrowest << k <= min(enough, widest)]
        found.append(LimbVector(count, tuple(LimbWidth(count, each) for each in reversed(lanes)), integer))
    return tuple(found)


def limb_units(vectors: Sequence[LimbVector], options: EmitOptions) -> tuple[VectorUnit, ...]:
    """Return the register sizes that only the code for limbs (such as legs) uses. They are narrower than the registers
    that the target uses for other code."""
    wanted = {width.lanes * options.real_bytes for vector in vectors for width in vector.widths}
    halves: list[VectorUnit] = []
    for unit in options.target.vectors:
        narrower = unit.half
        while narrower is not None:
            halves.append(narrower)
            narrower = narrower.half
    return tuple(unit for unit in dict.fromkeys(halves) if unit.bytes in wanted)


# All vectors of a package, and their sines


@dataclass(frozen=True, slots=True)
class VectorsView:
    """The SIMD vectors of a package, and its sine and cosine code for them.

    robot   identifier with which every C name starts
    counts  numbers of limbs (such as 4 legs) that share a vector, over all functions
    """

    robot: str
    options: EmitOptions
    counts: tuple[int, ...]

    @property
    def condition(self) -> str:
        """Return the C preprocessor condition under which SIMD code is compiled. The compiler must have GCC's vector
        extension. For float, it must not compute with more digits than float has."""
        is_double = c_real(self.options) == "double"
        return HAS_VECTORS if is_double else f"{HAS_VECTORS} && {FLOATS_STAY}"

    @property
    def widths(self) -> tuple[VectorWidth, ...]:
        """Sizes that vectors.h chooses from, widest first."""
        return vector_widths(self.options)

    @property
    def block_bytes(self) -> int:
        """Return how many bytes one entry of q, or of another array, takes in a block with one state per lane."""
        return LANE_BLOCK_BYTES

    @property
    def of_limbs(self) -> tuple[LimbVector, ...]:
        """Vectors with one real per limb."""
        return limb_vectors(self.counts, self.options)

    @property
    def preamble(self) -> TrigPreamble:
        """The C code that the inline sines of all vector widths share."""
        return trig_preamble(self.robot, c_real(self.options), far_of(self.options.trig))

    @property
    def sines(self) -> tuple[VectorTrig, ...]:
        """Return the sine and cosine code for each register size that the header vectors.h may choose. The registers
        hold one state per lane, several angles of one state, or one limb per lane."""
        units = dict.fromkeys(width.unit for width in self.widths)
        units |= dict.fromkeys(width.angles.unit for width in self.widths)
        units |= dict.fromkeys(limb_units(self.of_limbs, self.options))
        return tuple(
            vector_trig(self.robot, c_real(self.options), unit, far_of(self.options.trig)) for unit in units
        )

    @property
    def scalar_sine(self) -> ScalarTrig:
        """The inline sincos of one angle."""
        return scalar_trig(self.robot, c_real(self.options), far_of(self.options.trig), short=not self.widths)

    @property
    def sincos_types(self) -> tuple[tuple[str, str], ...]:
        """Return the vectors whose sines are computed, as pairs: the C macro with the vector's width, and the C type."""
        limbs = ((f"{vector.macro}_WIDTH", vector.name) for vector in self.of_limbs)
        return (("WIDTH", "lanes"), ("ANGLE_WIDTH", "angles"), *limbs)
