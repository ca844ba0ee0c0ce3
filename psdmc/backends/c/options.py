"""What a user may choose about the emitted C."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from psdmc.backends.c.trig import Far
from psdmc.target.native import NATIVE
from psdmc.target.target import Real, Target, Trig
from psdmc.target.vectors import LANE_BLOCK_BYTES

CReal = Literal["double", "float"]


@dataclass(frozen=True, slots=True)
class EmitOptions:
    """Choices of emission.

    real    precision of the whole package
    trig    'inline': psdmc's own branch-free vector sincos, libm for angles beyond its range; 'freestanding': the same
            without a library, NaN beyond; 'libm': the C library's sin and cos
    target  the machine; its own precision and sines are what the two above default to for users
    """

    real: Real = "float64"
    trig: Trig = "inline"
    target: Target = NATIVE

    @property
    def c_real(self) -> CReal:
        return "double" if self.real == "float64" else "float"

    @property
    def far(self) -> Far:
        """What becomes of angles beyond the inline sincos's range."""
        return "nan" if self.trig == "freestanding" else "libm"

    @property
    def lanes(self) -> int:
        """States per block of the lane-by-lane layout, the same for every target."""
        return LANE_BLOCK_BYTES // self.real_bytes

    @property
    def real_bytes(self) -> int:
        return 8 if self.real == "float64" else 4
