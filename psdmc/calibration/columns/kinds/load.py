"""Friction that grows with the torque that the joint carries: value * |torque of the rigid bodies| * smooth sign."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.columns.effect import Effect, Kind, Unknown
from psdmc.calibration.columns.flags import joints_of
from psdmc.calibration.columns.rubbing import Rubbing
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism

NAME = "load_friction"


def term(sign: Array, speed: Array, load: Array) -> Array:
    """The load's size against the motion."""
    return np.asarray(sign * np.abs(load))


def _read(table: TomlTable, chain: Mechanism) -> tuple[Effect, ...]:
    joints = joints_of(table.content["load"], f"{table.where}: load", chain, table.faults)
    unknowns = tuple(Unknown(chain.joint_names[k], NAME, "1") for k in joints)
    return (Rubbing(unknowns, joints, (term,) * len(joints), by_load=True),) if joints else ()


KIND = Kind("load", "friction", (), _read)
