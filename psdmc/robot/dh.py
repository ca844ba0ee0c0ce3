"""DH tables (Denavit-Hartenberg parameters) in TOML: reads and checks every entry, places the joints, and writes a first
table for the user to edit."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np

from psdmc.errors import InputError
from psdmc.files import write_whole
from psdmc.reproducible import times
from psdmc.robot import limits
from psdmc.robot.draft import Draft, Snap
from psdmc.robot.inertia import (
    COM_NAMES,
    INERTIA_NAMES,
    ZERO_NAMES,
    canonical,
    physical_fault,
    standard_parameters,
)
from psdmc.robot.joints import JOINT_TYPES, REVOLUTE, JointType
from psdmc.robot.limits import name_faults, naming_faults, shown
from psdmc.robot.load_options import LoadOptions
from psdmc.robot.mechanism import BASE, Array, Joint, Limits, NamedFrame, Placement
from psdmc.robot.placement import ROUNDING, about, coarse_right_angles, snap_rotation
from psdmc.robot.toml_table import (
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
    toml_content,
    triple_of,
    within,
)

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
    robot = _robot(toml_content(text, source, "give a URDF or a DH .toml file"), problems)
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


# Robots from DH tables
#
# Standard convention: a row is Rz(theta + q) Tz(d) Tx(a) Rx(alpha) from one distal frame to the next; the
# distal frame is the link frame. The joint frame lies after Rz(theta + q), and the link frame has a
# constant placement in the joint frame.
#
# Modified convention (Craig): a row is Rx(alpha) Tx(a) Tz(d) Rz(theta + q), and the joint frame is the link
# frame. For a prismatic joint q adds to d and not to theta.


def dh_draft(text: str, source: str, options: LoadOptions) -> Draft:
    """Return the robot that a DH file describes. Raises InputError for options that only URDFs have."""
    if options.base is not None or options.tip is not None:
        raise InputError(f"{source}: --base and --tip name links of a URDF", "leave them out for a DH table")
    if options.lock:
        raise InputError(f"{source}: --lock holds joints of a URDF", "leave it out for a DH table")
    if options.floating:
        raise InputError(
            f"{source}: --floating frees the root link of a URDF",
            "the base of a DH table is fixed: leave --floating out",
        )
    if options.unknown:
        raise InputError(
            f"{source}: --unknown names links of a URDF", "in a DH table leave out what is unknown of a link"
        )
    robot, snap = read_dh(text, source), options.snap
    joints, snaps = _placed_joints(robot, snap)
    parents = tuple(row.parent for row in robot.joints)
    leaves = [i for i in range(len(joints)) if i not in parents]
    ends = tuple(link_name(leaf + 1) for leaf in leaves) if len(leaves) > 1 else ()
    named = tuple(_frame(joints, name, source) for name in options.frames or ends)
    tip = named[0].joint if ends else len(joints) - 1
    return Draft(
        name=robot.name,
        convention=robot.convention,
        base_name=BASE_NAME,
        tip_name=joints[tip].link_name,
        joints=joints,
        parameters=tuple(_parameters(row) for row in robot.joints),
        zeros=tuple(row.link.zero for row in robot.joints),
        drives=tuple(row.drive_inertia is not None for row in robot.joints),
        gravity=np.array(robot.gravity if options.gravity is None else options.gravity),
        tip=joints[tip].link_frame,
        snaps=snaps,
        notes=(
            *coarse_right_angles({j.name: (j.alpha, j.theta) for j in robot.joints}, snap),
            *_faults(robot),
        ),
        frames=named,
        parents=parents,
        tip_body=tip,
        loops=robot.loops,
        frame_of=lambda name: (
            NamedFrame(name, BASE, Placement.identity())
            if name == BASE_NAME
            else _frame(joints, name, source)
        ),
    )


def _frame(joints: Sequence[Joint], name: str, source: str) -> NamedFrame:
    """A link's own frame; InputError where there is no such link."""
    names = [joint.link_name for joint in joints]
    if name not in names:
        raise InputError(f"{source}: frame {shown(name)} is no link", f"a DH table has {', '.join(names)}")
    number = names.index(name)
    return NamedFrame(name, number, joints[number].link_frame)


def link_name(number: int) -> str:
    """Return the name of a link of a DH table: link1, link2 and so on. The file gives links no names."""
    return f"link{number}"


def _placed_joints(robot: DhRobot, snap: float) -> tuple[tuple[Joint, ...], tuple[Snap, ...]]:
    snaps: list[Snap] = []
    joints: list[Joint] = []
    links: list[Placement] = []
    for number, row in enumerate(robot.joints, start=1):
        before = Placement.identity() if row.parent == BASE else links[row.parent]
        twist = _exact(about(0, row.alpha), f"alpha of joint '{row.name}'", snap, snaps, len(joints))
        turn = _exact(about(2, row.theta), f"theta of joint '{row.name}'", snap, snaps, len(joints))
        offset = Placement(turn, np.zeros(3))
        if robot.convention == "standard":
            placement = before @ offset
            link = Placement(twist, np.array([row.a, 0.0, row.d]))
        else:
            placement = before @ Placement(twist, times(twist, np.array([row.a, 0.0, row.d]))) @ offset
            link = Placement.identity()
        joints.append(Joint(row.name, link_name(number), row.type, placement, link, row.limits))
        links.append(link)
    return tuple(joints), tuple(snaps)


def _exact(rotation: Array, where: str, snap: float, snaps: list[Snap], segment: int) -> Array:
    result, angle = snap_rotation(rotation, snap)
    if angle > ROUNDING:
        snaps.append(Snap(where, angle, segment))
    return result


def _parameters(row: DhJoint) -> Array:
    """(11,) parameters about the link's frame; zeros that the file states are applied before unknown values."""
    mass, com, inertia = _body_of(row.link)
    drive = 0.0 if row.drive_inertia is None else row.drive_inertia
    return np.append(standard_parameters(mass, com, inertia), drive)


def _body_of(link: DhLink) -> tuple[float, Array, Array]:
    """Return mass, centre of mass, and inertia about the centre of mass of a link. Values that the `zero` list of the
    file names are zero."""
    zero = canonical(link.zero)
    com_and_inertia = [
        0.0 if name in zero else value
        for name, value in zip(COM_NAMES, (*link.com, *link.inertia_com), strict=True)
    ]
    mass = 0.0 if "m" in zero else link.mass
    return mass, np.array(com_and_inertia[:3]), np.array(com_and_inertia[3:])


def _faults(robot: DhRobot) -> tuple[str, ...]:
    """A note for each link whose inertia no body could have; assumed zeros are not judged."""
    notes = []
    for number, row in enumerate(robot.joints, start=1):
        mass, _, inertia = _body_of(row.link)
        judged = not any(name.startswith("I") for name in row.link.zero)
        fault = physical_fault(mass, inertia) if judged else None
        if fault:
            notes.append(f"link '{link_name(number)}': {fault}: not physical")
    return tuple(notes)


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
