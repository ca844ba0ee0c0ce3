"""A constant torque of some joints only; where all or none have one, plain friction has it."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.columns.effect import Effect, Kind, Unknown
from psdmc.calibration.columns.flags import joints_of
from psdmc.calibration.columns.rubbing import Rubbing
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism

NAME = "offset"


def term(sign: Array, speed: Array, load: Array) -> Array:
    """One."""
    return np.ones_like(sign)


def _read(table: TomlTable, chain: Mechanism) -> tuple[Effect, ...]:
    value = table.content["offset"]
    joints = joints_of(value, f"{table.where}: offset", chain, table.faults)
    if isinstance(value, bool) or not joints:
        return ()
    unknowns = tuple(
        Unknown(chain.joint_names[k], NAME, chain.joints[k].type.effort_unit.replace(" ", ""), False)
        for k in joints
    )
    return (Rubbing(unknowns, joints, (term,) * len(joints)),)


KIND = Kind("offset", "friction", (), _read)
