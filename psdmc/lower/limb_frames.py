"""Several limbs of equal structure (such as legs) as one limb. Numbers that differ between the limbs become constants
with one value per limb."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import BASE, Frame, Mimic
from psdmc.dynamics.scalar import Matrix, Scalar, Vector
from psdmc.dynamics.spatial import Body
from psdmc.program.lanes import lanes
from psdmc.robot.limbs import Limbs, limb_groups
from psdmc.robot.mechanism import NamedFrame, Placement

QUARTER = math.pi / 2

LARGEST = 8
"""Limbs of a group: lanes of the widest vector of doubles."""


def possible_groups(frames: Sequence[Frame]) -> tuple[tuple[Limbs, ...], ...]:
    """Return the possible divisions of a robot into groups of equal limbs.

    In one division, a group consists of all branches with joints of equal types. In another, also the joint frames must
    have equal zeros. A mimic joint must follow a joint of its own limb, at the same place in all limbs of the group.
    """
    parents = [frame.parent for frame in frames]
    divisions: list[tuple[Limbs, ...]] = []
    for label in (_type_of, _pattern_of):
        found = limb_groups(parents, [label(frame) for frame in frames])
        usable = tuple(limbs for limbs in found if len(limbs) <= LARGEST and _mimic_alike(frames, limbs))
        if usable and usable not in divisions:
            divisions.append(usable)
    return tuple(divisions)


def _mimic_alike(frames: Sequence[Frame], limbs: Limbs) -> bool:
    """Whether joints of these limbs are followed from within their limb alone, and follow there what is at one place."""
    place = {joint: (number, k) for number, limb in enumerate(limbs) for k, joint in enumerate(limb)}
    alike: dict[int, set[tuple[int, ...]]] = {}
    for joint, frame in enumerate(frames):
        if frame.mimic is None:
            continue
        own, led_by = place.get(joint), [place.get(leader) for leader in frame.mimic.leaders]
        if own is None and not any(led_by):
            continue
        if own is None or any(leader is None or leader[0] != own[0] for leader in led_by):
            return False
        alike.setdefault(own[1], set()).add(tuple(leader[1] for leader in led_by if leader is not None))
    return all(len(leaders) == 1 for leaders in alike.values())


def _type_of(frame: Frame) -> Hashable:
    return frame.joint.word, frame.mimic is None


def _pattern_of(frame: Frame) -> Hashable:
    """Return the pattern that decides which operations a frame costs. Those on the base turn constants alone."""
    if frame.parent == BASE:
        return frame.joint.word, frame.mimic is None, frame.quarters
    zeros = tuple(x == 0.0 for row in (*frame.rotation, frame.translation) for x in row)
    is_own = frame.mimic is None
    return frame.joint.word, is_own, frame.is_parallel, zeros, frame.offset == 0.0, frame.quarters


class LinkFrame(NamedTuple):
    """A frame that is fixed to a limb's body: axes and origin in the joint's frame. Numbers that differ between the
    limbs of a group have one value per limb."""

    rotation: NDArray[Any]
    translation: NDArray[Any]


@dataclass(frozen=True, slots=True)
class Place:
    """A joint outside all limbs (a joint of the core, such as a trunk), or the corresponding joints of all limbs, such
    as all knees.

    joints    number of the one joint, or the numbers limb by limb
    group     number of the group of limbs; None: a joint of the core
    is_first  whether it is the joint at which limbs are attached to the core
    """

    joints: tuple[int, ...]
    group: int | None = None
    is_first: bool = False

    def constant(self, values: Sequence[float]) -> Scalar:
        """Return one constant for this place, from the numbers of its joints. It is the number itself, or a constant with
        one value per limb (such as a leg)."""
        return values[0] if self.group is None else lanes(self.group, values)

    def placed(self, frames: Sequence[Placement]) -> LinkFrame | Placement:
        """Return one placement for this place, from the placements of its joints. Numbers that differ between limbs
        (such as legs) become constants with one value per limb."""
        if self.group is None:
            return frames[0]
        rotation, translation = np.empty((3, 3), object), np.empty(3, object)
        for i in range(3):
            translation[i] = self.constant([frame.translation[i] for frame in frames])
            for j in range(3):
                rotation[i, j] = self.constant([frame.rotation[i, j] for frame in frames])
        return LinkFrame(rotation, translation)

    def body(self, bodies: Sequence[Body]) -> Body:
        """One body, from one for each joint."""
        rows = [(body.mass, *body.moment, *body.second) for body in bodies]
        m, hx, hy, hz, *second = (self.constant(column) for column in zip(*rows, strict=True))
        return Body(m, (hx, hy, hz), tuple(second))


class LimbContact(NamedTuple):
    """The corresponding contacts of all limbs of a group, such as the feet of the legs.

    group    number of the group of limbs
    numbers  numbers of the contacts, limb by limb
    frame    one named frame for all, which moves with a place. Numbers that differ are constants per limb
    """

    group: int
    numbers: tuple[int, ...]
    frame: NamedFrame


def merged_contacts(named: Sequence[NamedFrame], among: Sequence[Place]) -> tuple[LimbContact, ...] | None:
    """Return the contacts of one limb of each group. Return None if a contact is not on a limb, or if the limbs of a
    group have other contacts."""
    contacts = [each for each in named if each.rows]
    found = []
    for place, own in enumerate(among):
        limbs = [[k for k, each in enumerate(contacts) if each.joint == joint] for joint in own.joints]
        rows = {tuple(contacts[k].rows for k in numbers) for numbers in limbs}
        if len(rows) > 1 or (rows != {()} and own.group is None):
            return None
        for numbers in zip(*limbs, strict=True):
            frames = [contacts[k] for k in numbers]
            merged = replace(frames[0], joint=place, placement=own.placed([f.placement for f in frames]))
            found.append(LimbContact(own.group or 0, numbers, merged))
    return tuple(sorted(found, key=lambda each: each.numbers))


def places(count: int, groups: Sequence[Limbs]) -> tuple[Place, ...]:
    """Return the places of a robot of `count` joints, in the order of their first joints. A place is one joint outside
    the limbs, or the joints at one place in all limbs of a group."""
    found = [
        Place(joints, number, k == 0)
        for number, limbs in enumerate(groups)
        for k, joints in enumerate(zip(*limbs, strict=True))
    ]
    taken = {joint for place in found for joint in place.joints}
    found += [Place((joint,)) for joint in range(count) if joint not in taken]
    return tuple(sorted(found, key=lambda place: place.joints[0]))


def one_limb(frames: Sequence[Frame], among: Sequence[Place]) -> tuple[Frame, ...]:
    """Return the joint frame of each place (one joint, or corresponding joints of all limbs), without setting
    Frame.limbs."""
    new = {joint: i for i, place in enumerate(among) for joint in place.joints} | {BASE: BASE}
    return tuple(
        replace(
            _merged([frames[joint] for joint in place.joints], place.group),
            parent=new[frames[place.joints[0]].parent],
            mimic=_mimic_of_place([frames[joint] for joint in place.joints], place, new),
        )
        for place in among
    )


def _mimic_of_place(frames: Sequence[Frame], place: Place, new: Mapping[int, int]) -> Mimic | None:
    """Return the places that the joint of a place follows, with a constant per limb if ratios or offsets differ."""
    mimics = [frame.mimic for frame in frames if frame.mimic is not None]
    if not mimics:
        return None
    shares = tuple(
        (new[own[0][0]], place.constant([ratio for _, ratio in own]))
        for own in zip(*(each.shares for each in mimics), strict=True)
    )
    return Mimic(shares, place.constant([each.offset for each in mimics]))


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
