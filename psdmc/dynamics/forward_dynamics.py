"""Joint accelerations from torques by articulated bodies (Featherstone 2008, 7.3), on the sweeps of Newton-Euler.

Three sweeps. Outward: each body's motion if no joint accelerated. Inward: the wrench that this motion requires and the
articulated inertia, the wrench per acceleration of the body's frame with all bodies beyond it; each joint takes the
component along its axis of both, and the rest goes to the parent. Outward: the joints' accelerations. The number of
operations per joint is fixed, while that of a factorized mass matrix grows with the square of how many joints carry a
body: fewer operations on long limbs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from psdmc.dynamics.articulated import (
    Articulated,
    along_parent,
    before_turn,
    both,
    from_rows,
    handed,
    moved_to,
    rigid,
    rows_of,
)
from psdmc.dynamics.body import Body
from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.following import any_follows
from psdmc.dynamics.frames import BASE, Frame, from_previous, outward
from psdmc.dynamics.motion import Forward, sweep_outward
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench, seen_bodies, sweep_inward
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross
from psdmc.dynamics.slices import first_rates, flat, rates
from psdmc.dynamics.solve import Factors, SingularMassMatrix, factorize, solve
from psdmc.dynamics.twist import combined, efforts, own_rates

Accelerations = tuple[list[Scalar], tuple[Scalar, ...]]
"""nv accelerations, and the nv pivots of the mass matrix."""


def forward_dynamics(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    tau: Sequence[Scalar],
    base: Vector,
    choices: Choices = PLAIN,
    external: Mapping[int, Wrench] = NO_WRENCHES,
) -> Accelerations:
    """Accelerations from torques, and the mass matrix's pivots as `factorize` has them, all positive where it is positive
    definite; arguments as those of `inverse_dynamics`, joints that follow no other.
    Raises SingularMassMatrix where a pivot is a constant not above 0."""
    if any_follows(frames):
        raise ValueError("a joint that follows another: its acceleration is not its own")
    still = [0.0] * first_rates(frames)[-1]
    forward = sweep_outward(frames, q, qd, None, still, base, choices)
    seen = seen_bodies(frames, bodies, q, forward, choices)
    inward = _Inward(frames, seen, drive_inertia, forward, rates(frames, tau))
    sweep_inward(frames, seen, drive_inertia, still, forward, choices, external, inward.yielded)
    return _swept_outward(frames, forward, inward.held), flat(joint.pivots for joint in inward.held)  # type: ignore[return-value]


@dataclass(frozen=True, slots=True)
class _Held:
    """Terms from which a joint's acceleration follows: that of `own`, minus the part of its frame's acceleration.

    own      nv accelerations if the frame before it did not accelerate besides
    loads    nv of six: the joint's own acceleration per unit of the frame's
    pivots   nv, as `factorize` has them
    along    the number of the frame's six accelerations that is the joint's own; None: none is, or it has a drive
    """

    own: list[Scalar]
    loads: list[list[Scalar]]
    pivots: tuple[Scalar, ...]
    along: int | None


@dataclass(slots=True)
class _Inward:
    """The inward sweep: articulated bodies so far, and what is known of each joint, children before parents."""

    frames: Sequence[Frame]
    bodies: Sequence[Body]
    drives: Sequence[Scalar]
    forward: Forward
    torques: Sequence[Scalar]
    beyond: dict[int, Articulated] = field(default_factory=dict)
    found: dict[int, _Held] = field(default_factory=dict)

    @property
    def held(self) -> list[_Held]:
        """Joint by joint."""
        return [self.found[i] for i in range(len(self.frames))]

    def yielded(self, i: int, needed: Sequence[Scalar]) -> Wrench:
        """Force that joint i passes on because its torques differ from `needed`, the torques that keep all rates
        constant."""
        frame, whole = self.frames[i], rigid(self.bodies[i])
        if i in self.beyond:
            whole = both(whole, self.beyond[i])
        given = own_rates(frame.joint, self.torques[i])
        left = [tau - own for tau, own in zip(given, needed, strict=True)]
        rows = rows_of(whole)
        columns = [_combined(rows, twist) for twist in frame.joint.twists]
        factors = self._factors(i, columns)
        along = _along(frame) if _is_nothing(self.drives[i]) else None
        own = solve(factors, left)
        if frame.parent == BASE:
            self.found[i] = _Held(own, [], factors.pivots, along)
            return ZERO, ZERO
        loads = _transposed([solve(factors, [column[k] for column in columns]) for k in range(6)])
        self.found[i] = _Held(own, loads, factors.pivots, along)
        self._hand_on(i, from_rows(_relieved(rows, columns, loads, along)))
        total = [_dot(own, [column[k] for column in columns]) for k in range(6)]
        return (total[0], total[1], total[2]), (total[3], total[4], total[5])

    def _factors(self, i: int, columns: Sequence[Sequence[Scalar]]) -> Factors:
        frame = self.frames[i]
        block = [list(efforts(frame.joint, (c[0], c[1], c[2]), (c[3], c[4], c[5]))) for c in columns]
        if frame.joint.about_z:
            block[0][0] = block[0][0] + self.drives[i]
        try:
            return factorize(block)
        except SingularMassMatrix as singular:
            raise SingularMassMatrix(first_rates(self.frames)[i] + singular.rate) from None

    def _hand_on(self, i: int, inertia: Articulated) -> None:
        frame, state = self.frames[i], self.forward.states[i]
        if not self.forward.folded[i]:
            inertia = before_turn(inertia, state.turn)
        inertia = handed(frame, moved_to(along_parent(frame, inertia), state.offset))
        known = self.beyond.get(frame.parent)
        self.beyond[frame.parent] = inertia if known is None else both(known, inertia)


def _swept_outward(frames: Sequence[Frame], forward: Forward, held: Sequence[_Held]) -> list[Scalar]:
    """Accelerations of joints from those that frames have besides, parents before children."""
    besides: list[tuple[Vector, Vector]] = []
    found: list[Scalar] = []
    for i, (frame, joint) in enumerate(zip(frames, held, strict=True)):
        if frame.parent == BASE:
            besides.append(combined(frame.joint, joint.own))
            found += joint.own
            continue
        linear, angular = besides[frame.parent]
        linear = add(linear, cross(angular, forward.states[i].offset))
        turn = None if forward.folded[i] else forward.states[i].turn
        linear, angular = (outward(turn, from_previous(frame, v)) for v in (linear, angular))
        own, moved = _accelerated(frame, joint, (*linear, *angular))
        found += own
        besides.append(moved)
    return found


def _accelerated(
    frame: Frame, joint: _Held, before: Sequence[Scalar]
) -> tuple[list[Scalar], tuple[Vector, Vector]]:
    """A joint's accelerations, and those of its frame besides; `before`: without the joint's."""
    if joint.along is not None:
        others = [k for k in range(6) if k != joint.along]
        whole = joint.own[0] - _dot([joint.loads[0][k] for k in others], [before[k] for k in others])
        values = [whole if k == joint.along else x for k, x in enumerate(before)]
        return [whole - before[joint.along]], _halves(values)
    own = [a - _dot(load, before) for a, load in zip(joint.own, joint.loads, strict=True)]
    linear, angular = combined(frame.joint, own)
    moved, turned = _halves(before)
    return own, (add(moved, linear), add(turned, angular))


def _along(frame: Frame) -> int | None:
    """Index of the frame's acceleration that is the joint's; None if it is not a single one."""
    if not frame.joint.about_z:
        return None
    ((linear, angular),) = frame.joint.twists
    weights = (*linear, *angular)
    return weights.index(1.0) if sorted(weights) == [0.0] * 5 + [1.0] else None


def _relieved(
    rows: Sequence[Sequence[Scalar]],
    columns: Sequence[Sequence[Scalar]],
    loads: Sequence[Sequence[Scalar]],
    along: int | None,
) -> list[list[Scalar]]:
    """The inertia seen through a joint that moves freely, its upper triangle; exactly nothing is left along the joint."""
    return [
        [
            0.0
            if b < a or along in (a, b)
            else rows[a][b] - _dot([c[a] for c in columns], [load[b] for load in loads])
            for b in range(6)
        ]
        for a in range(6)
    ]


def _combined(
    rows: Sequence[Sequence[Scalar]], twist: tuple[Sequence[float], Sequence[float]]
) -> list[Scalar]:
    weights = (*twist[0], *twist[1])
    found = []
    for row in rows:
        total: Scalar = 0.0
        for value, weight in zip(row, weights, strict=True):
            if weight:
                total = total + (value if weight == 1.0 else value * weight)
        found.append(total)
    return found


def _transposed(rows: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    return [list(column) for column in zip(*rows, strict=True)]


def _halves(values: Sequence[Scalar]) -> tuple[Vector, Vector]:
    return (values[0], values[1], values[2]), (values[3], values[4], values[5])


def _dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    total: Scalar = 0.0
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def _is_nothing(value: Scalar) -> bool:
    return isinstance(value, float) and value == 0.0
