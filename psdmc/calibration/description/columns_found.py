"""Finds the columns of a log file that contain the quantities of each joint, and the factors to SI units. It
also decides whether efforts are currents or torques."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from psdmc.calibration.description.description import LogDescription
from psdmc.calibration.description.joint_tables import (
    JOINTS,
    QUANTITIES,
    TICKS,
    UNITS,
    Entry,
    JointEntry,
    Says,
    What,
    refused,
)
from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.log import Quantity
from psdmc.calibration.logs.log_files import EFFORTS
from psdmc.calibration.logs.log_format import Columns

_UNIT_BY_ENDING = {"a": "A", "nm": "Nm", "n": "N"}

USUAL: Mapping[What, Mapping[str, str]] = {
    "position": {"position_rad": "rad", "position_m": "m", "position": ""},
    "velocity": {"velocity_rad_s": "rad/s", "velocity_m_s": "m/s", "velocity": ""},
    "effort": {prefix: _UNIT_BY_ENDING[prefix.rpartition("_")[2]] for prefix in EFFORTS} | {"effort": ""},
    "motor_position": {"motor_position_rad": "rad", "motor_position_m": "m"},
}
"""Units of columns that need no naming, PREFIX.<joint>; empty: SI."""


@dataclass(frozen=True, slots=True)
class Found:
    """A column of a log file that holds one quantity of one joint. The SI value is factor * (number in the column -
    zero).

    table   name of the table that has the column
    place   index of the column from 0
    says    what the column's unit implies about the joint: that it rotates or slides, or nothing
    delay   s by which the column lags behind the time column
    entry   the entry of the log description about the column
    """

    table: str
    place: int
    factor: float
    zero: float
    says: Says
    delay: float
    quantity: Quantity
    entry: Entry


@dataclass(frozen=True, slots=True)
class JointColumns:
    """The columns of one joint; velocity and motor are None if the log has none.

    motor  position of the motor, in a log whose `position` is that of the link
    """

    name: str
    position: Found
    velocity: Found | None
    effort: Found
    motor: Found | None = None


def joint_columns(
    description: LogDescription, joint_names: Sequence[str], tables: Mapping[str, Columns]
) -> tuple[JointColumns, ...]:
    """Return every joint's log columns, in the model's order. Raises InputError if one is missing or ambiguous."""
    said = {joint.name: joint for joint in description.part(JOINTS)}
    found = []
    for name in joint_names:
        own = said.get(name, JointEntry(name, name, {}))
        position = _found(own, "position", description, tables)
        effort = _found(own, "effort", description, tables)
        velocity = _found(own, "velocity", description, tables)
        if position is None or effort is None:
            raise _missing(own, "position" if position is None else "effort", tables)
        motor = _found(own, "motor_position", description, tables)
        found.append(JointColumns(name, position, velocity, effort, motor))
    return tuple(found)


def _found(
    joint: JointEntry, what: What, description: LogDescription, tables: Mapping[str, Columns]
) -> Found | None:
    where, entry = (
        f"joint {quoted(joint.name)}: {what}",
        joint.entry(what, description.part(QUANTITIES[what])),
    )
    unit, quantity = entry.unit or "", entry.quantity or "motor_torque"
    if entry.column is not None:
        table, place = place_of(entry.column, entry.table, tables, where)
    else:
        usual = _usual(joint, what, tables)
        if usual is None:
            return None
        table, place, prefix = usual
        unit = unit or USUAL[what][prefix]
        quantity = entry.quantity or EFFORTS.get(prefix, "motor_torque")
    # fields about encoder ticks or currents that contradict the unit are dropped
    return _converted(where, what, Entry(unit=unit or None).over(entry), (table, place), quantity)


def _converted(where: str, what: What, entry: Entry, at: tuple[str, int], quantity: Quantity) -> Found:
    says: Says = "any"
    size = 1.0
    if entry.unit is not None:
        unit = UNITS[what][entry.unit]
        size, says = unit.size, unit.says
    if entry.unit in TICKS:
        if entry.ticks_per_rev is None:
            raise refused(f"{where}: unit {quoted(entry.unit or '')} without ticks_per_rev")
        size /= entry.ticks_per_rev
    elif entry.ticks_per_rev is not None:
        raise refused(f"{where}: ticks_per_rev, but its unit is {entry.unit or 'SI'}, expected ticks")
    factor = (entry.sign or 1.0) * (1.0 if entry.scale is None else entry.scale) * size
    gear = entry.gear_ratio or 1.0
    if says == "current":
        quantity = "current"
    elif what == "effort":
        if entry.torque_constant is not None:
            raise refused(f"{where}: torque_constant, but its unit is {entry.unit or 'SI'}, expected A or mA")
        factor *= gear
    else:
        factor /= gear
    return Found(at[0], at[1], factor, entry.offset or 0.0, says, entry.delay or 0.0, quantity, entry)


def _usual(joint: JointEntry, what: What, tables: Mapping[str, Columns]) -> tuple[str, int, str] | None:
    """Table, place and prefix of the one column that is called PREFIX.<joint>."""
    hits = [
        (table, columns.names.index(f"{prefix}.{joint.logged_as}"), prefix)
        for table, columns in tables.items()
        for prefix in USUAL[what]
        if f"{prefix}.{joint.logged_as}" in columns.names
    ]
    if len(hits) > 1:
        both = listed([quoted(f"{prefix}.{joint.logged_as}") for _, _, prefix in hits])
        raise refused(
            f"joint {quoted(joint.name)}: {what}: columns {both}, expected one, or its name in [[joint]]"
        )
    return hits[0] if hits else None


def place_of(
    column: str | int, table: str | None, tables: Mapping[str, Columns], where: str
) -> tuple[str, int]:
    """Return the table of a log and the index (from 0) of a column, from the name or number of the column."""
    if table is not None and table not in tables:
        known = f"expected one of {listed([quoted(t) for t in tables])}"
        said = known if tuple(tables) != ("",) else "but its log is one file: expected none"
        raise refused(f"{where}: table {quoted(table)}, {said}")
    among = {table: tables[table]} if table is not None else tables
    if isinstance(column, int):
        if len(among) > 1:
            raise refused(f"{where}: column {column} of a log with several tables, expected its table, too")
        name, columns = next(iter(among.items()))
        if column > columns.width:
            raise refused(f"{where}: column {column}, but {columns.name} has {columns.width}")
        return name, column - 1
    hits = [
        (name, place)
        for name, columns in among.items()
        for place, found in enumerate(columns.names)
        if found == column
    ]
    if len(hits) != 1:
        raise _no_column(column, len(hits), among, where)
    return hits[0]


def _no_column(column: str, count: int, among: Mapping[str, Columns], where: str) -> Exception:
    files = " and ".join(columns.name for columns in among.values())
    names = [quoted(name) for columns in among.values() for name in columns.names]
    if count:
        asked = "its table, too" if len(among) > 1 else "its number"
        return refused(f"{where}: column {quoted(column)} stands {count} times in {files}, expected {asked}")
    has = f"which has {listed(names)}" if names else "which has no header: expected its number"
    return refused(f"{where}: no column {quoted(column)} in {files}, {has}")


def _missing(joint: JointEntry, what: What, tables: Mapping[str, Columns]) -> Exception:
    files = " and ".join(columns.name for columns in tables.values())
    names = listed([quoted(name) for columns in tables.values() for name in columns.names])
    usual = f"{next(iter(USUAL[what]))}.{joint.logged_as}"
    has = f"it has {names}" if names else "it has no header"
    return refused(
        f"{files}: joint {quoted(joint.name)}: no column for its {what}, expected "
        f"{quoted(usual)}, or one named in [[joint]]; {has}"
    )


# Currents or torques


def held_quantity(efforts: Sequence[tuple[str, Found]], coupled: bool) -> Quantity:
    """Return the quantity (current, motor torque or joint torque) that a log holds in memory, from the effort columns
    of its joints.

    Currents remain currents if all joints have currents and no joint is driven by several motors. Otherwise, currents
    are converted to torques. Raises InputError if torques of two kinds would mix, or if a torque constant is missing.
    """
    currents = [(name, found.entry) for name, found in efforts if found.quantity == "current"]
    odd = [quoted(name) for name, entry in currents if entry.quantity == "joint_torque"]
    if odd:  # a current is of a motor, whose torque has friction in it
        raise refused(
            f"effort: quantity 'joint_torque' of joint(s) {listed(odd)}, whose unit is A or mA: expected "
            "'motor_torque', which it is unless said"
        )
    held = {found.quantity for _, found in efforts}
    lacking = [(quoted(name), entry) for name, entry in currents if entry.torque_constant is None]
    if held == {"current"} and not coupled:
        odd = [name for name, entry in lacking if entry.gear_ratio is not None]
        if odd:
            raise refused(
                f"effort: gear_ratio without torque_constant for joint(s) {listed(odd)}, expected both, or neither "
                "and --torque-constants of joint and gear together"
            )
        return "current"
    torques = sorted(held - {"current"})
    both = ", ".join(f"{quoted(name)} {found.quantity}" for name, found in efforts)
    if "current" in held and "joint_torque" in held:
        raise refused(f"effort: {both}: currents make motor torques, expected one quantity")
    if len(torques) > 1:
        raise refused(f"effort: joints hold {both}, expected one quantity")
    if lacking:
        why = "motors are coupled" if coupled else "other joints hold torques"
        raise refused(
            f"effort: torque_constant missing for joint(s) {listed([name for name, _ in lacking])}: {why}, expected N m/A"
        )
    return "joint_torque" if torques == ["joint_torque"] else "motor_torque"


def torque_factor(found: Found, quantity: Quantity) -> float:
    """Return the factor by which an effort column is multiplied. It is the torque per ampere at the joint if the column
    holds currents and `quantity` is a torque; else 1."""
    if found.quantity != "current" or quantity == "current":
        return 1.0
    return (found.entry.torque_constant or 1.0) * (found.entry.gear_ratio or 1.0)


def torque_constants(description: LogDescription, joint_names: Sequence[str]) -> dict[str, float]:
    """Return the torque constants, N m/A at the joint (after the gear), that the description gives, by joint."""
    said = {joint.name: joint for joint in description.part(JOINTS)}
    common = description.part(QUANTITIES["effort"])
    entries = {name: said[name].entry("effort", common) if name in said else common for name in joint_names}
    return {
        name: entry.torque_constant * (entry.gear_ratio or 1.0)
        for name, entry in entries.items()
        if entry.torque_constant is not None
    }
