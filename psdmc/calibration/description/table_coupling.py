"""The table `[[coupling]]` of a log description: joints that several motors drive together, as in a wrist. It also
lists the quantities that the log holds for motors instead of joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_joints import require_joints
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.toml_tables import TomlTable, is_number, shown
from psdmc.model.calibrated import Matrix

KEYS = ("joints", "matrix", "quantities")
COUPLED = ("position", "velocity", "effort")
"""Quantities that a log may hold for motors."""
MOST_COUPLED = 10
LARGEST_RATIO = 1e6
"""Of an entry of the matrix."""
LARGEST_CONDITION = 1e6
"""Of the matrix: beyond, no motor torque can be told from its joint's."""


@dataclass(frozen=True, slots=True)
class Group:
    """Joints that several motors drive together, with as many motors as joints: q_joint = matrix q_motor.

    joints      names of the joints
    quantities  quantities (position, velocity, effort) whose columns in the log belong to the motors, not to the joints
    """

    joints: tuple[str, ...]
    matrix: Matrix
    quantities: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CouplingEntry:
    """All groups of joints that several motors drive together.

    groups    the groups
    whole     matrix of all joints of the robot in q_joint = matrix q_motor; empty if there are no groups
    position  this matrix for groups whose logged positions are those of motors; empty if there are none
    velocity  this matrix for groups whose logged velocities are those of motors; empty if there are none
    effort    this matrix for groups whose logged efforts are those of motors; empty if there are none
    """

    groups: tuple[Group, ...] = ()
    whole: Matrix = ()
    position: Matrix = ()
    velocity: Matrix = ()
    effort: Matrix = ()


def _read(value: object, reading: Reading) -> CouplingEntry:
    if not isinstance(value, list) or len(value) > MOST_COUPLED:
        reading.faults.append(f"coupling: found {shown(value)}, expected at most {MOST_COUPLED} [[coupling]]")
        return CouplingEntry()
    count = len(reading.faults)
    groups = tuple(_group(table, f"coupling {k}", reading) for k, table in enumerate(value, start=1))
    joints = [joint for group in groups for joint in group.joints]
    twice = list(dict.fromkeys(quoted(joint) for joint in joints if joints.count(joint) > 1))
    if twice:
        reading.faults.append(f"coupling: joints: {listed(twice)} twice, expected each once")
    if len(reading.faults) > count or reading.joint_names is None:
        return CouplingEntry(groups)
    parts = {
        what: whole_matrix([group for group in groups if what in group.quantities], reading.joint_names)
        for what in COUPLED
    }
    return CouplingEntry(groups, whole_matrix(groups, reading.joint_names), **parts)


def _group(value: object, where: str, reading: Reading) -> Group:
    table = TomlTable(value, where, KEYS, reading.faults)
    joints = _texts(table, "joints")
    require_joints(list(joints), where, reading)
    if not 2 <= len(joints) <= MOST_COUPLED and table.has("joints"):
        reading.faults.append(f"{where}: joints: found {len(joints)}, expected 2 to {MOST_COUPLED}")
    quantities = _texts(table, "quantities") if table.has("quantities") else COUPLED
    odd = [quoted(word) for word in quantities if word not in COUPLED]
    if odd:
        reading.faults.append(
            f"{where}: quantities: found {listed(odd)}, expected some of {', '.join(COUPLED)}"
        )
    return Group(joints, _matrix(table, len(joints)), quantities)


def _texts(table: TomlTable, key: str) -> tuple[str, ...]:
    values = table.items(key)
    if not values or any(not isinstance(value, str) for value in values):
        found = shown(table.content.get(key)) if table.has(key) else "nothing"
        table.faults.append(f"{table.where}: {key}: found {found}, expected a list of names")
        return ()
    return tuple(values)


def _matrix(table: TomlTable, n: int) -> Matrix:
    """The matrix of a group; a fault where it is not square, or has no inverse to speak of."""
    rows = table.items("matrix")
    fits = len(rows) == n and all(isinstance(row, list) and len(row) == n for row in rows)
    if not fits or not all(is_number(x) and abs(x) <= LARGEST_RATIO for row in rows for x in row):
        expected = f"{n} rows of {n} numbers of at most {LARGEST_RATIO:g}"
        table.faults.append(f"{table.where}: matrix: found {shown(rows)}, expected {expected}")
        return ()
    matrix = tuple(tuple(float(x) for x in row) for row in rows)
    if n and not np.linalg.cond(np.array(matrix)) <= LARGEST_CONDITION:
        table.faults.append(
            f"{table.where}: matrix: has no inverse, expected one motor motion for each motion"
        )
    return matrix


def whole_matrix(groups: list[Group] | tuple[Group, ...], joint_names: tuple[str, ...]) -> Matrix:
    """Return the matrix of all joints of the robot in q_joint = matrix q_motor. A joint outside the groups has 1 on the
    diagonal and else zeros. The result is empty if there are no groups."""
    if not groups:
        return ()
    whole = np.eye(len(joint_names))
    for group in groups:
        places = [joint_names.index(joint) for joint in group.joints]
        whole[np.ix_(places, places)] = group.matrix
    return tuple(tuple(row) for row in whole.tolist())


def _options(options: LinearOptions, entry: CouplingEntry) -> LinearOptions:
    return replace(options, coupling=entry.whole) if entry.whole else options


COUPLING: Table[CouplingEntry] = Table("coupling", _read, CouplingEntry(), _options)
