"""Closed loops of a mechanism: how far they are from closed, their Jacobian and their accelerations.

The module also has the derivatives of all these, and of the torques of the loops' forces.

A loop keeps two frames together that both move with the spanning tree. Let the first frame have the axes R, as columns.
Let the second frame's origin be at d from the first frame's. The loop's velocity is that of the second frame seen from
the first one, along its axes: R^T (v2 - v1 - w1 x d) and R^T (w2 - w1). A loop's forces act on the second frame, at its
origin, and with the opposite sign on the body of the first frame, at the same point.

For derivatives, a loop is a chain of joints from its first frame to its second one: those that carry the first frame,
outwards in, then those that carry the second one. A joint that carries the first frame moves the chain behind it against
its own motion, and its axes stay with the part before it. All vectors are along the axes of the first frame.

Sources: Featherstone 2008, chapter 8; Siciliano et al. 2009, section 2.8.3."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from psdmc.dynamics.coordinates import (
    as_tuple,
    both_summed,
    columns_summed,
    first_rates,
    flat,
    matrices_summed,
    on_coordinates,
    positions,
    rates,
)
from psdmc.dynamics.frames import BASE, Frame
from psdmc.dynamics.kinematics import (
    AT_BASE,
    Root,
    columns_at,
    frame_accelerations,
    joints_in_base,
    path_to,
    placed_frames,
)
from psdmc.dynamics.scalar import (
    ZERO,
    Matrix,
    Scalar,
    Vector,
    add,
    cross,
    dot,
    multiply,
    scale,
    transform,
    transpose,
)
from psdmc.robot.mechanism import Loop, NamedFrame

ANGULAR = 3
"""Number of the first row about an axis."""


@on_coordinates()
def loop_error(
    frames: Sequence[Frame], loops: Sequence[Loop], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[Scalar]:
    """Compute for each direction that a loop blocks how far the loop is from closed, along the axes of its first frame.

    Directions 0 to 2 have the position of the second frame. Directions 3 to 5 have 2 tan(angle / 2) times the axis of a
    rotation. If the loop blocks one or three of them, this is the rotation from the first frame to the second. If it
    blocks two, this is the smallest rotation that makes the two frames' axes of the third direction parallel.
    """
    found: list[Scalar] = []
    for loop in loops:
        part = part_of(frames, loop, q, (), root)
        values = (*transform(transpose(part.axes), part.apart), *_rotation(loop.rows, part))
        found += [values[row] for row in loop.rows]
    return found


def _rotation(rows: Sequence[int], part: Part) -> Vector:
    """The angular entries of an error; zeros if the loop blocks no rotation."""
    if rows[-1] < ANGULAR:
        return ZERO
    turn, free = part.turn, free_axis(rows)
    if free is not None:
        unit, axis = unit_and_axis(turn, free)
        return scale(cross(unit, axis), 2.0 / (1.0 + axis[free]))
    about = (turn[2][1] - turn[1][2], turn[0][2] - turn[2][0], turn[1][0] - turn[0][1])
    return scale(about, 2.0 / (1.0 + turn[0][0] + turn[1][1] + turn[2][2]))


def free_axis(rows: Sequence[int]) -> int | None:
    """Return the axis of the only rotation that a loop leaves free while it blocks two; None for other loops."""
    free = {0, 1, 2} - {row - ANGULAR for row in rows}
    return free.pop() if len(free) == 1 else None


def unit_and_axis(turn: Matrix, free: int) -> tuple[Vector, Vector]:
    """Return the axis number `free` of the first frame and of the second frame, along the first one's axes."""
    unit = [1.0 if row == free else 0.0 for row in range(3)]
    return (unit[0], unit[1], unit[2]), (turn[0][free], turn[1][free], turn[2][free])


def rotation_slope(rows: Sequence[int], part: Part, z: Vector) -> Vector:
    """Return the derivative of the angular entries of a loop's error as the second frame turns about z.

    With g, half of the error, it is z + z x g + (z . g) g; with two blocked rotations, it follows from the free axis.
    """
    if rows[-1] < ANGULAR:
        return ZERO
    free, error = free_axis(rows), _rotation(rows, part)
    half = scale(error, 0.5)
    if free is None:
        return add(add(z, cross(z, half)), scale(half, dot(z, half)))
    unit, axis = unit_and_axis(part.turn, free)
    moved, share = cross(z, axis), 1.0 / (1.0 + axis[free])
    return add(scale(cross(unit, moved), 2.0 * share), scale(error, -moved[free] * share))


@on_coordinates(columns_summed)
def loop_jacobian(
    frames: Sequence[Frame], loops: Sequence[Loop], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[list[Scalar]]:
    """Compute the Jacobian of all loops, one row of nv entries per blocked direction: velocities per unit joint rate."""
    found: list[list[Scalar]] = []
    nv = sum(frame.joint.nv for frame in frames)
    for loop in loops:
        part = part_of(frames, loop, q, (), root)
        rows: list[list[Scalar]] = [[0.0] * nv for _ in range(6)]
        turned = transpose(part.axes)
        for k, (along, about) in part.columns.items():
            for row, value in enumerate((*transform(turned, along), *transform(turned, about))):
                rows[row][k] = value
        found += [rows[row] for row in loop.rows]
    return found


@on_coordinates()
def loop_drift(
    frames: Sequence[Frame],
    loops: Sequence[Loop],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[Scalar]:
    """Compute the accelerations in all directions that loops block, at constant joint rates: the product dJ/dt qd.

    They are R^T (a2 - a1 - z1 x d - w1 x (w1 x d) - 2 w1 x u) and R^T (z2 - z1 - w1 x w), with the accelerations a of the
    origins, the angular accelerations z, and the velocity (u, w) of the second frame seen from the first one.
    """
    found: list[Scalar] = []
    for loop in loops:
        part = part_of(frames, loop, q, qd, root)
        (linear, angular), (own, turning) = part.accelerations
        w, (u, spin) = part.first_rate, part.velocity
        linear = _less(
            linear, own, cross(turning, part.apart), cross(w, add(cross(w, part.apart), scale(u, 2.0)))
        )
        angular = _less(angular, turning, cross(w, spin))
        turned = transpose(part.axes)
        values = (*transform(turned, linear), *transform(turned, angular))
        found += [values[row] for row in loop.rows]
    return found


def _less(value: Vector, *others: Vector) -> Vector:
    for other in others:
        value = (value[0] - other[0], value[1] - other[1], value[2] - other[2])
    return value


@dataclass(frozen=True)
class Part:
    """The joints of one loop, seen from the last body that carries both frames, as if it did not move.

    frames         the joints, whose parents are numbers in this list
    ends           the first and the second frame; the joint is BASE for a frame on the body that carries both
    q, qd          their positions and rates
    root           axes and origin of that body's frame
    numbers        for each joint, the number of its first rate among all joints' rates
    signs          for each joint, 1 if it carries the second frame, -1 if it carries the first one
    """

    frames: tuple[Frame, ...]
    ends: tuple[NamedFrame, NamedFrame]
    q: list[Scalar]
    qd: list[Scalar]
    root: Root
    numbers: tuple[int, ...]
    signs: tuple[int, ...]

    @cached_property
    def poses(self) -> tuple[tuple[Vector, Matrix], tuple[Vector, Matrix]]:
        """Origin and axes of both frames."""
        first, second = (
            self._placed(end)
            if end.joint == BASE
            else placed_frames(self.frames, [end], self.q, self.root)[0]
            for end in self.ends
        )
        return first, second

    @staticmethod
    def _placed(end: NamedFrame) -> tuple[Vector, Matrix]:
        (rows, (x, y, z)) = end.placement.rotation.tolist(), end.placement.translation.tolist()
        return (x, y, z), tuple(map(tuple, rows))  # type: ignore[return-value]

    @property
    def axes(self) -> Matrix:
        """The first frame's axes, as columns."""
        return self.poses[0][1]

    @property
    def apart(self) -> Vector:
        """The second frame's origin, from the first one's."""
        return _less(self.poses[1][0], self.poses[0][0])

    @property
    def turn(self) -> Matrix:
        """The second frame's axes along those of the first."""
        return multiply(transpose(self.axes), self.poses[1][1])

    @property
    def rates(self) -> list[tuple[int, int]]:
        """For each of the part's rates, its number among all rates, and its joint's sign."""
        own = zip(self.frames, self.numbers, self.signs, strict=True)
        return [(first + k, sign) for frame, first, sign in own for k in range(frame.joint.nv)]

    @cached_property
    def columns(self) -> dict[int, tuple[Vector, Vector]]:
        """Return the second frame's velocity, seen from the first one, per unit of each rate, by its number, before R^T."""
        found: dict[int, tuple[Vector, Vector]] = {}
        placed = joints_in_base(self.frames, self.q, self.root) if self.frames else []
        for end, own in zip(self.ends, (-1, 1), strict=True):
            columns = columns_at(self.frames, end.joint, placed, self.poses[1][0])
            for (number, sign), column in zip(self.rates, columns, strict=True):
                if sign == own:
                    x, y, z, rx, ry, rz = column if sign > 0 else [0.0 - value for value in column]
                    found[number] = (x, y, z), (rx, ry, rz)
        return found

    @property
    def velocity(self) -> tuple[Vector, Vector]:
        """The second frame's velocity seen from the first one, linear and angular."""
        linear, angular = ZERO, ZERO
        for (number, _), rate in zip(self.rates, self.qd, strict=True):
            along, about = self.columns[number]
            linear, angular = add(linear, scale(along, rate)), add(angular, scale(about, rate))
        return linear, angular

    @property
    def first_rate(self) -> Vector:
        """The first frame's angular velocity."""
        found = ZERO
        for (number, sign), rate in zip(self.rates, self.qd, strict=True):
            if sign < 0:
                found = _less(found, scale(self.columns[number][1], rate))
        return found

    @property
    def accelerations(self) -> tuple[tuple[Vector, Vector], tuple[Vector, Vector]]:
        """Accelerations of the second frame and of the first one, linear and angular, at constant rates."""
        found = []
        for end in reversed(self.ends):
            if end.joint == BASE:
                found.append((ZERO, ZERO))
                continue
            still = [0.0] * len(self.qd)
            ((x, y, z, *about),) = frame_accelerations(self.frames, [end], self.q, self.qd, still, self.root)
            found.append(((x, y, z), (about[0], about[1], about[2])))
        return found[0], found[1]


def part_of(
    frames: Sequence[Frame], loop: Loop, q: Sequence[Scalar], qd: Sequence[Scalar], root: Root
) -> Part:
    """The joints of a loop alone. `q` and `qd` have the values of all joints."""
    first, second = (path_to(frames, end.joint) for end in (loop.first, loop.second))
    shared = len([1 for a, b in zip(first, second, strict=False) if a == b])
    kept = sorted((*first[shared:], *second[shared:]))
    number = {joint: k for k, joint in enumerate(kept)}
    starts, here = first_rates(frames), positions(frames, q)
    moved = rates(frames, qd) if qd else [()] * len(frames)

    return Part(
        tuple(replace(frames[j], parent=number.get(frames[j].parent, BASE)) for j in kept),
        (
            replace(loop.first, joint=number.get(loop.first.joint, BASE)),
            replace(loop.second, joint=number.get(loop.second.joint, BASE)),
        ),
        flat(as_tuple(here[j]) for j in kept),
        flat(as_tuple(moved[j]) for j in kept),
        AT_BASE if shared else root,
        tuple(starts[j] for j in kept),
        tuple(1 if j in second else -1 for j in kept),
    )


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
