"""A spring about (or along) the axis of one joint."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.columns.effect import AlongJoints, Effect, Kind, Spring, Unknown, joint_of, stretch
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism

FARTHEST = 1e3
"""rad (m), of the position at rest."""


def _read(table: TomlTable, chain: Mechanism) -> tuple[Effect, ...]:
    """`rest` (rad, m): the joint's position without torque; left out: zero, as the joint's offset holds the rest."""
    name, rest = table.text("name"), table.number("rest", -FARTHEST, FARTHEST, 0.0)
    joint = joint_of(table, chain)
    if table.faults:
        return ()
    own = chain.leading_joints[joint].type
    unit = f"{own.effort_unit.replace(' ', '')}/{own.position_unit}"
    way = AlongJoints(np.eye(chain.nv)[joint], own.position_unit)
    return (Spring((Unknown(name, "stiffness", unit),), (stretch,), way, rest),)


KIND = Kind("torsional", ("joint", "rest"), _read)
