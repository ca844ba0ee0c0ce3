"""A robot as its file states it, and how the options make it a mechanism: drive inertias, assumed zeros, frames, loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from psdmc.errors import InputError
from psdmc.robot.closed_loops import Tables, closed_loops
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.inertia import (
    PRODUCT_NOISE,
    block_diagonal,
    link_span,
    link_values,
    parse_statements,
)
from psdmc.robot.linear_loops import with_linear_loops
from psdmc.robot.load_options import TOOL, LoadOptions, parsed_contact
from psdmc.robot.mechanism import BASE as ON_BASE
from psdmc.robot.mechanism import DRIVE, ROW_NAMES, Array, Joint, Loop, Mechanism, NamedFrame, Placement
from psdmc.robot.placement import roll_pitch_yaw


@dataclass(frozen=True, slots=True)
class Snap:
    """Records that a rotation of the robot file was replaced by a near one with exact zeros (snapped). `angle` is the
    angle between both, rad; `where` names the rotation.

    segment   number of the joint that the rotation comes before: 0 for the first joint, and so on. n is between the
              last link and the tip, BASE between the root and the base
    """

    where: str
    angle: float
    segment: int


BASE = -1
"""Segment of the rotation that turns gravity with the base."""


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """A robot with n joints as its file states it.

    parameters     n arrays (11,), about the link frames; NaN if unknown; the drive inertia Im is 0 if the file gives
                   none
    zeros          n tuples of names that the file states to be zero (psdmc.robot.inertia.ZERO_NAMES)
    drives         n flags: the file makes this joint's drive inertia a parameter
    gravity        (3,) m/s^2 in the base frame
    frames         named frames; empty: the tip alone
    massless       moving links without inertia in the file, which psdmc treats as massless
    loops          tables of closed loops in the file
    frame_of       returns the frame of a link by its name, with the joint BASE if the link is fixed to the base
    parents, tip_body, coordinates   as in Mechanism; left out: those of a serial chain without mimic joints
    """

    name: str
    convention: Literal["urdf", "standard", "modified"]
    base_name: str
    tip_name: str
    joints: tuple[Joint, ...]
    parameters: tuple[Array, ...]
    zeros: tuple[tuple[str, ...], ...]
    drives: tuple[bool, ...]
    gravity: Array
    tip: Placement
    snaps: tuple[Snap, ...]
    notes: tuple[str, ...]
    frame_of: Callable[[str], NamedFrame]
    frames: tuple[NamedFrame, ...] = ()
    parents: tuple[int, ...] = ()
    tip_body: int = ON_BASE
    coordinates: tuple[Coordinate, ...] = ()
    massless: tuple[str, ...] = ()
    loops: tuple[Any, ...] = ()

    @property
    def tip_frame(self) -> NamedFrame:
        body = len(self.joints) - 1 if self.tip_body == ON_BASE else self.tip_body
        return NamedFrame(self.tip_name, body, self.tip)


def settled(draft: Draft, options: LoadOptions, source: str, loops_file: str | None) -> Mechanism:
    """Return the mechanism of a draft, with drive inertias, assumed zeros, the tool, contacts and closed loops applied.

    loops_file  the file that describes the loops, in messages; None: `source`
    """
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
    frames = _frames(draft, options, source)
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
        closed = [(loop.name, ", ".join(ROW_NAMES[row] for row in loop.rows)) for loop in mechanism.loops]
        notes = (
            f"loop '{name}' closes {rows} in functions of contacts and loops; all other functions compute the open tree"
            for name, rows in closed
        )
        mechanism = replace(mechanism, notes=(*mechanism.notes, *notes))
    return mechanism


def _frames(draft: Draft, options: LoadOptions, source: str) -> tuple[NamedFrame, ...]:
    """The named frames, the tip where none are named, then the tool; with the rows of contacts, where some are declared."""
    frames, tip = draft.frames, draft.tip_frame
    if options.tool is not None:
        frames = frames or (tip,)
        if any(frame.name == TOOL for frame in frames):
            raise InputError(f"{source}: a frame of the file is called '{TOOL}' too", "leave --tool out")
        # Turns are about fixed axes x, y, z in turn, as in URDF.
        x, y, z, roll, pitch, yaw = options.tool
        tool = Placement(roll_pitch_yaw((roll, pitch, yaw)), np.array((x, y, z)))
        frames = (*frames, NamedFrame(TOOL, tip.joint, tip.placement @ tool))
    if not options.contacts:
        return frames
    rows = dict(map(parsed_contact, options.contacts))
    return tuple(replace(frame, rows=rows.get(frame.name, 0)) for frame in frames)


def _loops(
    draft: Draft, tables: Tables, options: LoadOptions, frames: Sequence[NamedFrame], source: str
) -> tuple[Loop, ...]:
    """The closed loops of the file, then those of the options."""
    named = {frame.name: frame for frame in frames}
    if not tables:
        return ()
    return closed_loops(
        tables,
        lambda name: named[name] if name in named else draft.frame_of(name),
        [joint.name for joint in draft.joints],
        options.snap,
        source,
    )


def _drive_values(draft: Draft, options: LoadOptions, source: str) -> list[float | None]:
    """Each joint's drive inertia where it is a parameter (NaN: unknown), None where it is not; a joint of several
    coordinates, such as a floating base, has no drive."""
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
