"""Named frames: their placements, Jacobians and drifts, and the derivatives of their velocities."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from psdmc.dynamics.following import matrices_summed, on_coordinates
from psdmc.dynamics.frames import Frame, as_matrix, as_vector
from psdmc.dynamics.kinematics import AT_BASE, columns_at, forward_kinematics, path_to
from psdmc.dynamics.motion import sweep_outward
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, multiply, scale, transform
from psdmc.dynamics.slices import first_rates
from psdmc.robot.mechanism import NamedFrame

Root = tuple[Matrix, Vector]
"""Axes that the first joint frame turns from, as columns in the base frame, and their origin there."""


@on_coordinates()
def placed_frames(
    frames: Sequence[Frame], named: Sequence[NamedFrame], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[tuple[Vector, Matrix]]:
    """Compute the origin (m) and the rotation of each named frame in the base frame."""
    joints = _in_base(frames, q, root)
    return [
        (_point(joints[each.joint], each), multiply(joints[each.joint][0], _rotation(each))) for each in named
    ]


@on_coordinates(matrices_summed)
def frame_jacobians(
    frames: Sequence[Frame], named: Sequence[NamedFrame], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[list[list[Scalar]]]:
    """Compute the Jacobian, 6 x nv, of each named frame: linear velocity of its origin, then angular velocity, per unit
    joint rate, along the base's axes."""
    joints = _in_base(frames, q, root)
    found = []
    for each in named:
        point = _point(joints[each.joint], each)
        columns = columns_at(frames, each.joint, joints, point)
        found.append([[each_column[row] for each_column in columns] for row in range(6)])
    return found


@on_coordinates()
def frame_drifts(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[tuple[Scalar, ...]]:
    """Compute six values per named frame: acceleration of its origin, then angular acceleration, at constant joint
    rates, along the base's axes."""
    joints = _in_base(frames, q, root)
    forward = sweep_outward(frames, q, qd, None, [0.0] * first_rates(frames)[-1], ZERO)
    found = []
    for each in named:
        rotation, motion = joints[each.joint][0], forward.motions[each.joint]
        arm = as_vector(each.placement.translation.tolist())
        linear = add(motion.acceleration, transform(motion.spin.field, arm))
        angular = forward.rates[each.joint].dw_r
        found.append((*transform(rotation, linear), *transform(rotation, angular)))
    return found


@on_coordinates(matrices_summed)
def frame_velocity_slopes(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[list[list[Scalar]]]:
    """Compute 6 x nv derivatives per named frame: its velocity J qd (linear, then angular) by q along its tangent. The
    velocity is along the base's axes.

    Joint j moves what it carries along the twists (v, z) of its columns, one for each of its rates. Let w be the
    angular velocity of the link before joint j, and (u, s) the part of the frame's velocity that comes from joint j and
    later joints. The frame's velocity changes by (w x v + z x u, z x s), for two reasons: that part of the velocity is
    rotated, and the frame's origin moves in the velocity field of the link before the joint.
    """
    first, found = first_rates(frames), []
    for each, rows in zip(named, frame_jacobians(frames, named, q, root), strict=True):
        columns: list[tuple[Scalar, ...]] = [(0.0,) * 6] * first[-1]
        path = path_to(frames, each.joint)
        own = {j: range(first[j], first[j] + frames[j].joint.nv) for j in path}
        twists = {
            k: ((rows[0][k], rows[1][k], rows[2][k]), (rows[3][k], rows[4][k], rows[5][k]))
            for j in path
            for k in own[j]
        }
        turning = [_sum(scale(twists[k][1], qd[k]) for k in own[j]) for j in path]
        before = dict(zip(path, _running(turning), strict=True))
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


def _sum(parts: Iterable[Vector]) -> Vector:
    first, *others = parts
    for other in others:
        first = add(first, other)
    return first


def _running(parts: Sequence[Vector]) -> list[Vector]:
    """For each part the sum of all before it."""
    sums: list[Vector] = [ZERO]
    for part in parts[:-1]:
        sums.append(add(sums[-1], part))
    return sums


def link_wrenches(
    named: Sequence[NamedFrame], wrenches: Sequence[Sequence[Scalar]]
) -> dict[int, tuple[Vector, Vector]]:
    """Move wrenches from named frames to joint frames: force and moment about each joint frame's origin, along its
    axes. The given force and moment of a named frame are along that frame's axes, about its origin."""
    found: dict[int, tuple[Vector, Vector]] = {}
    for each, (fx, fy, fz, mx, my, mz) in zip(named, wrenches, strict=True):
        force = transform(_rotation(each), (fx, fy, fz))
        arm = as_vector(each.placement.translation.tolist())
        moment = add(transform(_rotation(each), (mx, my, mz)), cross(arm, force))
        own = found.get(each.joint, (ZERO, ZERO))
        found[each.joint] = (add(own[0], force), add(own[1], moment))
    return found


def _in_base(frames: Sequence[Frame], q: Sequence[Scalar], root: Root) -> list[tuple[Matrix, Vector]]:
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
