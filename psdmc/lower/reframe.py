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
    what_follows,
)
from psdmc.dynamics.scalar import ZERO, Matrix, Vector
from psdmc.lower.common_normals import (
    across,
    common_normal,
    foot_towards,
    nearly_parallel,
    normal_on_side_of,
    perpendicular,
)
from psdmc.lower.without_rounding import (
    EXACT,
    clean_direction,
    clean_lengths,
    constant_rotation,
    exact_rotation,
    without_rounding,
)
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
    placed, reach = _placed_at_zero(chain), _reach(chain)
    axes = [clean_direction(place.rotation[:, 2]) for place in placed]
    origins = _origins(chain, placed, axes, feet)
    first = _first_x(chain, placed[0], axes[0]) if turns_base else placed[0].rotation[:, 0]
    before, after = _orientations(chain, placed, axes, origins, first)
    frames, link_frames = [], []
    for i, (joint, parent) in enumerate(zip(chain.joints, chain.parents, strict=True)):
        outer, foot = (before[0], origins[0]) if parent == BASE else (after[parent], origins[parent])
        rotation = np.eye(3) if i == 0 else _constant(chain, i, times(outer.T, before[i]))
        offset = np.zeros(3) if i == 0 else times(outer.T, origins[i] - foot)
        angle = _angle_about_z(times(before[i].T, after[i]))
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
                what_follows(chain, i),
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


def _reach(chain: Mechanism) -> float:
    return sum(length(joint.placement.translation) for joint in chain.joints) or 1.0


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


def _angle_about_z(rotation: Array) -> float:
    return float(angle_of(rotation[1, 0], rotation[0, 0]))
