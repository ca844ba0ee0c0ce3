"""How bodies move: the outward sweep of Newton-Euler, once, for every use.

Each frame gets the matrix U = [w][w_r] + [dw_r] and the acceleration a of its origin, so that the body's point at r
accelerates with a + U r; newton_euler.py carries the wrenches that this asks of the bodies down to the axes.

w_r is a second ("reference") angular velocity, linear in qd_r; with qd_r = qd it is w and the result is ordinary inverse
dynamics. With qd_r apart the result is M qdd_r + C(q, qd) qd_r + g, where C is the matrix of
C_ij = sum_k tr(dT_k/dq_i S_k d/dt(dT_k/dq_j)^T) over the links' pseudo-inertias S_k, for which dM/dt - 2 C is
skew-symmetric: the Slotine-Li form.

Two choices that change the operation count, never the result:
compound  consecutive parallel axes turn w and dw once, by the sum of their angles, from the frame before the first.
fold      the last body is looked at from the frame before its joint's turn, where U differs from its predecessor's in
          six entries only; the body's parameters are turned instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from psdmc.dynamics.frames import (
    NO_TURN,
    Frame,
    Turn,
    from_previous,
    joined,
    joint_angle,
    joint_offset,
    outward,
)
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, multiply, transform, transpose


@dataclass(frozen=True, slots=True)
class Choices:
    """How the recursion is arranged; see the module's docstring. `fold_double_angle` turns the folded body's second
    moments by sincos(2 q) of its own instead of products of sincos(q); `add_sines` makes the compound turns' sincos from
    those of their parts instead of a sincos of the sum."""

    compound: bool = False
    fold: bool = False
    fold_double_angle: bool = False
    add_sines: bool = False


PLAIN = Choices()


class Spin(NamedTuple):
    """The velocity-dependent part of a frame's acceleration field.

    field        U, so that a point at r accelerates with a + U r
    differences  (Uzz - Uyy, Uxx - Uzz, Uyy - Uxx), formed from squares where that is cheaper
    """

    field: Matrix
    differences: Vector


class LinkMotion(NamedTuple):
    """How one body moves, in the frame its parameters are about."""

    acceleration: Vector
    spin: Spin


class Rates(NamedTuple):
    """Angular velocity, reference angular velocity and its derivative, of one frame in itself."""

    w: Vector
    w_r: Vector
    dw_r: Vector


AT_REST = Rates(ZERO, ZERO, ZERO)


class JointState(NamedTuple):
    """Where one joint stands: its turn relative to the frame before, and the offset of its origin there."""

    turn: Turn | None
    offset: Vector


class Forward(NamedTuple):
    """Result of the outward sweep. Bodies are in the frames that `motions` and `rates` are in: all after the joint's
    turn, but for a folded last one, whose rates stay those before it."""

    states: tuple[JointState, ...]
    compound_turns: tuple[Turn | None, ...]
    motions: tuple[LinkMotion, ...]
    rates: tuple[Rates, ...]
    folded: bool


def spin_of(rates: Rates) -> Spin:
    """U = [w][w_r] + [dw_r] = w_r w^T - (w . w_r) 1 + [dw_r]."""
    (wx, wy, wz), (rx, ry, rz), (ax, ay, az) = rates
    xx, yy, zz = wx * rx, wy * ry, wz * rz
    field = (
        (-(yy + zz), rx * wy - az, rx * wz + ay),
        (ry * wx + az, -(xx + zz), ry * wz - ax),
        (rz * wx - ay, rz * wy + ax, -(xx + yy)),
    )
    return Spin(field, (zz - yy, xx - zz, yy - xx))


def spin_before_turn(
    frame: Frame, previous: Spin, base: Rates, qd: Scalar, qd_r: Scalar, qdd_r: Scalar
) -> Spin:
    """The last frame's spin seen from before its turn: its predecessor's plus ([qd w_r + qd_r w + qd qd_r z] + qdd_r)[z]."""
    if frame.kind == "prismatic":
        rotated = _turned_field(frame, previous)
        return rotated
    if base.w is base.w_r and qd is qd_r:
        twice = qd + qd
        vx, vy, vz = twice * base.w[0], twice * base.w[1], qd * (base.w[2] + (base.w[2] + qd))
    else:
        vx = qd * base.w_r[0] + qd_r * base.w[0]
        vy = qd * base.w_r[1] + qd_r * base.w[1]
        vz = qd * base.w_r[2] + qd_r * (base.w[2] + qd)
    (u, d) = _turned_field(frame, previous)
    field = (
        (u[0][0] - vz, u[0][1] - qdd_r, u[0][2]),
        (u[1][0] + qdd_r, u[1][1] - vz, u[1][2]),
        (u[2][0] + vx, u[2][1] + vy, u[2][2]),
    )
    return Spin(field, (d[0] + vz, d[1] - vz, d[2]))


def _turned_field(frame: Frame, spin: Spin) -> Spin:
    """A spin of frame i-1 in frame i before its turn."""
    if frame.is_parallel:
        return spin
    outward_rows = transpose(frame.rotation)
    field = multiply(multiply(outward_rows, spin.field), frame.rotation)
    return Spin(field, _permuted_differences(frame.rotation, spin, field))


def _permuted_differences(rotation: Matrix, spin: Spin, field: Matrix) -> Vector:
    """The differences again: the old ones in another order where axes map to axes, else from the diagonal."""
    columns = transpose(rotation)
    axes = [next((k for k in range(3) if abs(column[k]) == 1.0), -1) for column in columns]
    known = {(2, 1): spin.differences[0], (0, 2): spin.differences[1], (1, 0): spin.differences[2]}
    known |= {(b, a): -value for (a, b), value in known.items()}

    def difference(a: int, b: int) -> Scalar:
        pair = (axes[a], axes[b])
        return known[pair] if pair in known else field[a][a] - field[b][b]

    return (difference(2, 1), difference(0, 2), difference(1, 0))


def sweep_outward(
    frames: Sequence[Frame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qd_r: Sequence[Scalar],
    qdd_r: Sequence[Scalar],
    base: Vector,
    choices: Choices = PLAIN,
) -> Forward:
    """Motions of all bodies; `base` is the base's acceleration, minus gravity (m/s^2, base frame)."""
    states: list[JointState] = []
    compound_turns: list[Turn | None] = []
    motions: list[LinkMotion] = []
    all_rates: list[Rates] = []
    rates, group = AT_REST, AT_REST
    angle, turn = NO_TURN, None
    group_rates: tuple[Scalar, Scalar, Scalar] = (0.0, 0.0, 0.0)
    previous = LinkMotion(base, spin_of(AT_REST))
    last = len(frames) - 1
    folded = choices.fold and last > 0
    for i, frame in enumerate(frames):
        own_angle = joint_angle(frame, q[i])
        offset = joint_offset(frame, q[i])
        joins = choices.compound and i > 0 and frame.is_parallel
        if not joins:
            group = _rates_before_turn(frame, rates)
            group_rates, angle = (0.0, 0.0, 0.0), NO_TURN
        angle = angle + own_angle
        if frame.kind == "revolute":
            group_rates = (group_rates[0] + qd[i], group_rates[1] + qd_r[i], group_rates[2] + qdd_r[i])
        same = qd[i] is qd_r[i] and group.w is group.w_r
        own_turn = own_angle.turn()
        turn = joined(turn, own_turn) if joins and choices.add_sines else angle.turn()
        shifted = from_previous(frame, add(previous.acceleration, transform(previous.spin.field, offset)))
        if folded and i == last:
            before = _rates_before_turn(frame, rates)
            spin = spin_before_turn(frame, previous.spin, before, qd[i], qd_r[i], qdd_r[i])
            acceleration = _slide(frame, shifted, before, qd[i], qd_r[i], qdd_r[i])
        else:
            rates = _rates_after_turn(group, turn, group_rates, same)
            spin = spin_of(rates)
            acceleration = _slide(frame, outward(own_turn, shifted), rates, qd[i], qd_r[i], qdd_r[i])
        previous = LinkMotion(acceleration, spin)
        states.append(JointState(own_turn, offset))
        compound_turns.append(turn)
        motions.append(previous)
        all_rates.append(rates)
    return Forward(tuple(states), tuple(compound_turns), tuple(motions), tuple(all_rates), folded)


def _rates_before_turn(frame: Frame, rates: Rates) -> Rates:
    w = from_previous(frame, rates.w)
    w_r = w if rates.w_r is rates.w else from_previous(frame, rates.w_r)
    return Rates(w, w_r, from_previous(frame, rates.dw_r))


def _rates_after_turn(
    group: Rates, turn: Turn | None, joint_rates: tuple[Scalar, Scalar, Scalar], same: bool
) -> Rates:
    """w = Rz^T w_g + z qd; dw_r = Rz^T dw_g + (Rz^T w_r,g) x z qd + z qdd_r."""
    qd, qd_r, qdd_r = joint_rates
    w_turned = outward(turn, group.w)
    w_r_turned = w_turned if same else outward(turn, group.w_r)
    dw_turned = outward(turn, group.dw_r)
    w = (w_turned[0], w_turned[1], w_turned[2] + qd)
    w_r = w if same else (w_r_turned[0], w_r_turned[1], w_r_turned[2] + qd_r)
    dw_r = (dw_turned[0] + w_r[1] * qd, dw_turned[1] - w_r[0] * qd, dw_turned[2] + qdd_r)
    return Rates(w, w_r, dw_r)


def _slide(frame: Frame, a: Vector, rates: Rates, qd: Scalar, qd_r: Scalar, qdd_r: Scalar) -> Vector:
    """What a sliding joint adds to its origin's acceleration: z qdd_r + w_r x z qd + w x z qd_r."""
    if frame.kind == "revolute":
        return a
    (wx, wy, _), (rx, ry, _) = rates.w, rates.w_r
    return (a[0] + (ry * qd + wy * qd_r), a[1] - (rx * qd + wx * qd_r), a[2] + qdd_r)
