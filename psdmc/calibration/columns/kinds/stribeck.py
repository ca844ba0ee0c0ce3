"""The Stribeck effect: Coulomb friction is larger near rest, by value * exp(-(speed / v_s)^2) at given speeds v_s.

Linear in the values, so that they belong to the one vector and its one prior, the semidefinite program stays convex and rows
stay additive. A speed that is not known is found by giving several: their sum follows any curve that falls from rest on.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from psdmc.calibration.columns.effect import Effect, Kind, Unknown
from psdmc.calibration.columns.flags import joints_of
from psdmc.calibration.columns.rubbing import Rubbing
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable, is_number, shown
from psdmc.robot.mechanism import Mechanism

SPEEDS = (1e-4, 100.0)
"""rad/s (m/s), of a Stribeck velocity."""
MOST_SPEEDS = 6


def name_of(speed: float) -> str:
    """Name of the value that belongs to one speed (rad/s or m/s), in records."""
    return f"stribeck_{float(speed)!r}"


def term(sign: Array, speed: Array, load: Array, own: float) -> Array:
    """The smooth sign, less and less of it above the speed `own`."""
    return np.asarray(sign * np.exp(-((speed / own) ** 2)))


def _read(table: TomlTable, chain: Mechanism) -> tuple[Effect, ...]:
    where = f"{table.where}: stribeck"
    own = TomlTable(table.content["stribeck"], where, ("speeds", "joints"), table.faults)
    speeds = own.items("speeds")
    low, high = SPEEDS
    if not 0 < len(speeds) <= MOST_SPEEDS or not all(is_number(v) and low <= v <= high for v in speeds):
        table.faults.append(
            f"{where}: speeds: found {shown(own.content.get('speeds', []))}, expected 1 to {MOST_SPEEDS} numbers from "
            f"{low:g} to {high:g} rad/s (m/s)"
        )
        return ()
    if len({name_of(v) for v in speeds}) < len(speeds):
        table.faults.append(f"{where}: speeds: one of them twice")
    joints = joints_of(own.content.get("joints", True), f"{where}: joints", chain, table.faults)
    each = [(k, float(v)) for k in joints for v in speeds]
    unknowns = [
        Unknown(chain.joint_names[k], name_of(v), chain.joints[k].type.effort_unit.replace(" ", ""))
        for k, v in each
    ]
    terms = tuple(partial(term, own=v) for _, v in each)
    return (Rubbing(tuple(unknowns), tuple(k for k, _ in each), terms),) if each else ()


KIND = Kind("stribeck", "friction", (), _read)
