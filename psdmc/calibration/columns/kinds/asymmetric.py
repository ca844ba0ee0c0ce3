"""Coulomb friction that differs between the directions: coulomb + asymmetry forward, coulomb - asymmetry backward.

Its column is the size of the smooth sign. It differs from an offset's near rest only: a fit with both shows little more
than their sum.
"""

from __future__ import annotations

import numpy as np

from psdmc.calibration.columns.effect import Effect, Kind, Unknown
from psdmc.calibration.columns.flags import joints_of
from psdmc.calibration.columns.rubbing import Rubbing
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism

NAME = "coulomb_asymmetry"


def term(sign: Array, speed: Array, load: Array) -> Array:
    """The size of the smooth sign."""
    return np.abs(sign)


def _read(table: TomlTable, chain: Mechanism) -> tuple[Effect, ...]:
    joints = joints_of(table.content["asymmetric"], f"{table.where}: asymmetric", chain, table.faults)
    unknowns = [
        Unknown(
            chain.joint_names[k], NAME, chain.joints[k].type.effort_unit.replace(" ", ""), False, "coulomb"
        )
        for k in joints
    ]
    return (Rubbing(tuple(unknowns), joints, (term,) * len(joints)),) if joints else ()


KIND = Kind("asymmetric", "friction", (), _read)
