"""The mass matrix from composite rigid bodies, which are joined from tip to base (Walker and Orin 1982; Featherstone
2008, 6.2)."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.coordinates import both_summed, first_rates, on_coordinates, positions
from psdmc.dynamics.frames import (
    BASE,
    Frame,
    Rotation,
    Turn,
    inward,
    joint_angle,
    joint_offset,
    joint_turn,
    to_previous,
)
from psdmc.dynamics.scalar import Scalar, Vector, add, cross
from psdmc.dynamics.spatial import Body, efforts, handed_body, in_previous, joined, momentum, shifted, turned


@on_coordinates(both_summed)
def mass_matrix(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    choices: Choices = PLAIN,
) -> tuple[tuple[Scalar, ...], ...]:
    """Compute M(q), nv x nv and symmetric (kg m^2, kg m, kg by joint types). Entries of two joints are exact zeros if
    neither joint carries the other.

    drive_inertia   n, one per joint; not used for joints with several rates
    """
    n, first = len(frames), first_rates(frames)
    rows: list[list[Scalar]] = [[0.0] * first[-1] for _ in range(first[-1])]
    own = positions(frames, q)
    turns = [joint_turn(frame, value) for frame, value in zip(frames, own, strict=True)]
    offsets = [joint_offset(frame, value) for frame, value in zip(frames, own, strict=True)]
    composites = list(bodies)
    for i in reversed(range(n)):
        # M_ji = s_j^T I_i s_i, I_i the composite of all bodies beyond joint i, for the joints j from i to the base.
        for k, twist in enumerate(frames[i].joint.twists):
            _fill_row(rows, first, first[i] + k, i, momentum(composites[i], twist), frames, turns, offsets)
        if frames[i].joint.about_z:
            rows[first[i]][first[i]] = rows[first[i]][first[i]] + drive_inertia[i]
        parent = frames[i].parent
        if parent != BASE:
            double = None
            if frames[i].joint.about_z and choices.fold_double_angle:
                angle = joint_angle(frames[i], own[i])
                double = (angle + angle).turn()
            before = turned(composites[i], turns[i], double)
            moved = shifted(in_previous(frames[i], before), offsets[i])
            composites[parent] = joined(composites[parent], handed_body(frames[i], moved))
    return tuple(tuple(row) for row in rows)


def _fill_row(
    rows: list[list[Scalar]],
    first: Sequence[int],
    row: int,
    i: int,
    wrench: tuple[Vector, Vector],
    frames: Sequence[Frame],
    turns: Sequence[Turn | Rotation | None],
    offsets: Sequence[Vector],
) -> None:
    """One rate of joint i: what its composite's momentum does along the rates up to it, of joints from i to the base."""
    (force, moment), j = wrench, i
    while True:
        for column, value in enumerate(efforts(frames[j].joint, force, moment), start=first[j]):
            if column <= row:
                rows[row][column] = rows[column][row] = value
        if frames[j].parent == BASE:
            return
        force = to_previous(frames[j], inward(turns[j], force))
        moment = to_previous(frames[j], inward(turns[j], moment))
        moment = add(moment, cross(offsets[j], force))
        j = frames[j].parent
