"""A gas spring between points of two links: its nearly constant force pushes, and grows as it shortens."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.columns.effect import (
    Effect,
    Kind,
    Spring,
    Unknown,
    anchored_way,
    flag,
    push,
    rub,
    stretch,
)
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism

LONGEST = 200.0
"""m, of a spring."""


def _read(table: TomlTable, chain: Mechanism) -> tuple[Effect, ...]:
    """`length` (m): where the force is stated; left out: the length with all joints at zero."""
    name, way = table.text("name"), anchored_way(table, chain)
    if table.faults:
        return ()
    at_zero = float(way.length(np.zeros((1, chain.nv)))[0][0])
    reference = table.number("length", 0.0, LONGEST, at_zero)
    unknowns, laws = [Unknown(name, "force", "N"), Unknown(name, "rate", "N/m")], [push, stretch]
    if flag(table, "friction"):
        unknowns.append(Unknown(name, "friction", "N"))
        laws.append(rub)
    return (Spring(tuple(unknowns), tuple(laws), way, reference),)


KIND = Kind("gas", ("from", "to", "length", "friction"), _read)
