"""The SIMD vectors of a package, and the code of sines and cosines on these vectors, as data for the templates."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.backends.c.expressions import c_real
from psdmc.backends.c.lanes import VectorWidth, vector_widths
from psdmc.backends.c.limbs import LimbVector, limb_units, limb_vectors
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
from psdmc.target.vectors import FLOATS_STAY, HAS_VECTORS, LANE_BLOCK_BYTES


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
