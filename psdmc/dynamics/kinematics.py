"""Forward kinematics and the geometric Jacobian."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.frames import BASE, IDENTITY, Frame, as_matrix, as_vector, joint_angle, joint_offset
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, multiply, transform
from psdmc.dynamics.twist import axis_twist, turned
from psdmc.robot.mechanism import Placement

AT_BASE: tuple[Matrix, Vector] = (IDENTITY, ZERO)
"""Rotation and origin of the base frame in itself."""


def forward_kinematics(frames: Sequence[Frame], q: Sequence[Scalar]) -> tuple[tuple[Matrix, Vector], ...]:
    """Rotation and origin (m) of every joint frame in the base frame."""
    placed: list[tuple[Matrix, Vector]] = []
    for frame, value in zip(frames, q, strict=True):
        rotation, origin = AT_BASE if frame.parent == BASE else placed[frame.parent]
        origin = add(origin, transform(rotation, joint_offset(frame, value)))
        rotation = rotation if frame.is_parallel else multiply(rotation, frame.rotation)
        turn = joint_angle(frame, value).turn()
        if turn is not None:
            rotation = _turned(rotation, turn.sine, turn.cosine)
        placed.append((rotation, origin))
    return tuple(placed)


def _turned(rotation: Matrix, s: Scalar, c: Scalar) -> Matrix:
    """rotation @ Rz"""
    rows = tuple((x * c + y * s, y * c - x * s, z) for x, y, z in rotation)
    return rows  # type: ignore[return-value]


def jacobian(
    frames: Sequence[Frame], body: int, place: Placement, q: Sequence[Scalar]
) -> tuple[tuple[Scalar, ...], ...]:
    """6 x n: velocity (linear, then angular) of a frame's origin per unit joint rate, in the base frame.

    body, place   the frame: the body that it is fixed to, and where it sits in that body's joint frame
    Columns of joints that do not carry the body are zero.
    """
    placed = forward_kinematics(frames, q)
    rotation, origin = placed[body]
    point = add(origin, transform(rotation, as_vector(place.translation.tolist())))
    columns: list[tuple[Scalar, ...]] = [(0.0,) * 6] * len(frames)
    for i in path_to(frames, body):
        columns[i] = column(frames[i], placed[i], point)
    return tuple(tuple(column[row] for column in columns) for row in range(6))


def column(frame: Frame, placed: tuple[Matrix, Vector], point: Vector) -> tuple[Scalar, ...]:
    """Velocity of a point, then angular velocity, that the joint's unit rate gives to what it carries."""
    rotation, origin = placed
    along, about = axis_twist(frame.joint)
    linear, angular = turned(rotation, along), turned(rotation, about)
    if any(about):
        arm = (point[0] - origin[0], point[1] - origin[1], point[2] - origin[2])
        linear = add(linear, cross(angular, arm)) if any(along) else cross(angular, arm)
    return (*linear, *angular)


def path_to(frames: Sequence[Frame], body: int) -> tuple[int, ...]:
    """The joints that carry a body, from the base outward, its own last."""
    path: list[int] = []
    while body != BASE:
        path.append(body)
        body = frames[body].parent
    return tuple(reversed(path))


def carried_by(frames: Sequence[Frame]) -> tuple[tuple[int, ...], ...]:
    """For each joint the joints beyond it, ascending: those that its motion carries along."""
    beyond: list[list[int]] = [[] for _ in frames]
    for k in range(len(frames)):
        for i in path_to(frames, k)[:-1]:
            beyond[i].append(k)
    return tuple(tuple(found) for found in beyond)


def frame_placement(
    frames: Sequence[Frame], body: int, place: Placement, q: Sequence[Scalar]
) -> tuple[Matrix, Vector]:
    """Rotation and origin (m) in the base frame of a frame that is fixed at `place` in a body's joint frame."""
    rotation, origin = forward_kinematics(frames, q)[body]
    point = add(origin, transform(rotation, as_vector(place.translation.tolist())))
    return multiply(rotation, as_matrix(place.rotation.tolist())), point
