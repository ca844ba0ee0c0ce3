"""Reads a known load that a user gives as four numbers or as the path of a load file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from psdmc.calibration.campaign_file import LARGEST_ARM, LARGEST_MASS, SMALLEST_MASS
from psdmc.calibration.identify.known_load import KnownLoad
from psdmc.calibration.payload_found import read_load
from psdmc.errors import InputError

HINT = "write MASS,X,Y,Z: kg, and m to the centre of mass in the tip's frame; or a load's file (.toml) with its inertia"


def given_load(source: str | Path | Sequence[float]) -> KnownLoad:
    """Return the known load from text 'MASS,X,Y,Z', from four numbers, or from a file that `psdmc payload` wrote. The
    numbers are the mass (kg) and the centre of mass (m, in the tip frame) of a point mass. Raises InputError if the
    load is wrong."""
    if isinstance(source, Path) or (isinstance(source, str) and source.lower().endswith(".toml")):
        found = read_load(source)
        return KnownLoad(found.mass, found.com, found.inertia, found.frame)
    words = source.split(",") if isinstance(source, str) else source
    try:
        numbers = [float(word) for word in words]
    except (TypeError, ValueError):
        raise InputError(f"load: {source!r} is no four numbers", HINT) from None
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise InputError(f"load: {source!r} is no four numbers", HINT)
    mass, *com = numbers
    if not SMALLEST_MASS <= mass <= LARGEST_MASS or max(map(abs, com)) > LARGEST_ARM:
        raise InputError(
            f"load: {mass:g} kg at {com}: expected {SMALLEST_MASS:g} to {LARGEST_MASS:g} kg within {LARGEST_ARM:g} m",
            HINT,
        )
    return KnownLoad(mass, np.array(com), np.zeros(6))
