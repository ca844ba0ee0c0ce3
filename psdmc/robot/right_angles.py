"""A warning about angles that are nearly right, but written with so few digits that snapping leaves them as they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from psdmc.robot.limits import shown

DIGITS = (2, 3, 4, 5)
"""Digits behind the point. An angle that a calibration found has more of them, and is no right angle."""
MOST = 8
"""Joints in one note."""


def coarse_right_angles(angles: Mapping[str, Sequence[float]], snap: float) -> tuple[str, ...]:
    """A note where joints have multiples of pi/2 rounded to these digits, further than `snap` (rad) from the exact ones;
    none where the file's angles are wanted as they are (snap 0).

    angles  rad, by the joint's name
    """
    found = {name: coarse for name, own in angles.items() if (coarse := _coarse(own, snap))}
    if not found or snap == 0.0:
        return ()
    each = [f"{shown(name)} ({', '.join(f'{x:g}' for x in own)})" for name, own in found.items()]
    said = ", ".join(each[:MOST]) + (f" and {len(each) - MOST} more" if len(each) > MOST else "")
    off = max(_off(x) for own in found.values() for x in own)
    return (
        f"right angles written with few digits, at joint(s) {said}: kept as written, up to {off:.1e} rad off; "
        f"--snap {_rounded_up(off):g} takes them for exact",
    )


def _coarse(angles: Sequence[float], snap: float) -> list[float]:
    return [x for x in angles if _off(x) > snap and any(x == round(_nearest(x), d) for d in DIGITS)]


def _nearest(angle: float) -> float:
    """The multiple of pi/2 that is nearest."""
    return round(angle / (math.pi / 2)) * (math.pi / 2)


def _off(angle: float) -> float:
    return abs(angle - _nearest(angle))


def _rounded_up(size: float) -> float:
    """To one digit."""
    unit = 10.0 ** math.floor(math.log10(size))
    return math.ceil(size / unit) * unit
