"""The tables `[position]`, `[velocity]`, `[effort]` and `[motor_position]` of a log description: unit, sign, gear ratio
and delay of a quantity. They apply to all joints; the entry of a joint may replace a value for this joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, cast

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.units import CURRENTS, TICKS, UNITS
from psdmc.calibration.logs.log import LARGEST_NUMBER, Quantity
from psdmc.calibration.logs.toml_tables import TomlTable, shown
from psdmc.errors import InputError

LARGEST_FACTOR = 1e12
"""Of a scale, a gear ratio, ticks per revolution or a torque constant, and of their inverse."""
LARGEST_DELAY = 1.0
"""s: beyond a second, a log's columns do not belong together."""
LARGEST_COLUMN = 1000
"""As of a table's columns."""

COMMON = ("unit", "scale", "sign", "gear_ratio", "delay")
OWN: Mapping[str, tuple[str, ...]] = {
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


def entry_of(value: object, what: str, where: str, faults: list[str], *, with_column: bool) -> Entry:
    """Return the entry of a quantity, such as [position], from its TOML table. If `with_column` is true, the value may
    also be only the name or number of a column. Faults are added to `faults`."""
    if with_column and _is_column(value):
        return Entry(column=cast("str | int", value))
    if with_column and not isinstance(value, dict):
        expected = f"a column's name, its number from 1 to {LARGEST_COLUMN}, or a table"
        faults.append(f"{where}: found {shown(value)}, expected {expected}")
        return Entry()
    keys = (*(COLUMN if with_column else ()), *OWN[what])
    table = TomlTable(value, where, keys, faults)
    said: dict[str, Any] = {
        key: table.number(key, *NUMBERS[key]) for key in keys if key in NUMBERS and table.has(key)
    }
    said |= _words(table, what)
    if table.has("column"):
        said["column"] = column_of(table, "column")
    if table.has("table"):
        said["table"] = table.text("table")
    if said.get("scale") == 0.0:
        faults.append(f"{where}: scale: found 0, expected another number")
    return Entry(**said)


def _words(table: TomlTable, what: str) -> dict[str, Any]:
    said: dict[str, Any] = {}
    if table.has("unit"):
        said["unit"] = table.word("unit", tuple(UNITS[what]))
    if table.has("quantity"):
        said["quantity"] = table.word("quantity", TORQUES)
    if table.has("sign"):
        said["sign"] = table.number("sign", -1.0, 1.0)
        if abs(said["sign"]) != 1.0:
            table.faults.append(f"{table.where}: sign: found {said['sign']:g}, expected 1 or -1")
    return said


def column_of(table: TomlTable, key: str) -> str | int:
    """Return the value of a key that names a column: the name of the column, or its number from 1."""
    value = table.content[key]
    if not _is_column(value):
        expected = f"a column's name, or its number from 1 to {LARGEST_COLUMN}"
        table.faults.append(f"{table.where}: {key}: found {shown(value)}, expected {expected}")
        return 1
    return cast("str | int", value)


def _is_column(value: object) -> bool:
    if isinstance(value, str):
        return bool(value) and value.isprintable()
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= LARGEST_COLUMN


def _table(what: str) -> Table[Entry]:
    def read(value: object, reading: Reading) -> Entry:
        return entry_of(value, what, what, reading.faults, with_column=False)

    return Table(what, read, Entry())


POSITION, VELOCITY, EFFORT = _table("position"), _table("velocity"), _table("effort")
MOTOR_POSITION = _table("motor_position")
"""Of a motor whose joint is elastic and has a second encoder, on the link's side: its `position`."""


def refused(text: str) -> InputError:
    """Return the error for a fault in a log description that psdmc notices only when it reads the logs. The hint names
    the documentation of all keys."""
    return InputError(text, "docs/log_description.md has every key")
