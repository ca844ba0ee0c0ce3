"""The SIMD vectors of the generated C: which widths exist, and how a square block of them is transposed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from psdmc.backends.c.lines import GROUP
from psdmc.backends.info import EmitOptions
from psdmc.target.vectors import VectorUnit


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
