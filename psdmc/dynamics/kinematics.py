"""Forward kinematics and the geometric Jacobian."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.following import columns_summed, on_coordinates
from psdmc.dynamics.frames import (
    BASE,
    IDENTITY,
    Frame,
    Rotation,
    Turn,
    as_matrix,
    as_vector,
    joint_offset,
    joint_turn,
)
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, multiply, transform
from psdmc.dynamics.slices import first_rates, positions
from psdmc.dynamics.twist import turned
from psdmc.robot.joints import Twist
from psdmc.robot.mechanism import Placement

AT_BASE: tuple[Matrix, Vector] = (IDENTITY, ZERO)
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
    linear, angular = turned(rotation, along), turned(rotation, about)
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
