"""New joint frames for a robot, with which arithmetic is cheap: modified DH, with z along the joint's axis.

The new frames are used in generated code alone. E, P and theta_b do not depend on them, and joint variables keep their
zero. The x axis of a frame is along the common normal of the joint's axis and the axis of the child joint. The constant
rotation from frame to frame is then about x alone, and a right angle costs nothing. If a body has several children,
this holds for the first child. The frames of the other children are rotated about both z and x.

The origin of a frame on the joint's axis can be chosen (`feet`). It is where the axis meets the normal to the parent's
axis ("previous") or the normal to the first child's axis ("next"). The axis of a sliding joint has only a direction,
and is put through a neighbour's origin. A joint of several coordinates keeps its frame, because its rates are along
this frame's axes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from psdmc.dynamics.frames import (
    IDENTITY,
    Frame,
    as_matrix,
    as_vector,
    base_acceleration,
    frames_of,
    mimic_of,
)
from psdmc.dynamics.scalar import ZERO, Matrix, Vector
from psdmc.reproducible import angle_of, cross, length, times
from psdmc.robot.mechanism import BASE, Array, Loop, Mechanism, NamedFrame, Placement

Foot = Literal["previous", "next"]


@dataclass(frozen=True, slots=True, eq=False)
class Reframed:
    """A robot's geometry with new joint frames, from which code is generated.

    frames             n joint frames, each placed in the parent's frame
    base_acceleration  acceleration of the base minus gravity, m/s^2, along base_axes
    link_frames        n placements of the link frames of the robot file, in the new joint frames
    tip                placement of the tip frame in the new joint frame of the body `tip_body`
    base_axes          3 x 3, the axes in which the first frame is given, as columns in the robot's base frame
    tip_body           number of the body to which the tip frame is fixed
    base_origin        m, the origin from which frames on the base are given, in the robot's base frame
    named              the robot's named frames, placed in the new joint frames
    loops              the robot's closed loops, placed in the new joint frames; on the base, in the base frame
    """

    frames: tuple[Frame, ...]
    base_acceleration: Vector
    link_frames: tuple[Placement, ...]
    tip: Placement
    base_axes: Matrix
    tip_body: int
    base_origin: Vector
    named: tuple[NamedFrame, ...]
    loops: tuple[Loop, ...] = ()

    def is_same(self, other: Reframed) -> bool:
        """Return whether all numbers of the two robots' frames are equal."""
        return (
            (self.frames, self.base_acceleration, self.base_axes)
            == (other.frames, other.base_acceleration, other.base_axes)
            and all(map(_is_same, self.link_frames, other.link_frames))
            and _is_same(self.tip, other.tip)
        )


def _is_same(a: Placement, b: Placement) -> bool:
    return np.array_equal(a.rotation, b.rotation) and np.array_equal(a.translation, b.translation)


def reframe(chain: Mechanism, feet: Sequence[Foot], turns_base: bool = True) -> Reframed:
    """Return the robot with new joint frames in modified DH convention.

    feet        for each joint, whether the frame's origin is on the common normal to the previous axis or to the next axis
    turns_base  whether the base may be turned about the first axis, to align it with gravity
    """
    placed = _placed_at_zero(chain)
    reach = sum(length(joint.placement.translation) for joint in chain.joints) or 1.0
    axes = [clean_direction(place.rotation[:, 2]) for place in placed]
    origins = _origins(chain, placed, axes, feet)
    first = _first_x(chain, placed[0], axes[0]) if turns_base else placed[0].rotation[:, 0]
    before, after = _orientations(chain, placed, axes, origins, first)
    frames, link_frames = [], []
    for i, (joint, parent) in enumerate(zip(chain.joints, chain.parents, strict=True)):
        outer, foot = (before[0], origins[0]) if parent == BASE else (after[parent], origins[parent])
        rotation = np.eye(3) if i == 0 else _constant(chain, i, times(outer.T, before[i]))
        offset = np.zeros(3) if i == 0 else times(outer.T, origins[i] - foot)
        turn = times(before[i].T, after[i])
        angle = float(angle_of(turn[1, 0], turn[0, 0]))
        quarters = round(angle / (np.pi / 2))
        rest = angle - quarters * (np.pi / 2)
        frames.append(
            Frame(
                joint.type,
                parent,
                as_matrix(rotation.tolist()),
                as_vector(clean_lengths(offset, reach).tolist()),
                0.0 if abs(rest) < EXACT else float(rest),
                quarters % 4,
                mimic_of(chain, i),
            )
        )
        mine = Placement(after[i], origins[i])
        link_frames.append(without_rounding(mine.inverse() @ placed[i] @ joint.link_frame, reach))
    at_base = clean_lengths(times(before[0].T, -chain.gravity), length(chain.gravity))
    end = chain.tip_body
    tip = without_rounding(_moved(after, origins, placed, chain.tip_frame), reach)
    named = tuple(
        replace(frame, placement=without_rounding(_moved(after, origins, placed, frame), reach))
        for frame in chain.frames
    )
    loops = placed_loops(
        chain.loops, lambda end: without_rounding(_moved(after, origins, placed, end), reach)
    )
    base_axes = as_matrix(np.where(np.abs(before[0]) < EXACT, 0.0, before[0]).tolist())
    origin = as_vector((clean_lengths(origins[0], reach) + 0.0).tolist())
    return Reframed(
        tuple(frames),
        as_vector(at_base.tolist()),
        tuple(link_frames),
        tip,
        base_axes,
        end,
        origin,
        named,
        loops,
    )


def placed_loops(loops: Sequence[Loop], place: Callable[[NamedFrame], Placement]) -> tuple[Loop, ...]:
    """Return the loops with new placements of both frames."""
    return tuple(
        replace(
            loop,
            first=replace(loop.first, placement=place(loop.first)),
            second=replace(loop.second, placement=place(loop.second)),
        )
        for loop in loops
    )


def unmoved(chain: Mechanism) -> Reframed:
    """Return the robot with the joint frames of its file. They need more arithmetic than new frames, but the numbers of
    the file are used without rounding."""
    return Reframed(
        frames_of(chain),
        base_acceleration(chain),
        tuple(joint.link_frame for joint in chain.joints),
        chain.tip_frame.placement,
        IDENTITY,
        chain.tip_body,
        ZERO,
        chain.frames,
        chain.loops,
    )


def _moved(
    axes: Sequence[Array], origins: Sequence[Array], placed: Sequence[Placement], frame: NamedFrame
) -> Placement:
    """Where a named frame sits in the new frame of its joint."""
    k = frame.joint
    if k == BASE:
        return frame.placement
    return Placement(axes[k], origins[k]).inverse() @ placed[k] @ frame.placement


def _placed_at_zero(chain: Mechanism) -> list[Placement]:
    """Joint frames in the base frame at q = 0."""
    placed: list[Placement] = []
    for joint, parent in zip(chain.joints, chain.parents, strict=True):
        before = Placement.identity() if parent == BASE else placed[parent]
        placed.append(before @ joint.placement)
    return placed


def _first_children(chain: Mechanism) -> list[int | None]:
    """Each body's first child; None for a leaf."""
    found: list[int | None] = [None] * len(chain)
    for i, parent in reversed(list(enumerate(chain.parents))):
        if parent != BASE:
            found[parent] = i
    return found


def _has_direction_only(chain: Mechanism, i: int) -> bool:
    """Whether an axis may be shifted sideways: that of a joint that slides and does not turn."""
    kind = chain.joints[i].type
    return kind.about_z and not any(any(angular) for _, angular in kind.twists)


def _is_wide(chain: Mechanism, body: int) -> bool:
    """Whether a body's joint has several coordinates: its rates are along the frame's own axes, which stay as they are."""
    return body != BASE and not chain.joints[body].type.about_z


def _origins(
    chain: Mechanism, placed: Sequence[Placement], axes: Sequence[Array], feet: Sequence[Foot]
) -> list[Array]:
    """Origins of the joint frames at q = 0 in the base frame. The origins of parallel neighbours lie in one plane
    across them; sliding axes go through a neighbour's origin."""
    n, children = len(chain), _first_children(chain)
    points = [place.translation for place in placed]
    for i, child in reversed(list(enumerate(children))):
        if child is not None and feet[i] == "next" and _has_direction_only(chain, i):
            points[i] = points[child]
    origins: list[Array] = []
    for i in range(n):
        parent, child = chain.parents[i], children[i]
        if _is_wide(chain, i):
            origins.append(points[i])
            continue
        if feet[i] == "previous" and parent != BASE and _has_direction_only(chain, i):
            points[i] = origins[parent]
        foot = None
        if feet[i] == "next" and child is not None:
            foot = foot_towards(points[i], axes[i], points[child], axes[child])
        if foot is None and parent != BASE and not _is_wide(chain, parent):
            foot = foot_towards(points[i], axes[i], origins[parent], axes[parent])
        if foot is None:
            is_level = parent != BASE and (_is_wide(chain, parent) or nearly_parallel(axes[i], axes[parent]))
            reference = origins[parent] if is_level else points[i]
            foot = points[i] + axes[i] * times(axes[i], reference - points[i])
        origins.append(foot)
    return origins


def _orientations(
    chain: Mechanism,
    placed: Sequence[Placement],
    axes: Sequence[Array],
    origins: Sequence[Array],
    first: Array,
) -> tuple[list[Array], list[Array]]:
    """Each frame's axes before and after its joint's turn, at q = 0, as columns in the base frame. `first` is the x
    direction of the first frame."""
    children = _first_children(chain)
    before: list[Array] = []
    after: list[Array] = []
    for i, (parent, child) in enumerate(zip(chain.parents, children, strict=True)):
        if _is_wide(chain, i):
            before.append(exact_rotation(placed[i].rotation))
            after.append(before[i])
            continue
        x_before = first
        if _is_wide(chain, parent):
            x_before = min(after[parent].T, key=lambda x: abs(float(times(x, axes[i]))))
        elif parent != BASE:
            x_before = after[parent][:, 0]
            if children[parent] != i:
                x_before = normal_on_side_of(axes[parent], axes[i], origins[i] - origins[parent], x_before)
        elif i:
            x_before = min(before[0].T, key=lambda x: abs(float(times(x, axes[i]))))
        if i:
            x_before = across(x_before, axes[i])
        before.append(np.column_stack([x_before, cross(axes[i], x_before), axes[i]]))
        x_after = None
        if child is not None:
            x_after = common_normal(axes[i], axes[child], origins[child] - origins[i])
        if x_after is None:
            x_after = x_before if _has_direction_only(chain, i) else placed[i].rotation[:, 0]
        elif times(x_after, x_before) < -EXACT:
            x_after = -x_after
        after.append(np.column_stack([x_after, cross(axes[i], x_after), axes[i]]))
    return before, after


def _first_x(chain: Mechanism, first: Placement, axis: Array) -> Array:
    """The x direction of the first frame. The base may be turned about the first axis: with gravity across that axis, x
    points along gravity's part across it."""
    level = perpendicular(chain.gravity, axis)
    if np.linalg.norm(level) < EXACT * (1.0 + float(np.linalg.norm(chain.gravity))):
        return np.asarray(first.rotation[:, 0])
    local = times(first.rotation.T, level)
    if np.count_nonzero(np.abs(local) > EXACT * np.linalg.norm(level)) == 1:
        return np.asarray(first.rotation[:, 0])
    return clean_direction(level / length(level))


def _constant(chain: Mechanism, i: int, rotation: Array) -> Array:
    """The rotation between body i's frame and its parent's."""
    if _is_wide(chain, i) or _is_wide(chain, chain.parents[i]):
        return exact_rotation(rotation)
    return constant_rotation(rotation)


# Common normals of two joint axes
#
# Directions, and feet (the points where a normal meets the axes). Nearly parallel axes have no unique
# normal, and another direction perpendicular to them is used.


NEARLY_PARALLEL = 2e-2
"""Sine of the angle below which two axes are treated as parallel but for the rotation between them: their common
normal may lie kilometres away, and torques would be differences of huge numbers."""

LITTLE = 1e-2
"""Part of a vector across an axis below which rounding has changed its direction: it is made perpendicular once more."""


def nearly_parallel(a: Array, b: Array) -> bool:
    """Return whether two unit vectors are nearly parallel or opposite: the sine of their angle is less than
    NEARLY_PARALLEL."""
    return float(np.linalg.norm(cross(a, b))) < NEARLY_PARALLEL


def foot_towards(point: Array, axis: Array, other_point: Array, other_axis: Array) -> Array | None:
    """Return the point of a line that is nearest to another line; None if the lines are nearly parallel. A line is
    given by a point and a unit vector."""
    if nearly_parallel(axis, other_axis):
        return None
    normal = cross(axis, other_axis)
    square = times(normal, normal)
    along = times(cross(other_point - point, other_axis), normal) / square
    return np.asarray(point + along * axis)


def common_normal(axis: Array, following: Array, step: Array) -> Array | None:
    """Return the unit vector of the common normal of two axes, given by their directions. For nearly parallel axes, it
    is the part of `step` (from one origin to the next) that is perpendicular to them. Return None if this part is
    zero."""
    normal = cross(axis, following)
    if nearly_parallel(axis, following):
        normal = perpendicular(step, axis)
        if np.linalg.norm(normal) < EXACT:
            return None
    return clean_direction(normal / length(normal))


def normal_on_side_of(axis: Array, following: Array, step: Array, x: Array) -> Array:
    """Return the unit vector of the common normal of a body's axis and a child's axis. Of its two directions, the one
    nearer to x is chosen. Return x itself if the axes coincide. x is the body's x axis, along the normal to its first
    child."""
    own = common_normal(axis, following, step)
    if own is None:
        return x
    return -own if times(own, x) < -EXACT else own


def across(direction: Array, axis: Array) -> Array:
    """Return the part of a unit direction that is perpendicular to an axis, scaled to length one. If the part along the
    axis is only rounding, return the direction unchanged."""
    along = times(axis, direction)
    return direction if abs(along) < EXACT else clean_direction(direction - along * axis)


def perpendicular(vector: Array, axis: Array) -> Array:
    """Return the part of a vector that is perpendicular to a unit axis, even if this part is small."""
    part = vector - axis * times(axis, vector)
    if length(part) < LITTLE * length(vector):
        part = part - axis * times(axis, part)
    return np.asarray(part)


# Removal of rounding errors
#
# Numbers that are nearly zero, one or a short decimal become exactly so.


EXACT = 4e-15
"""Lengths (relative to the chain's reach) and direction cosines below this are rounding of an exact zero: some units in the
last place. A small joint's torque may be a hundredth of what passes it by: 1e-12 here has been 1e-10 there."""

DECIMALS = 12
"""A length that differs by rounding from one of so many decimals is replaced by that one, so that equal lengths stay
equal. See ROUNDING."""

ROUNDING = 1e-15
"""What composing placements can move a length by, relative to the chain's reach. Rounded to decimals beyond this, lengths of
centimetres would lose digits."""


def without_rounding(place: Placement, reach: float) -> Placement:
    """Return a placement in which numbers that differ from zero or one only by rounding are exactly zero or one."""
    return Placement(exact_rotation(place.rotation), clean_lengths(place.translation, reach) + 0.0)


def clean_direction(direction: Array) -> Array:
    """Return the unit vector along a direction. Entries that are only rounding become zero."""
    cleaned = np.where(np.abs(direction) < EXACT, 0.0, direction)
    return np.asarray(cleaned / length(cleaned))


def clean_lengths(lengths: Array, scale: float) -> Array:
    """Return lengths without rounding errors. Lengths that are nearly zero become zero. Lengths that are nearly a short
    decimal become this decimal, so that equal lengths stay equal."""
    cleaned = np.where(np.abs(lengths) < EXACT * scale, 0.0, lengths)
    nearest = np.round(cleaned, DECIMALS)
    return np.asarray(np.where(np.abs(nearest - cleaned) <= ROUNDING * scale, nearest, cleaned), np.float64)


def exact_rotation(rotation: Array) -> Array:
    """Return a rotation matrix in which entries that differ from zero or one only by rounding are exactly zero or
    one."""
    near = np.round(rotation)
    return np.asarray(np.where(np.abs(rotation - near) < EXACT, near, rotation) + 0.0)


def constant_rotation(rotation: Array) -> Array:
    """Return the constant rotation between two frames. It is a rotation about x and is made exactly so, unless the
    joint axes are nearly parallel."""
    turns_x = np.max(np.abs([*rotation[0, 1:], *rotation[1:, 0]])) > EXACT
    return rotation if turns_x else _about_x(rotation)


def _about_x(rotation: Array) -> Array:
    """The rotation about x nearest to this one, with exact zeros and ones."""
    c, s = float(rotation[1, 1]), float(rotation[2, 1])
    c, s = (0.0 if abs(v) < EXACT else v for v in (c, s))
    length = np.hypot(c, s)
    c, s = c / length, s / length
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
