"""Forward kinematics: placements, Jacobians, accelerations and their derivatives, of joint frames and of named frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate
from typing import NamedTuple

from psdmc.dynamics.coordinates import (
    columns_summed,
    each_summed,
    first_rates,
    matrices_summed,
    on_coordinates,
    positions,
)
from psdmc.dynamics.frames import (
    BASE,
    IDENTITY,
    Frame,
    Rotation,
    Turn,
    as_matrix,
    as_vector,
    inward,
    joint_offset,
    joint_turn,
    to_previous,
)
from psdmc.dynamics.motion import sweep_outward
from psdmc.dynamics.scalar import (
    ZERO,
    Matrix,
    Scalar,
    Vector,
    add,
    cross,
    multiply,
    scale,
    transform,
    transpose,
)
from psdmc.dynamics.spatial import turned_constant
from psdmc.robot.joints import Twist
from psdmc.robot.mechanism import NamedFrame, Placement

Root = tuple[Matrix, Vector]
"""Axes that the first joint frame turns from, as columns in the base frame, and their origin there."""

AT_BASE: Root = (IDENTITY, ZERO)
"""Rotation and origin of the base frame in itself."""


@on_coordinates()
def forward_kinematics(frames: Sequence[Frame], q: Sequence[Scalar]) -> tuple[tuple[Matrix, Vector], ...]:
    """Compute the rotation and the origin (m) of every joint frame in the base frame."""
    placed: list[tuple[Matrix, Vector]] = []
    for frame, value in zip(frames, positions(frames, q), strict=True):
        rotation, origin = AT_BASE if frame.parent == BASE else placed[frame.parent]
        origin = add(origin, transform(rotation, joint_offset(frame, value)))
        rotation = rotation if frame.is_parallel else multiply(rotation, frame.rotation)
        placed.append((_turned(rotation, joint_turn(frame, value)), origin))
    return tuple(placed)


def _turned(rotation: Matrix, turn: Turn | Rotation | None) -> Matrix:
    """The axes of a frame after its turn."""
    if turn is None:
        return rotation
    if isinstance(turn, Rotation):
        return multiply(rotation, turn.rows)
    s, c = turn
    rows = tuple((x * c + y * s, y * c - x * s, z) for x, y, z in rotation)
    return rows  # type: ignore[return-value]


@on_coordinates(columns_summed)
def jacobian(
    frames: Sequence[Frame], body: int, place: Placement, q: Sequence[Scalar]
) -> tuple[tuple[Scalar, ...], ...]:
    """Compute the geometric Jacobian, 6 x nv, of a frame: velocity of its origin (linear, then angular) per unit joint
    rate, in the base frame.

    body, place   the frame: the body to which it is fixed, and its placement in that body's joint frame

    Columns of joints that do not carry the body are zero.
    """
    placed = forward_kinematics(frames, q)
    rotation, origin = placed[body]
    point = add(origin, transform(rotation, as_vector(place.translation.tolist())))
    columns = columns_at(frames, body, placed, point)
    return tuple(tuple(column[row] for column in columns) for row in range(6))


def columns_at(
    frames: Sequence[Frame], body: int, placed: Sequence[tuple[Matrix, Vector]], point: Vector
) -> list[tuple[Scalar, ...]]:
    """Return, for each of the nv joint rates, the velocity of a point of a body and the body's angular velocity at unit
    rate.

    They are zero for joints that do not carry the body.

    body    index of the body
    placed  rotation and origin of each joint frame in the base frame
    point   m, in the base frame
    """
    first = first_rates(frames)
    columns: list[tuple[Scalar, ...]] = [(0.0,) * 6] * first[-1]
    for i in path_to(frames, body):
        for k, twist in enumerate(frames[i].joint.twists, start=first[i]):
            columns[k] = column(twist, placed[i], point)
    return columns


def column(twist: Twist, placed: tuple[Matrix, Vector], point: Vector) -> tuple[Scalar, ...]:
    """Return the velocity of a point, and the angular velocity, of a body that moves with a given twist, in the base
    frame.

    twist   linear velocity of a frame's origin and angular velocity, along the frame's axes
    placed  rotation and origin (m) of the frame in the base frame
    point   m, in the base frame
    """
    rotation, origin = placed
    along, about = twist
    linear, angular = turned_constant(rotation, along), turned_constant(rotation, about)
    if any(about):
        arm = (point[0] - origin[0], point[1] - origin[1], point[2] - origin[2])
        linear = add(linear, cross(angular, arm)) if any(along) else cross(angular, arm)
    return (*linear, *angular)


def path_to(frames: Sequence[Frame], body: int) -> tuple[int, ...]:
    """Return the joints that carry a body, from the base outward; the body's own joint is the last."""
    path: list[int] = []
    while body != BASE:
        path.append(body)
        body = frames[body].parent
    return tuple(reversed(path))


def carried_by(frames: Sequence[Frame]) -> tuple[tuple[int, ...], ...]:
    """For each joint, the joints that its motion carries along, in ascending order."""
    beyond: list[list[int]] = [[] for _ in frames]
    for k in range(len(frames)):
        for i in path_to(frames, k)[:-1]:
            beyond[i].append(k)
    return tuple(tuple(found) for found in beyond)


@on_coordinates()
def frame_placement(
    frames: Sequence[Frame], body: int, place: Placement, q: Sequence[Scalar]
) -> tuple[Matrix, Vector]:
    """Return the rotation and the origin (m), in the base frame, of a frame with placement `place` in a body's joint
    frame."""
    rotation, origin = forward_kinematics(frames, q)[body]
    point = add(origin, transform(rotation, as_vector(place.translation.tolist())))
    return multiply(rotation, as_matrix(place.rotation.tolist())), point


@on_coordinates()
def placed_frames(
    frames: Sequence[Frame], named: Sequence[NamedFrame], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[tuple[Vector, Matrix]]:
    """Compute the origin (m) and the rotation matrix of each named frame, relative to the base frame."""
    joints = joints_in_base(frames, q, root)
    return [
        (_point(joints[each.joint], each), multiply(joints[each.joint][0], _rotation(each))) for each in named
    ]


@on_coordinates(matrices_summed)
def frame_jacobians(
    frames: Sequence[Frame], named: Sequence[NamedFrame], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[list[list[Scalar]]]:
    """Compute the Jacobian, 6 x nv, of each named frame: linear velocity of its origin, then angular velocity, per unit
    joint rate, along the base's axes."""
    joints = joints_in_base(frames, q, root)
    found = []
    for each in named:
        point = _point(joints[each.joint], each)
        columns = columns_at(frames, each.joint, joints, point)
        found.append([[each_column[row] for each_column in columns] for row in range(6)])
    return found


@on_coordinates(matrices_summed)
def local_jacobians(
    frames: Sequence[Frame], named: Sequence[NamedFrame], q: Sequence[Scalar]
) -> list[list[list[Scalar]]]:
    """Compute the 6 x nv Jacobian of each named frame along the frame's own axes. The sweep carries these axes and the
    frame's origin from joint to joint towards the base."""
    first, own, found = first_rates(frames), positions(frames, q), []
    for each in named:
        columns: list[tuple[Scalar, ...]] = [(0.0,) * 6] * first[-1]
        rows, arm = transpose(_rotation(each)), as_vector(each.placement.translation.tolist())
        for i in reversed(path_to(frames, each.joint)):
            frame, turn = frames[i], joint_turn(frames[i], own[i])
            for k, (along, about) in enumerate(frame.joint.twists, start=first[i]):
                linear = turned_constant(rows, along)
                if any(about):
                    linear = add(linear, transform(rows, cross(about, arm)))
                columns[k] = (*linear, *turned_constant(rows, about))
            x, y, z = (to_previous(frame, inward(turn, row)) for row in rows)
            rows, arm = (x, y, z), add(joint_offset(frame, own[i]), to_previous(frame, inward(turn, arm)))
        found.append([[column[row] for column in columns] for row in range(6)])
    return found


def frame_drifts(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[tuple[Scalar, ...]]:
    """Compute six values per named frame: acceleration of its origin, then angular acceleration, at constant joint
    rates, along the base's axes."""
    return frame_accelerations(frames, named, q, qd, [0.0] * len(qd), root)


@on_coordinates()
def frame_accelerations(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[tuple[Scalar, ...]]:
    """Compute six values per named frame: acceleration of its origin, without gravity, then angular acceleration, along
    the base's axes."""
    joints = joints_in_base(frames, q, root)
    return [
        (*transform(joints[each.joint][0], linear), *transform(joints[each.joint][0], angular))
        for each, (linear, angular) in zip(named, _on_joints(frames, named, q, qd, qdd), strict=True)
    ]


@on_coordinates()
def local_accelerations(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
) -> list[tuple[Scalar, ...]]:
    """Compute the vectors that `frame_accelerations` computes along the axes of each named frame."""
    return [
        (*transform(transpose(_rotation(each)), linear), *transform(transpose(_rotation(each)), angular))
        for each, (linear, angular) in zip(named, _on_joints(frames, named, q, qd, qdd), strict=True)
    ]


def _on_joints(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
) -> Iterator[tuple[Vector, Vector]]:
    """Yield the linear and the angular acceleration of each named frame, along the axes of the joint frame that carries
    it."""
    forward = sweep_outward(frames, q, qd, None, qdd, ZERO)
    for each in named:
        motion, arm = forward.motions[each.joint], as_vector(each.placement.translation.tolist())
        yield add(motion.acceleration, transform(motion.spin.field, arm)), forward.rates[each.joint].dw_r


@on_coordinates(matrices_summed)
def frame_velocity_slopes(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[list[list[Scalar]]]:
    """Compute the derivatives of each named frame's velocity J qd by the joint positions: 6 x nv per frame.

    The velocity is linear, then angular, along the base's axes. A derivative by a joint's position is along the
    tangent: the position moves at a unit rate of the joint.

    The joint j moves the outer bodies along the twists (v, z), one twist for each rate. Let w be the angular velocity
    of the link before joint j. Let (u, s) be the part of the frame's velocity that comes from joint j and the joints
    after it. The frame's velocity then changes by (w x v + z x u, z x s). First, this part of the velocity is rotated.
    Second, the frame's origin moves within the velocity field of the link before the joint.
    """
    first, found = first_rates(frames), []
    for each, rows in zip(named, frame_jacobians(frames, named, q, root), strict=True):
        columns: list[tuple[Scalar, ...]] = [(0.0,) * 6] * first[-1]
        path = path_to(frames, each.joint)
        own, twists = twists_along(path, frames, first, rows)
        turning = [_sum(scale(twists[k][1], qd[k]) for k in own[j]) for j in path]
        before = dict(zip(path, accumulate(turning[:-1], add, initial=ZERO), strict=True))
        linear, angular = ZERO, ZERO
        for j in reversed(path):
            for k in own[j]:
                along, about = twists[k]
                linear, angular = add(linear, scale(along, qd[k])), add(angular, scale(about, qd[k]))
            for k in own[j]:
                along, about = twists[k]
                moved = add(cross(before[j], along), cross(about, linear))
                columns[k] = (*moved, *cross(about, angular))
        found.append([[column[row] for column in columns] for row in range(6)])
    return found


class FrameSlopes(NamedTuple):
    """Derivatives of the acceleration of each named frame, 6 x nv each: by q, along its tangent, by qd and by qdd."""

    by_q: list[list[list[Scalar]]]
    by_qd: list[list[list[Scalar]]]
    by_qdd: list[list[list[Scalar]]]


@on_coordinates(each_summed(matrices_summed))
def frame_acceleration_slopes(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> FrameSlopes:
    """Compute the derivatives of `frame_accelerations`, along the base's axes.

    As in `frame_velocity_slopes`, joint j moves what it carries along the twists (v, z) of its columns. The link before it
    has the angular velocity w, and dw is the derivative of w. Relative to that link, joints from j on give the frame the
    velocity (u, s) and the acceleration (b, c).

    By q, these are turned, and the frame's origin moves in the field of the link before:
        dw x v + w x (w x v) + 2 w x (z x u) + z x b,   w x (z x s) + z x c.
    By qd, with the joint's own velocity (V, Z), which is along (v, z) where the joint has one rate:
        2 (w x v + z x u) + Z x v - z x V,   w x z + z x s - z x Z.
    """
    by_qdd = frame_jacobians(frames, named, q, root)
    first, by_q, by_qd = first_rates(frames), [], []
    for each, rows in zip(named, by_qdd, strict=True):
        path = path_to(frames, each.joint)
        own, twists = twists_along(path, frames, first, rows)
        links, w, dw = {}, ZERO, ZERO
        for j in path:
            links[j] = w, dw
            about = _sum(scale(twists[k][1], qd[k]) for k in own[j])
            dw = add(add(dw, cross(w, about)), _sum(scale(twists[k][1], qdd[k]) for k in own[j]))
            w = add(w, about)
        positions_by, rates_by = ([(0.0,) * 6] * first[-1] for _ in range(2))
        u, s, b, c = ZERO, ZERO, ZERO, ZERO
        for j in reversed(path):
            w, dw = links[j]
            along, about = (_sum(scale(twists[k][part], qd[k]) for k in own[j]) for part in range(2))
            b = add(b, cross(about, add(along, scale(u, 2.0))))
            c = add(c, cross(about, s))
            u, s = add(u, along), add(s, about)
            for k in own[j]:
                b, c = add(b, scale(twists[k][0], qdd[k])), add(c, scale(twists[k][1], qdd[k]))
            for k in own[j]:
                v, z = twists[k]
                swung, carried, spun = cross(z, u), cross(w, v), cross(z, s)
                moved = add(cross(dw, v), cross(w, add(carried, scale(swung, 2.0))))
                positions_by[k] = (*add(moved, cross(z, b)), *add(cross(w, spun), cross(z, c)))
                linear, angular = scale(add(carried, swung), 2.0), add(cross(w, z), spun)
                if len(own[j]) > 1:  # a joint's own rates bend each other
                    linear = add(linear, add(cross(about, v), cross(along, z)))
                    angular = add(angular, cross(about, z))
                rates_by[k] = (*linear, *angular)
        by_q.append([[column[row] for column in positions_by] for row in range(6)])
        by_qd.append([[column[row] for column in rates_by] for row in range(6)])
    return FrameSlopes(by_q, by_qd, by_qdd)


def twists_along(
    path: Sequence[int], frames: Sequence[Frame], first: Sequence[int], rows: Sequence[Sequence[Scalar]]
) -> tuple[dict[int, range], dict[int, tuple[Vector, Vector]]]:
    """Return the numbers of the rates of each joint of a path, and the columns of these rates, linear and angular."""
    own = {j: range(first[j], first[j] + frames[j].joint.nv) for j in path}
    return own, {
        k: ((rows[0][k], rows[1][k], rows[2][k]), (rows[3][k], rows[4][k], rows[5][k]))
        for j in path
        for k in own[j]
    }


def _sum(parts: Iterable[Vector]) -> Vector:
    first, *others = parts
    for other in others:
        first = add(first, other)
    return first


def link_wrenches(
    named: Sequence[NamedFrame], wrenches: Sequence[Sequence[Scalar]]
) -> dict[int, tuple[Vector, Vector]]:
    """Return the external force and moment on each link, from the given wrenches on named frames.

    A given wrench is along the axes of the named frame, about this frame's origin. The result is along the axes of the
    joint frame that carries the named frame, about the joint frame's origin. Several wrenches on one link are added.
    """
    found: dict[int, tuple[Vector, Vector]] = {}
    for each, (fx, fy, fz, mx, my, mz) in zip(named, wrenches, strict=True):
        force = transform(_rotation(each), (fx, fy, fz))
        arm = as_vector(each.placement.translation.tolist())
        moment = add(transform(_rotation(each), (mx, my, mz)), cross(arm, force))
        own = found.get(each.joint, (ZERO, ZERO))
        found[each.joint] = (add(own[0], force), add(own[1], moment))
    return found


def joints_in_base(frames: Sequence[Frame], q: Sequence[Scalar], root: Root) -> list[tuple[Matrix, Vector]]:
    """Rotation and origin of every joint frame in the base frame."""
    axes, origin = root
    placed = forward_kinematics(frames, q)
    if root is AT_BASE:
        return list(placed)
    return [(multiply(axes, turned), add(origin, transform(axes, point))) for turned, point in placed]


def _rotation(frame: NamedFrame) -> Matrix:
    return as_matrix(frame.placement.rotation.tolist())


def _point(joint: tuple[Matrix, Vector], frame: NamedFrame) -> Vector:
    rotation, origin = joint
    return add(origin, transform(rotation, as_vector(frame.placement.translation.tolist())))
