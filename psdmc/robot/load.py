"""Reads a robot file with its options. This is the first step of the compiler."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.files import in_words, read_file
from psdmc.reproducible import times
from psdmc.robot import limits
from psdmc.robot.closed_loops import Tables, closed_loops, loop_tables
from psdmc.robot.dh import BASE_NAME, DhJoint, DhLink, DhRobot, read_dh
from psdmc.robot.draft import Draft, Snap
from psdmc.robot.file_kinds import SourceFormat, as_source
from psdmc.robot.inertia import (
    COM_NAMES,
    PRODUCT_NOISE,
    block_diagonal,
    canonical,
    link_span,
    link_values,
    parse_statements,
    physical_fault,
    standard_parameters,
)
from psdmc.robot.limits import shown
from psdmc.robot.linear_loops import with_linear_loops
from psdmc.robot.load_options import DEFAULT_SNAP, TOOL, LoadOptions, checked_options, parsed_contact
from psdmc.robot.mechanism import BASE, DRIVE, ROW_NAMES, Array, Joint, Loop, Mechanism, NamedFrame, Placement
from psdmc.robot.missing_inertia import with_massless_warning
from psdmc.robot.placement import ROUNDING, about, coarse_right_angles, roll_pitch_yaw, snap_rotation
from psdmc.robot.urdf_chain import urdf_draft
from psdmc.robot.urdf_words import with_source_words
from psdmc.robot.xacro_file import checked_packages

PACKED = b"PK\x03\x04"
"""First bytes of a model file, which is an archive."""

__all__ = ["DEFAULT_SNAP", "LoadOptions", "LoadedRobot", "SourceFormat", "load_robot", "load_robot_text"]


@dataclass(frozen=True, slots=True, eq=False)
class LoadedRobot:
    """A robot read from a file: the mechanism, the text from which psdmc read it, and the options.

    source_name   the file's name in messages
    snap_report   every rotation that was replaced by a near one with exact zeros, with the angle between both (rad)
    """

    mechanism: Mechanism
    source_text: str
    source_format: SourceFormat
    source_name: str
    snap_report: tuple[Snap, ...]
    options: LoadOptions

    @property
    def chain(self) -> Mechanism:
        """The mechanism: joints, bodies and gravity of the robot. psdmc 0.1 used the name `chain` for it."""
        return self.mechanism

    def unsnapped(self) -> LoadedRobot:
        """Return the robot with the rotations as the file states them. psdmc uses this robot to compute the effect of
        snapping, which replaces rotations by near ones with exact zeros."""
        keywords = self.options.as_json() | {"snap": 0.0}
        return load_robot_text(self.source_text, self.source_format, source_name=self.source_name, **keywords)


def load_robot(
    path: str | Path, *, packages: Mapping[str, str | PathLike[str]] | None = None, **options: Any
) -> LoadedRobot:
    """Return the robot in a URDF, MJCF, xacro or DH TOML file. The option `loops` can be the path of a TOML with closed
    loops.

    The suffixes .toml and .xacro and the root element determine the format. Options are those of LoadOptions;
    `packages` are folders of ROS packages, by name, that a xacro file uses. Raises InputError if the file or an option
    is wrong.
    """
    file, tables = Path(path), None
    if isinstance(options.get("loops"), str | PathLike):
        tables = Path(options["loops"])
        options["loops"] = loop_tables(tables, robot_text(tables))
    text = robot_text(file)
    text, source_format, found = as_source(file, text, checked_options(**options), checked_packages(packages))
    _refuse_size(len(text.encode(errors="replace")), file.name)
    return _loaded(text, source_format, file.name, found, tables.name if tables else None)


def load_robot_text(
    text: str, source_format: SourceFormat, *, source_name: str = "robot", **options: Any
) -> LoadedRobot:
    """Return the robot in a text, such as a saved model's source. Options and errors: see load_robot."""
    _refuse_size(len(text.encode(errors="replace")), source_name)
    return _loaded(text, source_format, source_name, checked_options(**options))


def _loaded(
    text: str, source_format: SourceFormat, source: str, options: LoadOptions, loops_file: str | None = None
) -> LoadedRobot:
    if not text.strip():
        raise InputError(f"{source}: the file is empty", "give a URDF or a DH .toml file")
    draft = _draft(text, source_format, source, options)
    return LoadedRobot(
        _settled(draft, options, source, loops_file), text, source_format, source, draft.snaps, options
    )


def _refuse_size(size: int, source: str) -> None:
    if size > limits.MAX_BYTES:
        raise InputError(
            f"{source}: more than {in_words(limits.MAX_BYTES)}, which is the most that psdmc reads",
            "give a URDF or a DH .toml file",
        )


def robot_text(file: Path) -> str:
    """Return the text of a robot file. Raises InputError if it is unreadable, no text, or too large."""
    try:
        data = read_file(file, limits.MAX_BYTES, "give a URDF or a DH .toml file")
        if data.startswith(PACKED):
            raise InputError(
                f"{file}: a packed file, as models are, and no robot's", "give a URDF or a DH .toml file"
            )
        return data.decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{file}: no such file", "give the path of a URDF or DH .toml file") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: not a UTF-8 text", "give a URDF or a DH .toml file") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{file}: cannot be read: {reason}", "check its path and rights") from None


def _draft(text: str, source_format: SourceFormat, source: str, options: LoadOptions) -> Draft:
    if source_format == "urdf":
        return with_source_words(urdf_draft(text, source, options), text, source)
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
    gravity = None if options.gravity is None else np.array(options.gravity)
    return dh_draft(text, source, gravity, options.snap, options.frames)


def _settled(draft: Draft, options: LoadOptions, source: str, loops_file: str | None) -> Mechanism:
    """The chain with drive inertias and assumed zeros applied."""
    link_names = [joint.link_name for joint in draft.joints]
    joint_names = [joint.name for joint in draft.joints]
    said = parse_statements(options.assume_zero, link_names, joint_names, source)
    given = _drive_values(draft, options, source)
    zeros = [
        (*zero, *more, *(() if drive is not None else ("Im",)))
        for zero, more, drive in zip(draft.zeros, said, given, strict=True)
    ]
    values = [
        link_values(np.append(x[:DRIVE], drive or 0.0), zero)
        for x, drive, zero in zip(draft.parameters, given, zeros, strict=True)
    ]
    # Each turn once, though several joints of a tree may lie beyond it.
    turned = dict.fromkeys(
        f"{snap.where}: turned by {snap.angle:.2g} rad to exact zeros" for snap in draft.snaps
    )
    frames = _with_contacts(_frames(draft, options, source), options)
    tables, file = (*draft.loops, *options.loops), loops_file or source
    loops = _loops(draft, tables, options, frames, file)
    mechanism = Mechanism(
        name=draft.name,
        convention=draft.convention,
        base_name=draft.base_name,
        tip_name=draft.tip_name,
        joints=draft.joints,
        parameters=np.array(values),
        parameter_span=block_diagonal([link_span(zero) for zero in zeros]),
        gravity=draft.gravity,
        tip=draft.tip,
        notes=(*turned, *draft.notes, *_zero_notes(draft, said, values)),
        frames=frames,
        parents=draft.parents,
        tip_body=draft.tip_body,
        coordinates=draft.coordinates,
        massless=draft.massless,
        loops=loops,
    )
    if loops:
        mechanism = with_linear_loops(mechanism, [table.get("follows") for table in tables], file)
        notes = (*mechanism.notes, *map(_loop_note, mechanism.loops))
        mechanism = replace(mechanism, notes=notes)
    return with_massless_warning(mechanism)


def _frames(draft: Draft, options: LoadOptions, source: str) -> tuple[NamedFrame, ...]:
    """The named frames, the tip where none are named, then the tool."""
    tip = draft.tip_frame
    if options.tool is None:
        return draft.frames
    named = draft.frames or (tip,)
    if any(frame.name == TOOL for frame in named):
        raise InputError(f"{source}: a frame of the file is called '{TOOL}' too", "leave --tool out")
    # Turns are about fixed axes x, y, z in turn, as in URDF.
    x, y, z, roll, pitch, yaw = options.tool
    tool = Placement(roll_pitch_yaw((roll, pitch, yaw)), np.array((x, y, z)))
    return (*named, NamedFrame(TOOL, tip.joint, tip.placement @ tool))


def _with_contacts(frames: tuple[NamedFrame, ...], options: LoadOptions) -> tuple[NamedFrame, ...]:
    """The frames with the rows of their contacts, where some are declared."""
    if not options.contacts:
        return frames
    rows = dict(map(parsed_contact, options.contacts))
    return tuple(replace(frame, rows=rows.get(frame.name, 0)) for frame in frames)


def _loops(
    draft: Draft, tables: Tables, options: LoadOptions, frames: Sequence[NamedFrame], source: str
) -> tuple[Loop, ...]:
    """The closed loops of the file, then those of the options."""
    named = {frame.name: frame for frame in frames}
    find = draft.frame_of
    if not tables or find is None:
        return ()
    return closed_loops(
        tables,
        lambda name: named[name] if name in named else find(name),
        [joint.name for joint in draft.joints],
        options.snap,
        source,
    )


def _loop_note(loop: Loop) -> str:
    rows = ", ".join(ROW_NAMES[row] for row in loop.rows)
    return f"loop '{loop.name}' closes {rows} in functions of contacts and loops; all other functions compute the open tree"


def _drive_values(draft: Draft, options: LoadOptions, source: str) -> list[float | None]:
    """Each joint's drive inertia where it is a parameter (NaN: unknown), None where it is not; a joint of several
    coordinates, such as a free root, has no drive."""
    own = [
        float(x[DRIVE]) if drive else None for x, drive in zip(draft.parameters, draft.drives, strict=True)
    ]
    driven = [k for k, joint in enumerate(draft.joints) if joint.type.about_z]
    if not options.drive_inertia and isinstance(options.drive_inertia, bool):
        return own
    if isinstance(options.drive_inertia, bool):
        given = [0.0 if own[k] is None else own[k] for k in driven]
    else:
        given = list(options.drive_inertia)
    if len(given) != len(driven):
        names = ", ".join(draft.joints[k].name for k in driven)
        raise InputError(
            f"{source}: {len(given)} drive inertias for {len(driven)} joints", f"one for each of: {names}"
        )
    value_of = dict(zip(driven, given, strict=True))
    return [value_of.get(k) for k in range(len(own))]


def _zero_notes(draft: Draft, said: Sequence[Sequence[str]], values: Sequence[Array]) -> list[str]:
    notes = []
    for joint, own, more, before, after in zip(
        draft.joints, draft.zeros, said, draft.parameters, values, strict=True
    ):
        stated = () if joint.link_name in draft.massless else own
        names = list(dict.fromkeys((*stated, *more)))
        if not names:
            continue
        size = np.nanmax(np.abs(before[:DRIVE]), initial=0.0)
        changed = np.nanmax(np.abs(before[:DRIVE] - after[:DRIVE]), initial=0.0) > PRODUCT_NOISE * size
        ending = "; the file's values there are dropped" if changed else ""
        notes.append(f"link '{joint.link_name}': assumed zero: {', '.join(names)}{ending}")
    return notes


# Robots from DH tables
#
# Standard convention: a row is Rz(theta + q) Tz(d) Tx(a) Rx(alpha) from one distal frame to the next; the
# distal frame is the link frame. The joint frame lies after Rz(theta + q), and the link frame has a
# constant placement in the joint frame.
#
# Modified convention (Craig): a row is Rx(alpha) Tx(a) Tz(d) Rz(theta + q), and the joint frame is the link
# frame. For a prismatic joint q adds to d and not to theta.


def dh_draft(text: str, source: str, gravity: Array | None, snap: float, frames: Sequence[str] = ()) -> Draft:
    """Return the robot that a DH file describes.

    gravity  (3,) m/s^2, gravity that replaces that of the file; None: that of the file
    snap     rad; angles that differ by at most this much from a right angle become exact
    """
    robot = read_dh(text, source)
    joints, snaps = _placed_joints(robot, snap)
    parents = tuple(row.parent for row in robot.joints)
    leaves = [i for i in range(len(joints)) if i not in parents]
    ends = tuple(link_name(leaf + 1) for leaf in leaves) if len(leaves) > 1 else ()
    named = tuple(_frame(joints, name, source) for name in frames or ends)
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
        gravity=np.array(robot.gravity) if gravity is None else gravity,
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
    mass, com, inertia = settled(row.link)
    drive = 0.0 if row.drive_inertia is None else row.drive_inertia
    return np.append(standard_parameters(mass, com, inertia), drive)


def settled(link: DhLink) -> tuple[float, Array, Array]:
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
        mass, _, inertia = settled(row.link)
        judged = not any(name.startswith("I") for name in row.link.zero)
        fault = physical_fault(mass, inertia) if judged else None
        if fault:
            notes.append(f"link '{link_name(number)}': {fault}: not physical")
    return tuple(notes)
