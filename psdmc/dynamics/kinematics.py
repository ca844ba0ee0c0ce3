"""Forward kinematics and the geometric Jacobian."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.frames import Frame, as_matrix, as_vector, joint_angle, joint_offset
from psdmc.dynamics.scalar import Matrix, Scalar, Vector, add, cross, multiply, transform
from psdmc.robot.chain import Placement


def forward_kinematics(frames: Sequence[Frame], q: Sequence[Scalar]) -> tuple[tuple[Matrix, Vector], ...]:
    """Rotation and origin (m) of every joint frame in the base frame."""
    rotation: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    origin: Vector = (0.0, 0.0, 0.0)
    placed: list[tuple[Matrix, Vector]] = []
    for frame, value in zip(frames, q, strict=True):
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


def jacobian(frames: Sequence[Frame], tip: Placement, q: Sequence[Scalar]) -> tuple[tuple[Scalar, ...], ...]:
    """6 x n: velocity (linear, then angular) of the tip frame's origin per unit joint rate, in the base frame.

    `tip` is the tip frame in the last joint frame.
    """
    placed = forward_kinematics(frames, q)
    last_rotation, last_origin = placed[-1]
    point = add(last_origin, transform(last_rotation, as_vector(tip.translation.tolist())))
    columns: list[tuple[Scalar, ...]] = []
    for frame, (rotation, origin) in zip(frames, placed, strict=True):
        axis = (rotation[0][2], rotation[1][2], rotation[2][2])
        if frame.kind == "prismatic":
            columns.append((*axis, 0.0, 0.0, 0.0))
        else:
            arm = (point[0] - origin[0], point[1] - origin[1], point[2] - origin[2])
            columns.append((*cross(axis, arm), *axis))
    return tuple(tuple(column[row] for column in columns) for row in range(6))


def tip_placement(frames: Sequence[Frame], tip: Placement, q: Sequence[Scalar]) -> tuple[Matrix, Vector]:
    """Rotation and origin (m) of the tip frame in the base frame."""
    rotation, origin = forward_kinematics(frames, q)[-1]
    point = add(origin, transform(rotation, as_vector(tip.translation.tolist())))
    return multiply(rotation, as_matrix(tip.rotation.tolist())), point
