"""Reads keys that occur in several tables of a log description, such as those of springs. A value is true or false, the
name of one joint, or the names of several joints."""

from __future__ import annotations

from psdmc.calibration.logs.toml_tables import TomlTable, shown
from psdmc.calibration.logs.wording import listed, quoted
from psdmc.robot.mechanism import Mechanism


def flag(table: TomlTable, key: str) -> bool:
    """Return the value of a key, true or false; false if the key is missing. If the value is something else, a text is
    added to the list of faults, and false is returned."""
    value = table.content.get(key, False)
    if not isinstance(value, bool):
        table.faults.append(f"{table.where}: {key}: found {shown(value)}, expected true or false")
        return False
    return value


def joint_of(table: TomlTable, chain: Mechanism) -> int:
    """Return the index of the joint that the key `joint` names. If the robot has no such joint, a text is added to the
    list of faults, and 0 is returned."""
    name = table.text("joint")
    if name in chain.v_names:
        return chain.v_names.index(name)
    if name:
        table.faults.append(
            f"{table.where}: joint {quoted(name)} is not the robot's, it has {listed(chain.v_names)}"
        )
    return 0


def joints_of(value: object, where: str, chain: Mechanism, faults: list[str]) -> tuple[int, ...]:
    """Return the indices of the joints that a value of a log description selects. The value true selects all joints,
    false none, and a list selects joints by name. A text is added to `faults` if the value is wrong."""
    if isinstance(value, bool):
        return tuple(range(chain.nv)) if value else ()
    if not isinstance(value, list) or any(not isinstance(name, str) for name in value):
        faults.append(f"{where}: found {shown(value)}, expected true, false, or a list of joint names")
        return ()
    odd = [quoted(name) for name in value if name not in chain.v_names]
    if odd:
        faults.append(f"{where}: joint(s) {listed(odd)} are not the robot's, it has {listed(chain.v_names)}")
    return tuple(k for k, name in enumerate(chain.v_names) if name in value)
