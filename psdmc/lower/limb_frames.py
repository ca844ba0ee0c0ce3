"""A robot whose limbs of equal structure are one limb: its joints, frames and bodies, with a constant per limb where they
differ."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

from psdmc.dynamics.body import Body
from psdmc.dynamics.following import any_follows
from psdmc.dynamics.frames import BASE, Frame
from psdmc.dynamics.scalar import Matrix, Scalar, Vector
from psdmc.program.lanes import lanes
from psdmc.robot.limbs import Limbs, limb_groups

QUARTER = math.pi / 2

LARGEST = 8
"""Limbs of a group: lanes of the widest vector of doubles."""


def possible_groups(frames: Sequence[Frame]) -> tuple[tuple[Limbs, ...], ...]:
    """Ways to see limbs in a robot, none twice: all branches with joints of equal types, or only those whose frames have
    the same zeros. None where joints follow others."""
    if any_follows(frames):
        return ()
    parents = [frame.parent for frame in frames]
    ways: list[tuple[Limbs, ...]] = []
    for label in (_type_of, _pattern_of):
        found = limb_groups(parents, [label(frame) for frame in frames])
        usable = tuple(limbs for limbs in found if len(limbs) <= LARGEST)
        if usable and usable not in ways:
            ways.append(usable)
    return tuple(ways)


def _type_of(frame: Frame) -> Hashable:
    return frame.joint.word


def _pattern_of(frame: Frame) -> Hashable:
    """What decides which operations a frame costs. Those on the base turn constants alone."""
    if frame.parent == BASE:
        return frame.joint.word, frame.quarters
    zeros = tuple(x == 0.0 for row in (*frame.rotation, frame.translation) for x in row)
    return frame.joint.word, frame.is_parallel, zeros, frame.offset == 0.0, frame.quarters


@dataclass(frozen=True, slots=True)
class Place:
    """A joint of the core, or those at one place of all limbs of a group.

    joints    one, or limb by limb
    group     number of the group; None: of the core
    is_first  whether it is where limbs hang on the core
    """

    joints: tuple[int, ...]
    group: int | None = None
    is_first: bool = False

    def constant(self, values: Sequence[float]) -> Scalar:
        """One constant, from one for each of the joints."""
        return values[0] if self.group is None else lanes(self.group, values)

    def body(self, bodies: Sequence[Body]) -> Body:
        """One body, from one for each joint."""
        rows = [(body.mass, *body.moment, *body.second) for body in bodies]
        m, hx, hy, hz, *second = (self.constant(column) for column in zip(*rows, strict=True))
        return Body(m, (hx, hy, hz), tuple(second))


def places(count: int, groups: Sequence[Limbs]) -> tuple[Place, ...]:
    """Those of a robot of `count` joints, in the order of their first joints."""
    found = [
        Place(joints, number, k == 0)
        for number, limbs in enumerate(groups)
        for k, joints in enumerate(zip(*limbs, strict=True))
    ]
    taken = {joint for place in found for joint in place.joints}
    found += [Place((joint,)) for joint in range(count) if joint not in taken]
    return tuple(sorted(found, key=lambda place: place.joints[0]))


def one_limb(frames: Sequence[Frame], among: Sequence[Place]) -> tuple[Frame, ...]:
    """The frames of the places; Frame.limbs is not set."""
    new = {joint: i for i, place in enumerate(among) for joint in place.joints} | {BASE: BASE}
    return tuple(
        replace(
            _merged([frames[joint] for joint in place.joints], place.group),
            parent=new[frames[place.joints[0]].parent],
        )
        for place in among
    )


def _merged(frames: Sequence[Frame], group: int | None) -> Frame:
    """One frame, a constant per limb in the place of numbers that differ. Limbs whose frames differ by quarter turns have
    these in the offset, as a part of the angle."""
    if group is None:
        return frames[0]
    quarters = {frame.quarters for frame in frames}
    turned = len(quarters) > 1
    offsets = [frame.offset + (frame.quarters * QUARTER if turned else 0.0) for frame in frames]
    rotation: Matrix = tuple(  # type: ignore[assignment]
        tuple(lanes(group, [frame.rotation[i][j] for frame in frames]) for j in range(3)) for i in range(3)
    )
    translation: Vector = tuple(lanes(group, [f.translation[k] for f in frames]) for k in range(3))  # type: ignore[assignment]
    return replace(
        frames[0],
        rotation=rotation,
        translation=translation,
        offset=lanes(group, offsets),
        quarters=0 if turned else frames[0].quarters,
    )
