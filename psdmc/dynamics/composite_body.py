"""Composite rigid bodies: the mass matrix from bodies joined from tip to base (Walker and Orin 1982; Featherstone 2008,
6.2)."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body, in_previous, joined, shifted, turned
from psdmc.dynamics.frames import BASE, Frame, inward, joint_angle, joint_offset, to_previous
from psdmc.dynamics.motion import PLAIN, Choices
from psdmc.dynamics.scalar import Scalar, add, cross
from psdmc.dynamics.twist import axis_twist, effort, momentum


def mass_matrix(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    choices: Choices = PLAIN,
) -> tuple[tuple[Scalar, ...], ...]:
    """M(q), n x n and symmetric (kg m^2, kg m, kg by joint types); exact zeros where neither joint carries the other."""
    n = len(frames)
    rows: list[list[Scalar]] = [[0.0] * n for _ in range(n)]
    angles = [joint_angle(frame, value) for frame, value in zip(frames, q, strict=True)]
    turns = [angle.turn() for angle in angles]
    offsets = [joint_offset(frame, value) for frame, value in zip(frames, q, strict=True)]
    composites = list(bodies)
    for i in reversed(range(n)):
        rows[i][i] = drive_inertia[i]
        force, moment = momentum(composites[i], axis_twist(frames[i].joint))
        j = i
        while True:
            rows[i][j] = rows[i][j] + effort(frames[j].joint, force, moment)
            rows[j][i] = rows[i][j]
            if frames[j].parent == BASE:
                break
            force = to_previous(frames[j], inward(turns[j], force))
            moment = to_previous(frames[j], inward(turns[j], moment))
            moment = add(moment, cross(offsets[j], force))
            j = frames[j].parent
        parent = frames[i].parent
        if parent != BASE:
            double = (angles[i] + angles[i]).turn() if choices.fold_double_angle else None
            before = turned(composites[i], turns[i], double)
            composites[parent] = joined(
                composites[parent], shifted(in_previous(frames[i], before), offsets[i])
            )
    return tuple(tuple(row) for row in rows)
