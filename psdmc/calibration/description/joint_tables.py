"""The tables of a log description that say which columns hold the joints' quantities, and in which units.

`[position]`, `[velocity]`, `[effort]` and `[motor_position]` give unit, sign, gear ratio and delay of a quantity. They
apply to all joints; an entry `[[joint]]` names the columns of one joint, and may replace a value for this joint.
`[[coupling]]` is about joints that several motors drive together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Generic, Literal, TypeGuard, TypeVar

import numpy as np

from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.log import LARGEST_NUMBER, Quantity
from psdmc.calibration.logs.toml_tables import TomlTable, is_number, shown
from psdmc.errors import InputError
from psdmc.model.calibrated import Matrix

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Reading:
    """Data that are needed to read any table of a log description.

    folder       folder of the description: its paths are relative to it
    joint_names  joints of the model; None if no model is known, so that names cannot be checked
    faults       faults found so far, one line each: table, key, found, expected
    """

    folder: Path
    joint_names: tuple[str, ...] | None
    faults: list[str]


@dataclass(frozen=True, slots=True)
class Table(Generic[T]):
    """How one top-level key of a log description (log.toml) is read. `description.TABLES` has all of them.

    key      its name in the file
    read     function that returns the value of the key from TOML. It raises no error: it adds a text about each fault
             to the list `faults` of the Reading
    default  the value if the file does not have the key
    options  function that returns the options of the linear fit, changed by the value of the key; most keys change none
    """

    key: str
    read: Callable[[object, Reading], T]
    default: T
    options: Callable[[LinearOptions, T], LinearOptions] = lambda options, value: options


# Units


What = Literal["position", "velocity", "effort", "motor_position"]
"""A quantity. `motor_position` is of a motor whose joint is elastic and has a second encoder, on the link's side."""
Says = Literal["turning", "sliding", "current", "any"]
"""What a unit says: of a joint that turns, of one that slides, of a motor's current, or nothing."""

TICKS = ("ticks", "ticks/s")
"""Units whose size `ticks_per_rev` tells."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of a logged column. `size` is the factor to the SI unit (s, rad, m, rad/s, m/s, N m, N, A). `says` is what
    the unit implies about the joint: that it rotates or slides, or nothing."""

    size: float
    says: Says


TIME_UNITS: Mapping[str, Unit] = {
    "s": Unit(1.0, "any"),
    "ms": Unit(1e-3, "any"),
    "us": Unit(1e-6, "any"),
    "ns": Unit(1e-9, "any"),
}
POSITION_UNITS: Mapping[str, Unit] = {
    "rad": Unit(1.0, "turning"),
    "deg": Unit(math.pi / 180.0, "turning"),
    "rev": Unit(2.0 * math.pi, "turning"),
    "ticks": Unit(2.0 * math.pi, "turning"),
    "m": Unit(1.0, "sliding"),
    "mm": Unit(1e-3, "sliding"),
    "um": Unit(1e-6, "sliding"),
}
VELOCITY_UNITS: Mapping[str, Unit] = {
    "rad/s": Unit(1.0, "turning"),
    "deg/s": Unit(math.pi / 180.0, "turning"),
    "rev/s": Unit(2.0 * math.pi, "turning"),
    "rpm": Unit(2.0 * math.pi / 60.0, "turning"),
    "ticks/s": Unit(2.0 * math.pi, "turning"),
    "m/s": Unit(1.0, "sliding"),
    "mm/s": Unit(1e-3, "sliding"),
}
EFFORT_UNITS: Mapping[str, Unit] = {
    "Nm": Unit(1.0, "turning"),
    "mNm": Unit(1e-3, "turning"),
    "Ncm": Unit(1e-2, "turning"),
    "kNm": Unit(1e3, "turning"),
    "N": Unit(1.0, "sliding"),
    "kN": Unit(1e3, "sliding"),
    "A": Unit(1.0, "current"),
    "mA": Unit(1e-3, "current"),
}
CURRENTS = tuple(name for name, unit in EFFORT_UNITS.items() if unit.says == "current")
UNITS: Mapping[What, Mapping[str, Unit]] = {
    "position": POSITION_UNITS,
    "velocity": VELOCITY_UNITS,
    "effort": EFFORT_UNITS,
    "motor_position": POSITION_UNITS,
}
"""By quantity."""


# The entry of a quantity


LARGEST_FACTOR = 1e12
"""Of a scale, a gear ratio, ticks per revolution or a torque constant, and of their inverse."""
LARGEST_DELAY = 1.0
"""s: beyond a second, a log's columns do not belong together."""
LARGEST_COLUMN = 1000
"""As of a table's columns."""

COMMON = ("unit", "scale", "sign", "gear_ratio", "delay")
OWN: Mapping[What, tuple[str, ...]] = {
    "position": (*COMMON, "offset", "ticks_per_rev"),
    "velocity": (*COMMON, "ticks_per_rev"),
    "effort": (*COMMON, "torque_constant", "quantity"),
    "motor_position": (*COMMON, "offset", "ticks_per_rev"),
}
"""Keys by quantity."""
COLUMN = ("column", "table")
TORQUES: tuple[Quantity, ...] = ("motor_torque", "joint_torque")


@dataclass(frozen=True, slots=True)
class Entry:
    """How a column is converted to a quantity of a joint. A field is None if the description does not give it.

    SI value = sign * scale * unit * (number - offset), divided by gear_ratio for motion, multiplied by it for effort.

    column           name of the column, or its number from 1
    table            name of the table that has the column, if a log has several
    scale            factor from the number in the column to the unit
    gear_ratio       turns of the motor per turn of the joint (per m for a sliding joint), if the column is the motor's
    offset           number in the column if the joint is at zero
    ticks_per_rev    encoder counts per revolution
    delay            s by which the column lags behind the time column
    torque_constant  N m/A of the motor, before the gear
    quantity         for effort: current, motor_torque (friction included) or joint_torque
    """

    column: str | int | None = None
    table: str | None = None
    unit: str | None = None
    scale: float | None = None
    sign: float | None = None
    gear_ratio: float | None = None
    offset: float | None = None
    ticks_per_rev: float | None = None
    delay: float | None = None
    torque_constant: float | None = None
    quantity: Quantity | None = None

    def over(self, other: Entry) -> Entry:
        """Return this entry, with missing fields taken from another entry.

        The fields ticks_per_rev and torque_constant are not taken if this entry has a unit other than encoder ticks or
        amperes, respectively.
        """
        said = {f.name: value for f in fields(self) if (value := getattr(self, f.name)) is not None}
        if self.unit is not None and self.unit not in TICKS:
            other = replace(other, ticks_per_rev=None)
        if self.unit is not None and self.unit not in CURRENTS:
            other = replace(other, torque_constant=None)
        return replace(other, **said)


NUMBERS: Mapping[str, tuple[float, float]] = {
    "scale": (-LARGEST_FACTOR, LARGEST_FACTOR),
    "gear_ratio": (1.0 / LARGEST_FACTOR, LARGEST_FACTOR),
    "offset": (-LARGEST_NUMBER, LARGEST_NUMBER),
    "ticks_per_rev": (1.0 / LARGEST_FACTOR, LARGEST_FACTOR),
    "delay": (-LARGEST_DELAY, LARGEST_DELAY),
    "torque_constant": (1.0 / LARGEST_FACTOR, LARGEST_FACTOR),
}
"""Bounds of the numeric keys."""


def _entry_of(value: object, what: What, where: str, faults: list[str], *, with_column: bool) -> Entry:
    """The entry of a quantity, such as [position], from its TOML table. With a column, the value may also be its name or
    number alone."""
    if with_column and _is_column(value):
        return Entry(column=value)
    if with_column and not isinstance(value, dict):
        expected = f"a column's name, its number from 1 to {LARGEST_COLUMN}, or a table"
        faults.append(f"{where}: found {shown(value)}, expected {expected}")
        return Entry()
    keys = (*(COLUMN if with_column else ()), *OWN[what])
    table = TomlTable(value, where, keys, faults)
    said: dict[str, Any] = {
        key: table.number(key, *NUMBERS[key]) for key in keys if key in NUMBERS and table.has(key)
    }
    if table.has("unit"):
        said["unit"] = table.word("unit", tuple(UNITS[what]))
    if table.has("quantity"):
        said["quantity"] = table.word("quantity", TORQUES)
    if table.has("sign"):
        said["sign"] = table.number("sign", -1.0, 1.0)
        if abs(said["sign"]) != 1.0:
            faults.append(f"{where}: sign: found {said['sign']:g}, expected 1 or -1")
    if table.has("column"):
        said["column"] = column_of(table)
    if table.has("table"):
        said["table"] = table.text("table")
    if said.get("scale") == 0.0:
        faults.append(f"{where}: scale: found 0, expected another number")
    return Entry(**said)


def column_of(table: TomlTable) -> str | int:
    """Return the value of the key `column`: the name of a column, or its number from 1."""
    value = table.content["column"]
    if _is_column(value):
        return value
    expected = f"a column's name, or its number from 1 to {LARGEST_COLUMN}"
    table.faults.append(f"{table.where}: column: found {shown(value)}, expected {expected}")
    return 1


def _is_column(value: object) -> TypeGuard[str | int]:
    if isinstance(value, str):
        return bool(value) and value.isprintable()
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= LARGEST_COLUMN


def _quantity_table(what: What) -> Table[Entry]:
    def read(value: object, reading: Reading) -> Entry:
        return _entry_of(value, what, what, reading.faults, with_column=False)

    return Table(what, read, Entry())


QUANTITIES: Mapping[What, Table[Entry]] = {what: _quantity_table(what) for what in UNITS}


def refused(text: str) -> InputError:
    """Return the error for a fault in a log description that psdmc notices only when it reads the logs. The hint names
    the documentation of all keys."""
    return InputError(text, "docs/log_description.md has every key")


# Joints


MOST_JOINTS = 200


@dataclass(frozen=True, slots=True)
class JointEntry:
    """The entry of a log description about one joint of the model.

    logged_as  name of the joint in the log, if the names of columns contain it
    own        entries of the quantities that the joint gives, with their columns
    """

    name: str
    logged_as: str
    own: Mapping[What, Entry]

    def entry(self, what: What, common: Entry) -> Entry:
        """Return the entry of a quantity. What the joint does not give is taken from that of all joints, `common`."""
        return self.own.get(what, Entry()).over(common)


def _read_joints(value: object, reading: Reading) -> tuple[JointEntry, ...]:
    if not isinstance(value, list) or len(value) > MOST_JOINTS:
        reading.faults.append(f"joint: found {shown(value)}, expected at most {MOST_JOINTS} tables [[joint]]")
        return ()
    found = tuple(_joint(table, f"joint {k}", reading) for k, table in enumerate(value, start=1))
    names = [joint.name for joint in found]
    twice = list(dict.fromkeys(quoted(name) for name in names if name and names.count(name) > 1))
    if twice:
        reading.faults.append(f"joint: name {listed(twice)} twice, expected one [[joint]] for each")
    require_joints([name for name in names if name], "joint", reading)
    return found


def require_joints(names: list[str], where: str, reading: Reading) -> None:
    """Add a text to the list of faults of a Reading if one of the names is not a joint of the model.

    where  the table with the names, for the text
    """
    known = reading.joint_names
    unknown = [quoted(name) for name in names if known is not None and name not in known]
    if unknown and known is not None:
        has = listed([quoted(name) for name in known])
        reading.faults.append(f"{where}: name: found {listed(unknown)}, expected joints of the model: {has}")


def _joint(value: object, where: str, reading: Reading) -> JointEntry:
    table = TomlTable(value, where, ("name", "logged_as", *UNITS), reading.faults)
    name = table.text("name")
    where = f"{where} ({quoted(name)})" if name else where
    own = {
        what: _entry_of(table.content[what], what, f"{where}: {what}", reading.faults, with_column=True)
        for what in UNITS
        if table.has(what)
    }
    return JointEntry(name, table.text("logged_as", name) if name else "", own)


JOINTS: Table[tuple[JointEntry, ...]] = Table("joint", _read_joints, ())


# Joints that several motors drive together, as in a wrist


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
    """The joints that several motors drive together, with those that a motor drives alone.

    whole     matrix of all joints of the robot in q_joint = matrix q_motor; empty if no motors drive joints together
    position  this matrix for groups whose logged positions are those of motors; empty if there are none
    velocity  this matrix for groups whose logged velocities are those of motors; empty if there are none
    effort    this matrix for groups whose logged efforts are those of motors; empty if there are none
    """

    whole: Matrix = ()
    position: Matrix = ()
    velocity: Matrix = ()
    effort: Matrix = ()


def _read_coupling(value: object, reading: Reading) -> CouplingEntry:
    if not isinstance(value, list) or len(value) > MOST_COUPLED:
        reading.faults.append(f"coupling: found {shown(value)}, expected at most {MOST_COUPLED} [[coupling]]")
        return CouplingEntry()
    count = len(reading.faults)
    groups = [_group(table, f"coupling {k}", reading) for k, table in enumerate(value, start=1)]
    joints = [joint for group in groups for joint in group.joints]
    twice = list(dict.fromkeys(quoted(joint) for joint in joints if joints.count(joint) > 1))
    if twice:
        reading.faults.append(f"coupling: joints: {listed(twice)} twice, expected each once")
    if len(reading.faults) > count or reading.joint_names is None:
        return CouplingEntry()
    parts = {
        what: _whole_matrix([group for group in groups if what in group.quantities], reading.joint_names)
        for what in COUPLED
    }
    return CouplingEntry(_whole_matrix(groups, reading.joint_names), **parts)


def _group(value: object, where: str, reading: Reading) -> Group:
    table = TomlTable(value, where, ("joints", "matrix", "quantities"), reading.faults)
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


def _whole_matrix(groups: list[Group], joint_names: tuple[str, ...]) -> Matrix:
    """The matrix of all joints of the robot in q_joint = matrix q_motor. A joint outside the groups has 1 on the
    diagonal and else zeros. Empty where there are no groups."""
    if not groups:
        return ()
    whole = np.eye(len(joint_names))
    for group in groups:
        places = [joint_names.index(joint) for joint in group.joints]
        whole[np.ix_(places, places)] = group.matrix
    return tuple(tuple(row) for row in whole.tolist())


COUPLING: Table[CouplingEntry] = Table(
    "coupling",
    _read_coupling,
    CouplingEntry(),
    lambda options, entry: replace(options, coupling=entry.whole) if entry.whole else options,
)
