"""What a user may choose about an emitted package."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.target.native import NATIVE
from psdmc.target.target import Real, Target, Trig
from psdmc.target.vectors import LANE_BLOCK_BYTES


@dataclass(frozen=True, slots=True)
class EmitOptions:
    """Choices of emission.

    real    precision of the whole package
    trig    'inline': psdmc's own branch-free vector sincos, the library's for angles beyond its range; 'freestanding':
            the same without a library, NaN beyond; 'libm': the library's sin and cos
    target  the machine; its own precision and sines are what the two above default to for users
    """

    real: Real = "float64"
    trig: Trig = "inline"
    target: Target = NATIVE

    @property
    def lanes(self) -> int:
        """States per block of the lane-by-lane layout, the same for every target."""
        return LANE_BLOCK_BYTES // self.real_bytes

    @property
    def real_bytes(self) -> int:
        return 8 if self.real == "float64" else 4
