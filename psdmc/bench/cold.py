"""How much memory has to be read before nothing of a call is in a cache."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from psdmc.robot.mechanism import Array

CACHES = Path("/sys/devices/system/cpu/cpu0/cache")
"""Where Linux describes them."""

CALLS = 25
"""Cold calls per contestant and round: a sweep takes milliseconds."""

LEAST, MOST = 1 << 26, 1 << 28
"""Bytes swept at least, also where the system does not say how large its caches are, and at most."""

UNITS = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}


@cache
def swept_memory() -> Array:
    """Memory of twice the largest cache's size, within LEAST and MOST; every page is written, so that it is one of its
    own."""
    largest = max(map(_bytes, CACHES.glob("index*/size")), default=0)
    return np.ones(min(max(2 * largest, LEAST), MOST) // 8)


def _bytes(size: Path) -> int:
    """The number in a file such as "32768K"; zero where it holds none."""
    text = size.read_text(encoding="ascii").strip()
    number, unit = text.rstrip("KMG"), text[-1:]
    return int(number) * UNITS.get(unit, 1) if number.isdecimal() else 0
