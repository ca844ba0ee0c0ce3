"""What a user may choose about the emitted C."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from psdmc.emit.trig import Far

Real = Literal["float64", "float32"]
CReal = Literal["double", "float"]
Trig = Literal["inline", "libm", "freestanding"]


@dataclass(frozen=True, slots=True)
class EmitOptions:
    """Choices of emission.

    real  precision of the whole package
    trig  'inline': psdmc's own branch-free vector sincos, libm for angles beyond its range; 'freestanding': the same without
          a library, NaN beyond; 'libm': the C library's sin and cos
    """

    real: Real = "float64"
    trig: Trig = "inline"

    @property
    def c_real(self) -> CReal:
        return "double" if self.real == "float64" else "float"

    @property
    def far(self) -> Far:
        """What becomes of angles beyond the inline sincos's range."""
        return "nan" if self.trig == "freestanding" else "libm"

    @property
    def lanes(self) -> int:
        """States per block of the lane-by-lane layout: one 64-byte vector, on every machine."""
        return 8 if self.real == "float64" else 16
