"""Reads the TOML file of a DH table (Denavit-Hartenberg parameters) into plain data, and checks every entry. Writes a
first table for the user to edit."""

from __future__ import annotations

import json
import math
import os
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from psdmc.errors import InputError
from psdmc.files import write_whole
from psdmc.robot import limits
from psdmc.robot.inertia import INERTIA_NAMES, ZERO_NAMES
from psdmc.robot.joints import JOINT_TYPES, REVOLUTE, JointType
from psdmc.robot.limits import WHITE_SPACE, Range, decimal, name_faults, naming_faults, shown
from psdmc.robot.mechanism import BASE, Limits

Convention = Literal["standard", "modified"]

ROBOT_KEYS = ("name", "convention", "gravity", "joint", "loop")
JOINT_KEYS = ("name", "parent", "type", "a", "alpha", "d", "theta", "limits", "drive_inertia", "link")
LIMIT_KEYS = ("position", "speed", "acceleration", "effort")
LINK_KEYS = ("mass", "com", "inertia_com", "zero")

UNKNOWN = math.nan


@dataclass(frozen=True, slots=True)
class DhLink:
    """The inertia of one link of a DH table: mass in kg, and com in m in the link's frame. inertia_com is in kg m^2 about
    the centre of mass (INERTIA_NAMES). Unknown numbers are NaN."""

    mass: float = UNKNOWN
    com: Triple = (UNKNOWN, UNKNOWN, UNKNOWN)
    inertia_com: tuple[float, ...] = (UNKNOWN,) * len(INERTIA_NAMES)
    zero: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DhJoint:
    """One row of a DH table: a and d in m, alpha and theta in rad, drive_inertia in kg m^2 (kg), NaN if unknown.

    parent   index, from 0, of the row whose link carries the joint of this row; BASE if the base carries the joint
    """

    name: str
    type: JointType
    a: float
    alpha: float
    d: float
    theta: float
    limits: Limits
    drive_inertia: float | None
    link: DhLink
    parent: int = BASE


@dataclass(frozen=True, slots=True)
class DhRobot:
    """The content of a DH file: name, convention, rows, and gravity in m/s^2 along the axes of the base frame. There are
    also tables of closed loops (closed_loops.py)."""

    name: str
    convention: Convention
    gravity: Triple
    joints: tuple[DhJoint, ...]
    loops: tuple[Any, ...] = ()


def read_dh(text: str, source: str) -> DhRobot:
    """Return the content of a DH file. Raises one InputError that names all faults of the file."""
    problems: list[str] = []
    hint = "give a URDF or a DH .toml file"
    try:
        value = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{source}: not a TOML file: nested too deeply", hint) from None
    except ValueError as error:  # also of integers of thousands of digits
        reason = " ".join(str(error).split())
        raise InputError(f"{source}: not a TOML file: {reason}", hint) from None
    robot = _robot(value, problems)
    if problems or robot is None:
        raise InputError(f"{source}: {limits.joined(problems)}", "see the DH format in docs/robot_files.md")
    return robot


def _robot(value: object, problems: list[str]) -> DhRobot | None:
    table = CheckedTable(value, "robot", ROBOT_KEYS, problems)
    rows = table.read("joint", any_list, [])
    if not rows:
        problems.append("no [[joint]] in it")
        return None
    if len(rows) > limits.MAX_JOINTS:
        problems.append(f"{len(rows)} joints, psdmc reads at most {limits.MAX_JOINTS}")
        return None
    joints = tuple(_joint(row, number, problems) for number, row in enumerate(rows, start=1))
    name = table.read("name", plain_text, "robot")
    names = [joint.name for joint in joints]
    problems += name_faults(name, "robot") + naming_faults(names, "joint")
    parents, faults = parents_of(
        names, [row.get("parent") if isinstance(row, dict) else None for row in rows]
    )
    problems += faults
    lengths = [x for joint in joints for x in (joint.a, joint.d, *joint.link.com) if not math.isnan(x)]
    fault = limits.scale_fault(lengths)
    problems += [fault] if fault else []
    return DhRobot(
        name=name,
        convention=table.read("convention", one_of("standard", "modified"), "standard"),
        gravity=table.read("gravity", _gravity, (0.0, 0.0, -9.81)),
        joints=tuple(replace(joint, parent=k) for joint, k in zip(joints, parents, strict=True)),
        loops=tuple(table.read("loop", any_list, [])),
    )


def _gravity(value: object) -> Triple:
    gravity = triple_of(finite)(value)
    fault = limits.gravity_fault(gravity)
    if fault:
        raise ValueError(f"{list(gravity)} {fault}")
    return gravity


def _joint(value: object, number: int, problems: list[str]) -> DhJoint:
    given = value.get("name") if isinstance(value, dict) else None
    name = given if isinstance(given, str) and given else f"joint{number}"
    table = CheckedTable(value, f"joint {shown(name)}", JOINT_KEYS, problems)
    table.read("name", plain_text, "")
    joint_type = JOINT_TYPES[table.read("type", one_of(*JOINT_TYPES), REVOLUTE.word)]
    return DhJoint(
        name=name,
        type=joint_type,
        a=table.read("a", LENGTH, 0.0),
        alpha=table.read("alpha", angle, 0.0),
        d=table.read("d", LENGTH, 0.0),
        theta=table.read("theta", angle, 0.0),
        limits=_limits(table.read("limits", as_it_is, {}), joint_type, f"{table.where} limits", problems),
        drive_inertia=table.read("drive_inertia", _drive_inertia, None),
        link=_link(table.read("link", as_it_is, {}), f"{table.where} link", problems),
    )


def _limits(value: object, joint: JointType, where: str, problems: list[str]) -> Limits:
    table = CheckedTable(value, where, LIMIT_KEYS, problems)
    convert = partial(angle, accepted=limits.ANY) if joint.position_unit == "rad" else finite

    def read(value: object) -> tuple[float, float]:
        values = any_list(value)
        if len(values) != 2 or convert(values[0]) > convert(values[1]):
            raise ValueError(f"found {shown(value)}, expected [lower, upper]")
        return convert(values[0]), convert(values[1])

    lower, upper = table.read("position", read, (-math.inf, math.inf))
    speed, acceleration, effort = (
        table.read(key, not_negative(reader), math.inf)
        for key, reader in (("speed", convert), ("acceleration", convert), ("effort", finite))
    )
    return Limits(lower, upper, speed, acceleration, effort)


def _link(value: object, where: str, problems: list[str]) -> DhLink:
    table = CheckedTable(value, where, LINK_KEYS, problems)
    inertia = CheckedTable(
        table.read("inertia_com", as_it_is, {}), f"{where} inertia_com", INERTIA_NAMES, problems
    )
    return DhLink(
        mass=table.read("mass", not_negative(within(limits.MASS)), UNKNOWN),
        com=table.read("com", triple_of(LENGTH), (UNKNOWN,) * 3),
        inertia_com=tuple(inertia.read(name, within(limits.INERTIA), UNKNOWN) for name in INERTIA_NAMES),
        zero=table.read("zero", _zero_names, ()),
    )


def _plain(name: str) -> str:
    """A short name as it is; another one quoted, as in messages."""
    return name if name.isidentifier() and len(name) < limits.SHOWN else shown(name)


def _drive_inertia(value: object) -> float:
    return UNKNOWN if value == "unknown" else not_negative(within(limits.DRIVE_INERTIA))(value)


def _zero_names(value: object) -> tuple[str, ...]:
    names = tuple(plain_text(name) for name in any_list(value))
    unknown = [name for name in names if name not in ZERO_NAMES]
    if unknown:
        raise ValueError(f"unknown {', '.join(map(_plain, unknown))} (known: {', '.join(ZERO_NAMES)})")
    return names


# Readers of values: each returns a typed value, or raises ValueError with what was found and expected.
Triple = tuple[float, float, float]


def angle(value: object, accepted: Range = limits.ANGLE) -> float:
    """Return an angle in rad from a number or a text such as "90 deg" or "1.5 rad". Raises ValueError."""
    if not isinstance(value, str):
        return within(accepted)(value)
    plain = value.strip(WHITE_SPACE)
    number, unit = decimal(plain[:-3].strip(WHITE_SPACE)), plain[-3:]
    if number is None or unit not in ("deg", "rad"):
        raise ValueError(f'{shown(value)} is no angle: write radians, or "90 deg"')
    return within(accepted)(math.radians(number) if unit == "deg" else number)


def finite(value: object) -> float:
    """Return a number read from a file if it is finite as a 64-bit float. Raises ValueError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"found {shown(value)}, expected a finite number")
    if not abs(value) <= sys.float_info.max:
        raise ValueError(f"found {shown(value)}, expected a finite number")
    return float(value)


def within(accepted: Range) -> Callable[[object], float]:
    """Return a reader of finite numbers within a range, which its ValueError names."""

    def convert(value: object) -> float:
        number = finite(value)
        fault = accepted.fault(number)
        if fault:
            raise ValueError(f"{number:g} {fault}")
        return number

    return convert


class CheckedTable:
    """Reads one TOML table key by key. All faults are collected in `problems`, each with the name of the table."""

    def __init__(self, value: object, where: str, keys: tuple[str, ...], problems: list[str]) -> None:
        self.where, self.problems = where, problems
        self.table: Mapping[str, Any] = value if isinstance(value, dict) else {}
        if not isinstance(value, dict):
            problems.append(f"{where}: found {shown(value)}, expected a table")
        for key in self.table:
            if key not in keys:
                problems.append(f"{where}: unknown key {shown(key)} (known: {', '.join(keys)})")

    def read(self, key: str, convert: Callable[[Any], Any], default: Any) -> Any:
        """Return a key's value, converted by a reading function; `default` if it is missing or wrong."""
        if key not in self.table:
            return default
        try:
            return convert(self.table[key])
        except ValueError as error:
            self.problems.append(f"{self.where}: {key}: {error}")
            return default


LENGTH = within(limits.LENGTH)
"""A reader of lengths, m."""


def as_it_is(value: object) -> object:
    """Return a value of a file unchanged. This reading function is for values whose parts are read one by one."""
    return value


def plain_text(value: object) -> str:
    """Return a value of a file if it is a text that is not empty. Raises ValueError for anything else."""
    if not isinstance(value, str) or not value:
        raise ValueError(f"found {shown(value)}, expected a text")
    return value


def any_list(value: object) -> list[object]:
    """Return a value of a file if it is a list, with entries of any type. Raises ValueError for anything else."""
    if not isinstance(value, list):
        raise ValueError(f"found {shown(value)}, expected a list")
    return value


def triple_of(convert: Callable[[object], float]) -> Callable[[object], Triple]:
    """Return a reading function for lists of three values. `convert` reads each of the values."""

    def read(value: object) -> Triple:
        values = any_list(value)
        if len(values) != 3:
            raise ValueError(f"found {shown(value)}, expected three numbers")
        x, y, z = (convert(v) for v in values)
        return (x, y, z)

    return read


def not_negative(convert: Callable[[object], float]) -> Callable[[object], float]:
    """Return a reading function for numbers that must not be negative. `convert` reads the number."""

    def read(value: object) -> float:
        number = convert(value)
        if number < 0.0:
            raise ValueError(f"found {number:g}, expected no less than zero")
        return number

    return read


def one_of(*words: str) -> Callable[[object], str]:
    """Return a reading function that accepts only one of the given words."""

    def read(value: object) -> str:
        if not isinstance(value, str) or value not in words:
            raise ValueError(f"found {shown(value)}, expected one of {', '.join(words)}")
        return str(value)

    return read


BASE_NAME = "base"
"""The name of the base in `parent`, as in messages and frames."""


def parents_of(names: Sequence[str], given: Sequence[object]) -> tuple[tuple[int, ...], list[str]]:
    """Return the parent row of each row, as an index from 0 or BASE, and the faults, one sentence each.

    names   names of the rows' joints
    given   `parent` of each row in the file: the name of a joint, or "base"; None: the row before

    The rows of a branch must be consecutive: the parent of a row is the row before, or an ancestor of the row before.
    """
    parents: list[int] = []
    faults: list[str] = []
    if BASE_NAME in names and BASE_NAME in given:
        faults.append(f"a joint is called '{BASE_NAME}', and a parent: rename the joint")
    for i, parent in enumerate(given):
        # Open are the base, the row before, and the rows that carry that one, from the base outward.
        row = i - 1
        found: list[int] = []
        while row != BASE:
            found.append(row)
            row = parents[row]
        open_rows = [BASE, *found[::-1]]
        where = i - 1 if parent is None else _row(names, parent)
        if where is None:
            said = f"found {shown(parent)}, expected '{BASE_NAME}' or the name of a joint"
        elif where not in open_rows:
            can = ", ".join(shown(BASE_NAME if k == BASE else names[k]) for k in open_rows)
            said = f"{shown(parent)} is not open here: a branch's joints follow one another; expected one of {can}"
        else:
            parents.append(where)
            continue
        faults.append(f"joint {shown(names[i])}: parent: {said}")
        parents.append(i - 1)
    return tuple(parents), faults


def _row(names: Sequence[str], parent: object) -> int | None:
    if parent == BASE_NAME:
        return BASE
    return names.index(parent) if isinstance(parent, str) and parent in names else None


def write_new_robot(path: Path) -> None:
    """Write a commented DH table. The robot gets the name of the file.

    Raises InputError if `path` exists already, or if its suffix is not that of a DH table.
    """
    if path.suffix.lower() != ".toml":
        raise InputError(f"{path}: a DH table's name ends with .toml", f"such as psdmc new {path.stem}.toml")
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already, and is left as it is", "give another name")
    text = resources.files("psdmc.robot").joinpath("template.toml").read_text(encoding="utf-8")
    safe = path.name if path.name.isprintable() and path.name.isascii() else "ROBOT.toml"
    write_whole(path, text.replace("@FILE@", safe).replace("@NAME@", json.dumps(path.stem)))
