"""A DH robot's TOML file as plain data, every entry checked."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

from psdmc.errors import InputError
from psdmc.robot import limits
from psdmc.robot.dh_parents import parents_of
from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.joints import JOINT_TYPES, REVOLUTE, JointType
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import BASE, Limits
from psdmc.robot.names import name_faults, naming_faults
from psdmc.robot.toml_values import (
    LENGTH,
    CheckedTable,
    Triple,
    angle,
    any_list,
    as_it_is,
    finite,
    not_negative,
    one_of,
    plain_text,
    range_of,
    triple_of,
    within,
)
from psdmc.robot.zeros import ZERO_NAMES

Convention = Literal["standard", "modified"]

ROBOT_KEYS = ("name", "convention", "gravity", "joint")
JOINT_KEYS = ("name", "parent", "type", "a", "alpha", "d", "theta", "limits", "drive_inertia", "link")
LIMIT_KEYS = ("position", "speed", "acceleration", "effort")
LINK_KEYS = ("mass", "com", "inertia_com", "zero")

UNKNOWN = math.nan


@dataclass(frozen=True, slots=True)
class DhLink:
    """mass kg; com m in the link's frame; inertia_com kg m^2 about it (INERTIA_NAMES); NaN where unknown."""

    mass: float = UNKNOWN
    com: Triple = (UNKNOWN, UNKNOWN, UNKNOWN)
    inertia_com: tuple[float, ...] = (UNKNOWN,) * len(INERTIA_NAMES)
    zero: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DhJoint:
    """One row of the table: a, d in m, alpha, theta in rad; drive_inertia in kg m^2 (kg), NaN if unknown.

    parent   the row that this one's joint hangs on, counted from 0, or BASE
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
    """gravity in m/s^2 in the base frame."""

    name: str
    convention: Convention
    gravity: Triple
    joints: tuple[DhJoint, ...]


def read_dh(text: str, source: str) -> DhRobot:
    """The file's content; InputError names everything that is wrong with it at once."""
    problems: list[str] = []
    robot = _robot(_parsed(text, source), problems)
    if problems or robot is None:
        raise InputError(f"{source}: {limits.joined(problems)}", "see the DH format in docs/robot_files.md")
    return robot


def _parsed(text: str, source: str) -> object:
    """The parsed TOML; ValueError also for integers of thousands of digits, which the parser raises."""
    hint = "give a URDF or a DH .toml file"
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{source}: not a TOML file: nested too deeply", hint) from None
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{source}: not a TOML file: {reason}", hint) from None


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
    lower, upper = table.read("position", range_of(convert), (-math.inf, math.inf))
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
