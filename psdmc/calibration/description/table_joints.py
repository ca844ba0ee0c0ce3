"""The table `[[joint]]` of a log description: the columns of one joint. It may also change, for this joint alone, the
entries `[position]`, `[velocity]` and `[effort]`, which apply to all joints."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_quantities import Entry, entry_of
from psdmc.calibration.description.units import UNITS
from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.toml_tables import TomlTable, shown

MOST_JOINTS = 200
KEYS = ("name", "logged_as", *UNITS)


@dataclass(frozen=True, slots=True)
class JointEntry:
    """The entry of a log description about one joint of the model.

    logged_as  name of the joint in the log, if the names of columns contain it
    """

    name: str
    logged_as: str
    position: Entry
    velocity: Entry
    effort: Entry
    motor_position: Entry = Entry()  # noqa: RUF009  frozen


def _read(value: object, reading: Reading) -> tuple[JointEntry, ...]:
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
    table = TomlTable(value, where, KEYS, reading.faults)
    name = table.text("name")
    where = f"{where} ({quoted(name)})" if name else where
    own = {
        what: entry_of(table.content[what], what, f"{where}: {what}", reading.faults, with_column=True)
        if table.has(what)
        else Entry()
        for what in UNITS
    }
    return JointEntry(name, table.text("logged_as", name) if name else "", **own)


JOINTS: Table[tuple[JointEntry, ...]] = Table("joint", _read, ())
