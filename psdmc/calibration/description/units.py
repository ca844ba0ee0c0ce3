"""Units of logged columns: their size in SI units, and what they imply about the joint."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Says = Literal["turning", "sliding", "current", "any"]
"""What a unit says: of a joint that turns, of one that slides, of a motor's current, or nothing."""

TICKS = ("ticks", "ticks/s")
"""Units whose size `ticks_per_rev` tells."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of a logged column. `size` is the factor to the SI unit (s, rad, m, rad/s, m/s, N m, N, A). `says` is what
    the unit implies about the joint: that it rotates or slides, or nothing."""

    size: float
    says: Says


TIME_UNITS: Mapping[str, Unit] = {
    "s": Unit(1.0, "any"),
    "ms": Unit(1e-3, "any"),
    "us": Unit(1e-6, "any"),
    "ns": Unit(1e-9, "any"),
}
POSITION_UNITS: Mapping[str, Unit] = {
    "rad": Unit(1.0, "turning"),
    "deg": Unit(math.pi / 180.0, "turning"),
    "rev": Unit(2.0 * math.pi, "turning"),
    "ticks": Unit(2.0 * math.pi, "turning"),
    "m": Unit(1.0, "sliding"),
    "mm": Unit(1e-3, "sliding"),
    "um": Unit(1e-6, "sliding"),
}
VELOCITY_UNITS: Mapping[str, Unit] = {
    "rad/s": Unit(1.0, "turning"),
    "deg/s": Unit(math.pi / 180.0, "turning"),
    "rev/s": Unit(2.0 * math.pi, "turning"),
    "rpm": Unit(2.0 * math.pi / 60.0, "turning"),
    "ticks/s": Unit(2.0 * math.pi, "turning"),
    "m/s": Unit(1.0, "sliding"),
    "mm/s": Unit(1e-3, "sliding"),
}
EFFORT_UNITS: Mapping[str, Unit] = {
    "Nm": Unit(1.0, "turning"),
    "mNm": Unit(1e-3, "turning"),
    "Ncm": Unit(1e-2, "turning"),
    "kNm": Unit(1e3, "turning"),
    "N": Unit(1.0, "sliding"),
    "kN": Unit(1e3, "sliding"),
    "A": Unit(1.0, "current"),
    "mA": Unit(1e-3, "current"),
}
CURRENTS = tuple(name for name, unit in EFFORT_UNITS.items() if unit.says == "current")
UNITS: Mapping[str, Mapping[str, Unit]] = {
    "position": POSITION_UNITS,
    "velocity": VELOCITY_UNITS,
    "effort": EFFORT_UNITS,
    "motor_position": POSITION_UNITS,
}
"""By quantity."""
