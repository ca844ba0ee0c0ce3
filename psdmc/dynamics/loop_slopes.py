"""Derivatives of closed loops by joint positions and rates: of their accelerations, their forces' torques and their errors.

Seen from its first frame, a loop is a chain of joints to its second frame: those that carry the first frame, outwards in,
then those that carry the second one. A joint that carries the first frame moves the chain behind it against its own
motion, and its axes stay with the part before it. All vectors are along the axes of the first frame.

Source: Featherstone 2008, chapter 8.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from psdmc.dynamics.closed_loops import Part, part_of, rotation_slope
from psdmc.dynamics.following import both_summed, columns_summed, matrices_summed, on_coordinates
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.kinematics import AT_BASE
from psdmc.dynamics.named_frames import Root
from psdmc.dynamics.scalar import (
    ZERO,
    Scalar,
    Vector,
    add,
    cross,
    dot,
    scale,
    transform,
    transpose,
)
from psdmc.robot.mechanism import Loop


class _Step(NamedTuple):
    """A joint of a loop's chain.

    twists  by the number of the rate, the second frame's velocity per unit rate: linear and angular
    inward  whether the joint carries the first frame
    """

    twists: dict[int, tuple[Vector, Vector]]
    inward: bool

    def sums(self, factors: Sequence[Scalar]) -> tuple[Vector, Vector]:
        """Return the sum of the joint's twists, each times the factor of its rate."""
        along, about = ZERO, ZERO
        for k, (v, z) in self.twists.items():
            along, about = add(along, scale(v, factors[k])), add(about, scale(z, factors[k]))
        return along, about


def _chain(part: Part) -> list[_Step]:
    turned = transpose(part.axes)
    order = sorted(
        zip(part.signs, part.numbers, part.frames, strict=True), key=lambda own: (own[0], own[0] * own[1])
    )
    return [
        _Step(
            {
                k: (transform(turned, part.columns[k][0]), transform(turned, part.columns[k][1]))
                for k in range(first, first + frame.joint.nv)
            },
            sign < 0,
        )
        for sign, first, frame in order
    ]


@on_coordinates(matrices_summed)
def loop_slopes(
    frames: Sequence[Frame],
    loops: Sequence[Loop],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[list[list[Scalar]]]:
    """Compute the derivatives of the loops' accelerations, J qdd + dJ/dt qd, by q, along its tangent, and by qd. Each has
    the rows of `loop_jacobian`.

    Before joint j, the chain has the angular velocity w and the angular acceleration dw. Relative to the part before it,
    joints from j on give the second frame the velocity (u, s) and the acceleration (b, c). Joint j has the twists (v, z).
    By q:   dw x v + w x (w x v) + 2 w x (z x u) + z x b,   w x (z x s) + z x c.
    By qd:  w x v + z x u + W x v + z x U,   W x z + z x s,  where W is w with the joint's own share, and U is u without it.
    For joints that carry the first frame, their own shares belong to w, dw, u, s, b and c the other way round.
    """
    nv = sum(frame.joint.nv for frame in frames)
    by_q, by_qd = [], []
    for loop in loops:
        chain = _chain(part_of(frames, loop, q, (), root))
        own_rates = [step.sums(qd) for step in chain]
        before = [(ZERO, ZERO)]
        for step, (_, about) in zip(chain, own_rates, strict=True):
            w, dw = before[-1]
            before.append((add(w, about), add(add(dw, cross(w, about)), step.sums(qdd)[1])))
        behind = [(ZERO, ZERO, ZERO, ZERO)]
        for step, (along, about) in zip(reversed(chain), reversed(own_rates), strict=True):
            u, s, b, c = behind[-1]
            more, turning = step.sums(qdd)
            b = add(add(b, cross(about, add(along, scale(u, 2.0)))), more)
            c = add(add(c, cross(about, s)), turning)
            behind.append((add(u, along), add(s, about), b, c))
        behind.reverse()
        moved, sped = ([(0.0,) * 6] * nv for _ in range(2))
        for place, step in enumerate(chain):
            inner, outer = (place + 1, place) if step.inward else (place, place + 1)
            (w, dw), (other, _) = before[inner], before[outer]
            (u, s, b, c), rest = behind[inner], behind[outer][0]
            for k, (v, z) in step.twists.items():
                carried, swung, spun = cross(w, v), cross(z, u), cross(z, s)
                bent = add(cross(dw, v), cross(w, add(carried, scale(swung, 2.0))))
                moved[k] = (*add(bent, cross(z, b)), *add(cross(w, spun), cross(z, c)))
                linear = add(add(carried, swung), add(cross(other, v), cross(z, rest)))
                sped[k] = (*linear, *add(cross(other, z), spun))
        by_q += _rows(loop, moved)
        by_qd += _rows(loop, sped)
    return [by_q, by_qd]


def _rows(loop: Loop, columns: Sequence[tuple[Scalar, ...]]) -> list[list[Scalar]]:
    return [[column[row] for column in columns] for row in loop.rows]


@on_coordinates(both_summed)
def loop_pushes(
    frames: Sequence[Frame],
    loops: Sequence[Loop],
    q: Sequence[Scalar],
    forces: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[list[Scalar]]:
    """Compute the derivatives of J^T f by q, along its tangent: nv x nv. The loops' forces f are constant along the axes of
    the first frames.

    A force F and a moment M on the second frame give joint i, with the twist (v, z), the torque v . F + z . M. Joint j turns
    the twists of the joints behind it: z_j . (v_i x F + z_i x M). For the joints before it, it moves the second frame:
    z_i . (v_j x F).
    """
    nv, rest = sum(frame.joint.nv for frame in frames), iter(forces)
    found: list[list[Scalar]] = [[0.0] * nv for _ in range(nv)]
    for loop in loops:
        six: list[Scalar] = [0.0] * 6
        for row in loop.rows:
            six[row] = next(rest)
        force, moment = (six[0], six[1], six[2]), (six[3], six[4], six[5])
        chain = _chain(part_of(frames, loop, q, (), root))
        for i, j, turns, (v, z), (along, about) in _pairs(chain):
            bent = add(cross(v, force), cross(z, moment))
            found[i][j] = found[i][j] + (dot(about, bent) if turns else dot(z, cross(along, force)))
    return found


def _pairs(
    chain: Sequence[_Step],
) -> Iterator[tuple[int, int, bool, tuple[Vector, Vector], tuple[Vector, Vector]]]:
    """Two rates i and j, whether j turns the twist of i, and both twists."""
    for place, step in enumerate(chain):
        for i, twist in step.twists.items():
            for other, mover in enumerate(chain):
                turns = other < place or (other == place and not step.inward)
                for j, moved in mover.twists.items():
                    yield i, j, turns, twist, moved


@on_coordinates(columns_summed)
def loop_error_slopes(
    frames: Sequence[Frame], loops: Sequence[Loop], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[list[Scalar]]:
    """Compute the derivatives of `loop_error` by q, along its tangent. Where loops are closed, they are the Jacobian."""
    nv = sum(frame.joint.nv for frame in frames)
    found: list[list[Scalar]] = []
    for loop in loops:
        part = part_of(frames, loop, q, (), root)
        columns = [(0.0,) * 6] * nv
        for step in _chain(part):
            for k, (v, z) in step.twists.items():
                columns[k] = (*v, *rotation_slope(loop.rows, part, z))
        found += _rows(loop, columns)
    return found
