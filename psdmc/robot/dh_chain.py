"""Makes a robot from a DH table.

Standard convention: a row is Rz(theta + q) Tz(d) Tx(a) Rx(alpha) from one distal frame to the next; the distal frame is
the link frame. The joint frame lies after Rz(theta + q), and the link frame has a constant placement in the joint
frame.

Modified convention (Craig): a row is Rx(alpha) Tx(a) Tz(d) Rz(theta + q), and the joint frame is the link frame. For a
prismatic joint q adds to d and not to theta.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.errors import InputError
from psdmc.reproducible import times
from psdmc.robot.dh import BASE_NAME, DhJoint, DhLink, DhRobot, read_dh
from psdmc.robot.draft import Draft, Snap
from psdmc.robot.inertia import physical_fault, standard_parameters
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import BASE, Array, Joint, NamedFrame, Placement
from psdmc.robot.rotation import about
from psdmc.robot.snap import ROUNDING, coarse_right_angles, snap_rotation
from psdmc.robot.zeros import COM_NAMES, canonical


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
