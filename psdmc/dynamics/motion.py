"""Motions of bodies: the outward sweep (from base to tip) of the Newton-Euler algorithm, written once for all its uses.

For each joint frame, the sweep computes the acceleration a of the origin and a 3 x 3 matrix U. A point of the body at r
then accelerates with a + U r. U is [w][w_r] + [dw_r], with the matrix [w] of the cross product with w. The file
newton_euler.py computes the forces and moments that these motions require.

w is the angular velocity. w_r is a second ("reference") angular velocity, linear in the reference joint rates qd_r.
Without qd_r, w_r is w and is not computed; the result is ordinary inverse dynamics. With qd_r, the torques are M qdd_r
+ C(q, qd) qd_r + g.

C is the matrix C_ij = sum_k tr(dT_k/dq_i S_k d/dt(dT_k/dq_j)^T). T_k is the 4 x 4 placement of link k, and S_k is the
link's pseudo-inertia (4 x 4 mass matrix). With this C, dM/dt - 2 C is skew-symmetric: the Slotine-Li form.

The options of the sweep (choices.py) change the number of operations, but not the result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.coordinates import positions
from psdmc.dynamics.coordinates import rates as rates_of
from psdmc.dynamics.frames import (
    BASE,
    IDENTITY,
    NO_TURN,
    Angle,
    Frame,
    Rotation,
    Turn,
    from_previous,
    joined,
    joint_angle,
    joint_offset,
    joint_turn,
    leaves,
    outward,
)
from psdmc.dynamics.scalar import (
    ZERO,
    Matrix,
    Scalar,
    Vector,
    add,
    cross,
    rotated_tensor,
    transform,
    transpose,
)
from psdmc.dynamics.spatial import combined


class Spin(NamedTuple):
    """The matrix U of a frame, which depends on the angular rates only. A point at r accelerates with a + U r, with the
    acceleration a of the frame's origin.

    field        the 3 x 3 matrix U
    differences  (Uzz - Uyy, Uxx - Uzz, Uyy - Uxx), computed from squares of rates if that takes fewer operations
    """

    field: Matrix
    differences: Vector


class Rates(NamedTuple):
    """Angular rates of one frame, along the frame's axes.

    w     angular velocity
    dw_r  derivative of the reference angular velocity
    w_r   reference angular velocity (of the Slotine-Li form); None: w takes the place of w_r
    """

    w: Vector
    dw_r: Vector
    w_r: Vector | None = None

    @property
    def reference(self) -> Vector:
        """The reference angular velocity."""
        return self.w if self.w_r is None else self.w_r


class JointRates(NamedTuple):
    """Rate, reference acceleration and reference rate of a joint that rotates about z or slides along z. If qd_r is
    None, qd takes the place of qd_r."""

    qd: Scalar
    qdd_r: Scalar
    qd_r: Scalar | None = None

    @property
    def reference(self) -> Scalar:
        return self.qd if self.qd_r is None else self.qd_r


def spin_of(rates: Rates) -> Spin:
    """Compute the matrix U = [w][w_r] + [dw_r] = w_r w^T - (w . w_r) 1 + [dw_r] from a frame's angular rates. [w] is
    the matrix of the cross product with w."""
    (wx, wy, wz), (rx, ry, rz), (ax, ay, az) = rates.w, rates.reference, rates.dw_r
    xx, yy, zz = wx * rx, wy * ry, wz * rz
    field = (
        (-(yy + zz), rx * wy - az, rx * wz + ay),
        (ry * wx + az, -(xx + zz), ry * wz - ax),
        (rz * wx - ay, rz * wy + ax, -(xx + yy)),
    )
    return Spin(field, (zz - yy, xx - zz, yy - xx))


def spin_before_turn(frame: Frame, previous: Spin, before: Rates, turning: JointRates | None) -> Spin:
    """Compute the matrix U of a body without children, along the axes before the body's rotation.

    The result is the parent's matrix U plus ([qd w_r + qd_r w + qd qd_r z] + qdd_r)[z]. [z] is the matrix of the cross
    product with the joint's axis z.
    """
    (u, d) = _turned_field(frame, previous)
    if turning is None:
        return Spin(u, d)
    qd, qdd_r, w = turning.qd, turning.qdd_r, before.w
    if turning.qd_r is None or before.w_r is None:
        twice = qd + qd
        vx, vy, vz = twice * w[0], twice * w[1], qd * (w[2] + (w[2] + qd))
    else:
        qd_r, w_r = turning.qd_r, before.w_r
        vx, vy, vz = (
            qd * w_r[0] + qd_r * w[0],
            qd * w_r[1] + qd_r * w[1],
            qd * w_r[2] + qd_r * (w[2] + qd),
        )
    field = (
        (u[0][0] - vz, u[0][1] - qdd_r, u[0][2]),
        (u[1][0] + qdd_r, u[1][1] - vz, u[1][2]),
        (u[2][0] + vx, u[2][1] + vy, u[2][2]),
    )
    return Spin(field, (d[0] + vz, d[1] - vz, d[2]))


def _turned_field(frame: Frame, spin: Spin) -> Spin:
    """The spin of the parent's frame, along this frame's axes before its turn."""
    if frame.is_parallel:
        return spin
    field = rotated_tensor(frame.outward_rows, spin.field)
    return Spin(field, _permuted_differences(frame.rotation, spin, field))


def _permuted_differences(rotation: Matrix, spin: Spin, field: Matrix) -> Vector:
    """The differences of the turned field: the old ones in another order where axes map to axes, else from the
    diagonal."""
    axes = [_axis(column) for column in transpose(rotation)]
    known = {(2, 1): spin.differences[0], (0, 2): spin.differences[1], (1, 0): spin.differences[2]}
    known |= {(b, a): -value for (a, b), value in known.items()}

    def difference(a: int, b: int) -> Scalar:
        pair = (axes[a], axes[b])
        return known[pair] if pair in known else field[a][a] - field[b][b]

    return (difference(2, 1), difference(0, 2), difference(1, 0))


def _axis(direction: Vector) -> int:
    """Return the number of the axis that a direction is along, in either sense; -1 if it is along none. Beside a cosine
    that is 1.0, a sine may be 1e-9."""
    sizes = tuple(map(abs, direction))
    return IDENTITY.index(sizes) if sizes in IDENTITY else -1


class LinkMotion(NamedTuple):
    """The motion of one body: the acceleration of the frame's origin, and the matrix U of the angular rates. A point at
    r accelerates with a + U r, along the frame's axes."""

    acceleration: Vector
    spin: Spin


class JointState(NamedTuple):
    """A joint's position: the rotation relative to the parent's frame, and the origin of the joint's frame in the
    parent's frame."""

    turn: Turn | Rotation | None
    offset: Vector


class Forward(NamedTuple):
    """Result of the outward sweep, with one entry per body in each tuple.

    `motions` and `rates` are along the axes of the body's frame, after the joint's rotation. For folded bodies (an
    option in choices.py), `motions` are along the axes before the rotation, and `rates` are those of the parent.
    `joins` is true if the body's joint is parallel to the parent's joint, and both rotations are computed as one, by
    the sum of the angles.
    """

    states: tuple[JointState, ...]
    compound_turns: tuple[Turn | Rotation | None, ...]
    motions: tuple[LinkMotion, ...]
    rates: tuple[Rates, ...]
    folded: tuple[bool, ...]
    joins: tuple[bool, ...]


class _Group(NamedTuple):
    """Parallel axes that turn as one: rates in the frame before the first turn, and the sums over the joints so far."""

    before: Rates
    turning: JointRates
    angle: Angle
    turn: Turn | None


class _Moved(NamedTuple):
    """One body after the sweep has computed its motion.

    group   None: its joint does not turn about z alone, and no other turns as one with it
    joins   whether it turns as one with its parent
    """

    state: JointState
    motion: LinkMotion
    rates: Rates
    group: _Group | None
    joins: bool

    @property
    def compound_turn(self) -> Turn | Rotation | None:
        """Return the rotation by this joint and by the preceding joints of the group with parallel axes."""
        return self.state.turn if self.group is None else self.group.turn


def sweep_outward(
    frames: Sequence[Frame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qd_r: Sequence[Scalar] | None,
    qdd_r: Sequence[Scalar],
    base_acceleration: Vector,
    choices: Choices = PLAIN,
) -> Forward:
    """Compute the motions of all bodies from the joint positions, rates and accelerations, from base to tip.

    base_acceleration  the base's acceleration minus gravity, m/s^2, along the base's axes
    qd_r               reference joint rates of the Slotine-Li form; None: qd takes their place
    """
    at_base = _resting(base_acceleration, qd_r is not None)
    folded = tuple(
        is_leaf and frame.parent != BASE and frame.joint.about_z and choices.fold
        for is_leaf, frame in zip(leaves(frames), frames, strict=True)
    )
    own, rates, changes = positions(frames, q), rates_of(frames, qd), rates_of(frames, qdd_r)
    references = None if qd_r is None else rates_of(frames, qd_r)
    moved: list[_Moved] = []
    for i, frame in enumerate(frames):
        parent = at_base if frame.parent == BASE else moved[frame.parent]
        given = (rates[i], changes[i], None if references is None else references[i])
        if frame.joint.about_z:
            moved.append(_swept(frame, parent, own[i], given, choices, folded[i]))
        else:
            moved.append(_swept_freely(frame, parent, own[i], given))
    return Forward(
        tuple(body.state for body in moved),
        tuple(body.compound_turn for body in moved),
        tuple(body.motion for body in moved),
        tuple(body.rates for body in moved),
        folded,
        tuple(body.joins for body in moved),
    )


def _resting(base_acceleration: Vector, two_velocities: bool) -> _Moved:
    """The motion of the base: it accelerates and does not turn."""
    rates = Rates(ZERO, ZERO, ZERO if two_velocities else None)
    group = _Group(rates, _no_turning(rates), NO_TURN, None)
    return _Moved(JointState(None, ZERO), LinkMotion(base_acceleration, spin_of(rates)), rates, group, False)


def _no_turning(rates: Rates) -> JointRates:
    return JointRates(0.0, 0.0, None if rates.w_r is None else 0.0)


def _swept(
    frame: Frame,
    parent: _Moved,
    q: Scalar,
    given: tuple[Scalar, Scalar, Scalar | None],
    choices: Choices,
    is_folded: bool,
) -> _Moved:
    """The motion of one body from its parent's; `given` are the joint's rate, reference acceleration and reference
    rate."""
    own_angle, offset = joint_angle(frame, q), joint_offset(frame, q)
    turning, sliding = (_along(part, given) for part in (frame.joint.turn, frame.joint.slide))
    group = parent.group
    joins = frame.parent != BASE and frame.is_parallel and group is not None and choices.compound
    if group is None or not joins:
        before = _rates_before_turn(frame, parent.rates)
        group = _Group(before, _no_turning(before), NO_TURN, None)
    angle = group.angle + own_angle
    summed = group.turning if turning is None else _added(group.turning, turning)
    own_turn = own_angle.turn()
    turn = joined(group.turn, own_turn) if joins and choices.add_sines else angle.turn()
    field = transform(parent.motion.spin.field, offset)
    shifted = from_previous(frame, add(parent.motion.acceleration, field))
    if is_folded:
        rates, before = parent.rates, _rates_before_turn(frame, parent.rates)
        spin = spin_before_turn(frame, parent.motion.spin, before, turning)
        acceleration = _slid(shifted, before, sliding)
    else:
        rates = _rates_after_turn(group.before, turn, summed)
        spin = spin_of(rates)
        acceleration = _slid(outward(own_turn, shifted), rates, sliding)
    group = _Group(group.before, summed, angle, turn)
    return _Moved(JointState(own_turn, offset), LinkMotion(acceleration, spin), rates, group, joins)


def _swept_freely(
    frame: Frame, parent: _Moved, q: Scalar, given: tuple[Scalar, Scalar, Scalar | None]
) -> _Moved:
    """One body whose joint has several coordinates; `given` are tuples of its rates, along the moved frame's axes.

    With u and s the joint's linear and angular rates, w and w_r from the parent: w becomes w + s, dw_r gets w_r x s and the
    origin's acceleration w_r x u + (w + s) x u_r, beside what the accelerations give.
    """
    turn, offset = joint_turn(frame, q), joint_offset(frame, q)
    field = transform(parent.motion.spin.field, offset)
    acceleration = outward(turn, from_previous(frame, add(parent.motion.acceleration, field)))
    before = _rates_before_turn(frame, parent.rates)
    w, w_r, dw_r = (outward(turn, v) for v in (before.w, before.reference, before.dw_r))
    qd, qdd_r, qd_r = given
    (u, s), (u_change, s_change) = combined(frame.joint, qd), combined(frame.joint, qdd_r)
    u_r, s_r = (u, s) if qd_r is None else combined(frame.joint, qd_r)
    whole = add(w, s)
    dw_r = add(add(dw_r, cross(w_r, s)), s_change)
    acceleration = add(add(acceleration, add(cross(w_r, u), cross(whole, u_r))), u_change)
    rates = Rates(whole, dw_r, None if before.w_r is None else add(w_r, s_r))
    motion = LinkMotion(acceleration, spin_of(rates))
    return _Moved(JointState(turn, offset), motion, rates, None, False)


def _along(
    part: Callable[[Scalar], Scalar | None], given: tuple[Scalar, Scalar, Scalar | None]
) -> JointRates | None:
    """The rates of a joint's turn, or of its slide; None where it has none."""
    qd, qdd_r, qd_r = given
    rate = part(qd)
    return None if rate is None else JointRates(rate, part(qdd_r), None if qd_r is None else part(qd_r))


def _added(a: JointRates, b: JointRates) -> JointRates:
    qd_r = None if a.qd_r is None or b.qd_r is None else a.qd_r + b.qd_r
    return JointRates(a.qd + b.qd, a.qdd_r + b.qdd_r, qd_r)


def _rates_before_turn(frame: Frame, rates: Rates) -> Rates:
    w = from_previous(frame, rates.w)
    w_r = None if rates.w_r is None else from_previous(frame, rates.w_r)
    return Rates(w, from_previous(frame, rates.dw_r), w_r)


def _rates_after_turn(group: Rates, turn: Turn | None, turning: JointRates) -> Rates:
    """w = Rz^T w_g + z qd; dw_r = Rz^T dw_g + (Rz^T w_r,g) x z qd + z qdd_r."""
    qd = turning.qd
    w_turned = outward(turn, group.w)
    w_r_turned = None if group.w_r is None else outward(turn, group.w_r)
    dw_turned = outward(turn, group.dw_r)
    w = (w_turned[0], w_turned[1], w_turned[2] + qd)
    w_r = None if w_r_turned is None else (w_r_turned[0], w_r_turned[1], w_r_turned[2] + turning.reference)
    reference = w if w_r is None else w_r
    dw_r = (
        dw_turned[0] + reference[1] * qd,
        dw_turned[1] - reference[0] * qd,
        dw_turned[2] + turning.qdd_r,
    )
    return Rates(w, dw_r, w_r)


def _slid(a: Vector, rates: Rates, sliding: JointRates | None) -> Vector:
    """The origin's acceleration with what a sliding joint adds: z qdd_r + w_r x z qd + w x z qd_r."""
    if sliding is None:
        return a
    qd, qd_r = sliding.qd, sliding.reference
    (wx, wy, _), (rx, ry, _) = rates.w, rates.reference
    return (a[0] + (ry * qd + wy * qd_r), a[1] - (rx * qd + wx * qd_r), a[2] + sliding.qdd_r)
