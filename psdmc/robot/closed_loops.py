"""Closed loops of a robot file: tables [[loop]] of a TOML, read to loops of the mechanism.

A robot file describes a tree. A loop closes it between two frames of the tree, along some axes of the first frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.robot import limits
from psdmc.robot.limits import naming_faults, shown
from psdmc.robot.mechanism import BASE, ROW_NAMES, Loop, NamedFrame, Placement
from psdmc.robot.placement import from_quaternion, roll_pitch_yaw, snap_rotation
from psdmc.robot.toml_table import (
    LENGTH,
    CheckedTable,
    angle,
    any_list,
    as_it_is,
    finite,
    plain_text,
    toml_content,
    triple_of,
)

FORMAT = "see the format of loops in docs/how-to/loops.md"
ENDS = ("first", "second")
REQUIRED = ("rows", *ENDS)
LOOP_KEYS = ("name", *REQUIRED, "follows", "passive")
FRAME_KEYS = ("link", "xyz", "rpy", "quaternion")

UNTURNED = (0.0, 0.0, 0.0, 1.0)
"""x, y, z and w of a quaternion."""

UNIT = 1e-6
"""Accepted error of its length."""

CLOSED = {3: (0, 1, 2), 6: (0, 1, 2, 3, 4, 5)}
"""Rows by the number that stands for them: a point, and all motion."""

Tables = Sequence[Mapping[str, Any]]


def loop_tables(path: Path, text: str) -> Tables:
    """Return the tables [[loop]] of a TOML file. Raises InputError if the file contains anything else."""
    found = toml_content(text, path.name, FORMAT)
    tables = found.get("loop")
    others = [key for key in found if key != "loop"]
    if others or not isinstance(tables, list) or not tables:
        what = f"{shown(others[0])} is not known here" if others else "no [[loop]] in it"
        raise InputError(f"{path.name}: {what}", FORMAT)
    return tables


def closed_loops(
    tables: Tables,
    frame_of: Callable[[str], NamedFrame],
    joints: Sequence[str],
    snap: float,
    source: str,
) -> tuple[Loop, ...]:
    """Return the loops that tables describe. Raises one InputError that names all faults.

    frame_of  returns the frame of a link, with the joint BASE if the link is fixed to the base
    joints    names of the joints
    snap      rad; rotations that differ by at most this much from a right angle become exact
    """
    problems: list[str] = []
    try:
        loops = [
            _loop(table, number, frame_of, joints, snap, problems)
            for number, table in enumerate(tables, start=1)
        ]
    except InputError as error:
        raise InputError(f"{source}: {error}", error.hint) from None
    problems += naming_faults([name for name, *_ in loops], "loop")
    for name, first, second, *_ in loops:
        if first.joint == second.joint and not problems:
            problems.append(f"loop {shown(name)}: both frames are on one body: no joint moves between them")
    if problems:
        raise InputError(f"{source}: {limits.joined(problems)}", FORMAT)
    return tuple(Loop(*loop) for loop in loops)


def _loop(
    value: object,
    number: int,
    frame_of: Callable[[str], NamedFrame],
    joints: Sequence[str],
    snap: float,
    problems: list[str],
) -> tuple[str, NamedFrame, NamedFrame, tuple[int, ...], tuple[int, ...]]:
    given = value.get("name") if isinstance(value, Mapping) else None
    name = given if isinstance(given, str) and given else f"loop{number}"
    table = CheckedTable(value, f"loop {shown(name)}", LOOP_KEYS, problems)
    table.read("name", plain_text, "")
    problems += [f"{table.where}: {key} is missing" for key in REQUIRED if key not in table.table]
    first, second = (
        _frame(
            table.read(key, as_it_is, None),
            f"{table.where}: {key}",
            f"{name} {key}",
            frame_of,
            snap,
            problems,
        )
        for key in ENDS
    )
    table.read("follows", _names, [])
    passive = table.read("passive", lambda value: _joints(value, joints), ())
    return name, first, second, table.read("rows", _rows, CLOSED[6]), passive


def _joints(value: object, joints: Sequence[str]) -> tuple[int, ...]:
    """The numbers of joints, from their names."""
    if not isinstance(value, list | tuple) or not value or any(name not in joints for name in value):
        raise ValueError(f"found {shown(value)}, expected a list of joints: {', '.join(map(shown, joints))}")
    return tuple(sorted(joints.index(name) for name in value))


def _names(value: object) -> list[str]:
    return [plain_text(name) for name in any_list(value)]


def _rows(value: object) -> tuple[int, ...]:
    """3 (a point), 6 (all motion), or a list of rows, such as ["x", "z"]."""
    if value in (3, 6) and isinstance(value, int):
        return CLOSED[value]
    said = f"found {shown(value)}, expected 3 (a point), 6 (all motion) or a list of {', '.join(ROW_NAMES)}"
    if not isinstance(value, list | tuple) or not value:
        raise ValueError(said)
    if any(row not in ROW_NAMES for row in value):
        raise ValueError(said)
    if len({*value}) < len(value):
        raise ValueError(f"found {shown(value)}, which names a row twice")
    return tuple(sorted(ROW_NAMES.index(row) for row in value))


def _unit(value: object) -> tuple[float, ...]:
    """x, y, z and w of a rotation, made of length one."""
    numbers = [finite(each) for each in any_list(value)]
    size = math.hypot(*numbers)
    if len(numbers) != len(UNTURNED) or abs(size - 1.0) > UNIT:
        raise ValueError(f"found {shown(value)}, expected x, y, z and w of length one")
    return tuple(each / size for each in numbers)


def merged_loops(found: Tables, given: Tables) -> tuple[Mapping[str, Any], ...]:
    """Return the tables of a file, with keys replaced by given tables of the same name, then the others."""
    own = {table["name"]: dict(table) for table in found}
    others, changed = [], set[str]()
    for table in given:
        name = str(table.get("name"))
        if (
            name not in own or name in changed
        ):  # a second table of the name is a fault, which closed_loops names
            others.append(table)
        else:
            own[name].update(table)
            changed.add(name)
    return (*own.values(), *others)


def _frame(
    value: object,
    where: str,
    name: str,
    frame_of: Callable[[str], NamedFrame],
    snap: float,
    problems: list[str],
) -> NamedFrame:
    given = {"link": value} if isinstance(value, str) else {} if value is None else value
    table = CheckedTable(given, where, FRAME_KEYS, problems)
    link = table.read("link", plain_text, "")
    turn = roll_pitch_yaw(table.read("rpy", triple_of(angle), (0.0, 0.0, 0.0)), snap)
    if "quaternion" in table.table:
        turn = snap_rotation(from_quaternion(*table.read("quaternion", _unit, UNTURNED)), snap)[0]
    if {"rpy", "quaternion"} <= table.table.keys():
        problems.append(f"{where}: rpy and quaternion are both given")
    place = Placement(turn, np.array(table.read("xyz", triple_of(LENGTH), (0.0, 0.0, 0.0))))
    if not link:
        problems += [] if "link" in table.table or value is None else [f"{where}: link is missing"]
        return NamedFrame(name, BASE, place, 0)
    try:
        own = frame_of(link)
    except InputError as error:
        raise InputError(f"{where}: {error}", error.hint) from None
    return NamedFrame(name, own.joint, own.placement @ place, 0)
