"""The vectors of the generated C: which widths there are, and how a square of them is transposed in registers."""

from __future__ import annotations

from dataclasses import dataclass, replace

from psdmc.backends.c.store_groups import GROUP
from psdmc.backends.options import EmitOptions
from psdmc.target.vectors import VectorUnit


@dataclass(frozen=True, slots=True)
class TransposeStage:
    """One step of Eklundh's transposition: vectors i and i + distance exchange blocks of `distance` lanes.

    first, second  lanes of the pair (0 ... 2 width - 1) that the new vectors i and i + distance consist of
    """

    distance: int
    first: str
    second: str


@dataclass(frozen=True, slots=True)
class VectorWidth:
    """One vector size that the target may have: reals per vector, and the integer as wide as a real."""

    lanes: int
    unit: VectorUnit
    integer: str

    @property
    def angles(self) -> VectorWidth:
        """The vectors that take one state's angles where these are the widest."""
        narrower = self.unit.narrower
        if narrower is None:
            return self
        return replace(self, lanes=self.lanes * narrower.unit.bytes // self.unit.bytes, unit=narrower.unit)

    @property
    def stages(self) -> tuple[TransposeStage, ...]:
        """The steps that transpose `lanes` vectors of `lanes` reals."""
        distances = [1 << k for k in range(self.lanes.bit_length() - 1)]
        return tuple(transpose_stage(self.lanes, distance) for distance in distances)

    @property
    def piece(self) -> int:
        """Neighbours of a row that are stored at once where outputs go into rows group by group."""
        return min(self.lanes, GROUP)

    @property
    def piece_stages(self) -> tuple[TransposeStage, ...]:
        """The steps that transpose each square of `piece` vectors and lanes."""
        return tuple(stage for stage in self.stages if stage.distance < self.piece)


def vector_widths(options: EmitOptions) -> tuple[VectorWidth, ...]:
    """Those of the target, widest first."""
    integer = "long long" if options.real == "float64" else "int"
    return tuple(
        VectorWidth(unit.bytes // options.real_bytes, unit, integer) for unit in options.target.vectors
    )


def transpose_stage(width: int, distance: int) -> TransposeStage:
    """The step that exchanges blocks of `distance` lanes, in vectors of `width`."""
    first = [k - distance + width if k & distance else k for k in range(width)]
    second = [k + width if k & distance else k + distance for k in range(width)]
    return TransposeStage(distance, ", ".join(map(str, first)), ", ".join(map(str, second)))
