"""The options of a generated package that a user can choose, such as its precision and target."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.target.native import NATIVE
from psdmc.target.target import Real, Target, Trig
from psdmc.target.vectors import LANE_BLOCK_BYTES


@dataclass(frozen=True, slots=True)
class EmitOptions:
    """The options with which a package is generated.

    real    precision of the whole package
    trig    'inline': psdmc's own branch-free vector sincos, the library's for angles outside its range; 'freestanding':
            the same without a library, NaN outside the range; 'libm': the library's sin and cos
    target  the machine; a target has a default precision and sincos for users who choose none
    """

    real: Real = "float64"
    trig: Trig = "inline"
    target: Target = NATIVE

    @property
    def lanes(self) -> int:
        """Number of states in one block of the lane-by-lane layout, the same for every target."""
        return LANE_BLOCK_BYTES // self.real_bytes

    @property
    def real_bytes(self) -> int:
        return 8 if self.real == "float64" else 4
