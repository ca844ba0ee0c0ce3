"""The SIMD vectors of the generated C: which widths exist, and how a square block of vectors is transposed in
registers."""

from __future__ import annotations

from dataclasses import dataclass, replace

from psdmc.backends.c.store_groups import GROUP
from psdmc.backends.options import EmitOptions
from psdmc.target.vectors import VectorUnit


@dataclass(frozen=True, slots=True)
class TransposeStage:
    """One step of Eklundh's transposition: vectors i and i + distance exchange blocks of `distance` lanes.

    first, second  lanes of the pair (0 ... 2 width - 1) that form the new vectors i and i + distance
    """

    distance: int
    first: str
    second: str


@dataclass(frozen=True, slots=True)
class VectorWidth:
    """One vector size of a target: reals per vector, and the integer type as wide as a real."""

    lanes: int
    unit: VectorUnit
    integer: str

    @property
    def angles(self) -> VectorWidth:
        """The vectors that compute the sines of one state's angles, if vectors of this width are the widest."""
        narrower = self.unit.narrower
        if narrower is None:
            return self
        return replace(self, lanes=self.lanes * narrower.unit.bytes // self.unit.bytes, unit=narrower.unit)

    @property
    def stages(self) -> tuple[TransposeStage, ...]:
        """The steps of a transposition, in registers, of a square block: `lanes` vectors of `lanes` reals."""
        distances = [1 << k for k in range(self.lanes.bit_length() - 1)]
        return tuple(transpose_stage(self.lanes, distance) for distance in distances)

    @property
    def piece(self) -> int:
        """The number of neighbouring outputs of a row that are stored at once, if outputs go into rows group by group."""
        return min(self.lanes, GROUP)

    @property
    def piece_stages(self) -> tuple[TransposeStage, ...]:
        """The steps of the transpositions, in registers, of square blocks of `piece` vectors and `piece` lanes."""
        return tuple(stage for stage in self.stages if stage.distance < self.piece)


def vector_widths(options: EmitOptions) -> tuple[VectorWidth, ...]:
    """Those of the target, widest first."""
    integer = "long long" if options.real == "float64" else "int"
    return tuple(
        VectorWidth(unit.bytes // options.real_bytes, unit, integer) for unit in options.target.vectors
    )


def transpose_stage(width: int, distance: int) -> TransposeStage:
    """Return the step of a transposition that exchanges blocks of `distance` lanes, in vectors of `width` lanes."""
    first = [k - distance + width if k & distance else k for k in range(width)]
    second = [k + width if k & distance else k + distance for k in range(width)]
    return TransposeStage(distance, ", ".join(map(str, first)), ", ".join(map(str, second)))
