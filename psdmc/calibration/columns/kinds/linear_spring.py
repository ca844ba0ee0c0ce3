"""A spring whose tension grows with a length: the distance of two points, or a sum of joint positions."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.columns.effect import (
    Effect,
    Kind,
    Spring,
    Unknown,
    anchored_way,
    flag,
    jointed_way,
    pull,
    rub,
    stretch,
)
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism

LONGEST = 200.0
"""m, of a spring at rest, or of a cable's way."""


def _read(table: TomlTable, chain: Mechanism) -> tuple[Effect, ...]:
    """`rest` (m): the length without tension. Left out: along joints zero, as their offsets hold what is wrong with it;
    between points the tension at the length with all joints at zero is found, too."""
    name = table.text("name")
    along = table.has("joints")
    if along and (table.has("from") or table.has("to")):
        table.faults.append(f"{table.where}: `joints` with `from` and `to`: expected one of them")
    way = jointed_way(table, chain) if along else anchored_way(table, chain)
    if table.faults:
        return ()
    unknowns, laws = [Unknown(name, "stiffness", "N/m")], [stretch]
    at_zero = float(way.length(np.zeros((1, chain.nv)))[0][0])
    if not along and not table.has("rest"):
        unknowns.insert(0, Unknown(name, "force", "N", never_negative=False))
        laws.insert(0, pull)
    if flag(table, "friction"):
        unknowns.append(Unknown(name, "friction", "N"))
        laws.append(rub)
    reference = table.number("rest", -LONGEST, LONGEST, 0.0 if along else at_zero)
    return (Spring(tuple(unknowns), tuple(laws), way, reference),)


KIND = Kind("linear", ("from", "to", "joints", "rest", "friction"), _read)
