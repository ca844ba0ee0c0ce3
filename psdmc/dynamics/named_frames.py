"""Named frames of a robot: placements, Jacobians, drifts (accelerations at constant joint rates), and derivatives of
the velocities."""

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
    """Compute the origin (m) and the rotation matrix of each named frame, relative to the base frame."""
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
    """Compute the drift of each named frame, that is, the accelerations of the frame at constant joint rates. Each
    drift has six values along the base's axes: acceleration of the origin, then angular acceleration."""
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
