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
    trig    code of sine and cosine. 'inline': code without branches for SIMD vectors, and the C library for very large
            angles; 'freestanding': no C library, very large angles give NaN; 'libm': the C library only
    target  the target machine; some targets have their own defaults of `real` and `trig`
    """

    real: Real = "float64"
    trig: Trig = "inline"
    target: Target = NATIVE

    @property
    def lanes(self) -> int:
        """Return how many states a block of the batch layout [block][entry][lane] holds, equal for all machines."""
        return LANE_BLOCK_BYTES // self.real_bytes

    @property
    def real_bytes(self) -> int:
        return 8 if self.real == "float64" else 4
