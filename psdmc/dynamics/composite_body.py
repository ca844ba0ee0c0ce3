"""Composite rigid body: the mass matrix from bodies gathered tip to base (Walker and Orin 1982; Featherstone 2008, 6.2)."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body, in_previous, joined, shifted, turned
from psdmc.dynamics.frames import Frame, inward, joint_angle, joint_offset, to_previous
from psdmc.dynamics.motion import PLAIN, Choices
from psdmc.dynamics.scalar import Scalar, Vector, add, cross


def mass_matrix(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    choices: Choices = PLAIN,
) -> tuple[tuple[Scalar, ...], ...]:
    """M(q), n x n and symmetric (kg m^2, kg m, kg by joint kinds)."""
    n = len(frames)
    rows: list[list[Scalar]] = [[0.0] * n for _ in range(n)]
    angles = [joint_angle(frame, value) for frame, value in zip(frames, q, strict=True)]
    turns = [angle.turn() for angle in angles]
    offsets = [joint_offset(frame, value) for frame, value in zip(frames, q, strict=True)]
    composite = bodies[n - 1]
    for i in reversed(range(n)):
        rows[i][i] = drive_inertia[i]
        force, moment = unit_rate_momentum(frames[i], composite)
        for j in reversed(range(i + 1)):
            along = moment[2] if frames[j].kind == "revolute" else force[2]
            rows[i][j] = rows[i][j] + along
            rows[j][i] = rows[i][j]
            if j > 0:
                force = to_previous(frames[j], inward(turns[j], force))
                moment = to_previous(frames[j], inward(turns[j], moment))
                moment = add(moment, cross(offsets[j], force))
        if i > 0:
            double = (angles[i] + angles[i]).turn() if choices.fold_double_angle else None
            before = turned(composite, turns[i], double)
            composite = joined(bodies[i - 1], shifted(in_previous(frames[i], before), offsets[i]))
    return tuple(tuple(row) for row in rows)


def unit_rate_momentum(frame: Frame, body: Body) -> tuple[Vector, Vector]:
    """Momentum and angular momentum about the frame's origin of a body that moves at unit rate along the joint."""
    hx, hy, _ = body.moment
    if frame.kind == "prismatic":
        return (0.0, 0.0, body.mass), (hy, -hx, 0.0)
    xx, yy, _, _, xz, yz = body.second
    return (-hy, hx, 0.0), (-xz, -yz, xx + yy)
