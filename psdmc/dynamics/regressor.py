"""The joint-torque regressor: the matrix that gives the joint torques when it is multiplied by the standard parameters.

The force and moment that a body needs are linear in the body's standard parameters. An entry of the regressor belongs
to one joint rate and one parameter. The entry is the torque for a robot in which this parameter is one and all other
parameters are zero.

The joint torques at all states depend on combinations of the standard parameters. `torque_rows` computes them joint by
joint in extended precision, as matrix rows that span the torques. Consider a combination of link k's parameters whose
Lagrangian does not depend on q_k and on its rate. It has no effect on joint k's torque. If these parameters are moved to
the parent link, as if link k were fixed to the parent, no torque changes.

Let C_k be the rows that joint k's torque has in the parameters of link k. Let T_c move the parameters of a link c to
the parent link, at the position where joint c has not moved. All torques depend on the parameters only through

    C_k z_k,    z_k = x_k + sum of T_c z_c over the child links c of link k

Each C_k has 11 columns and few samples, for robots of any size. Every decision about rank is made on these rows, joint
by joint, relative to that joint's own torque."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.choices import PLAIN
from psdmc.dynamics.coordinates import first_rates, normalized, on_coordinates, rates, sparse_rows_summed
from psdmc.dynamics.frames import BASE, Frame, from_previous, outward
from psdmc.dynamics.motion import JointState, LinkMotion, Rates, spin_of, sweep_outward
from psdmc.dynamics.parameters import moving_map
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, dot, transform, transpose
from psdmc.dynamics.spatial import efforts
from psdmc.reproducible import cosine, lengths, sine, times
from psdmc.robot.graded import graded_pivots, halving_shares
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK

Twist = tuple[Vector, Vector]
"""Linear velocity of a frame's origin and angular velocity, along the frame's axes."""


Long = NDArray[Any]
"""An array of np.longdouble."""

SEED = 20_210_157
STATES = 48
"""Sampled motions, the same for all joints; each joint's torque has at most 11 columns to distinguish."""

EFFECT = 1e-15
"""Smallest effect of a parameter on a joint's torque, beyond that of other parameters, that counts; lengths in the
robot's unit, and relative to the largest effect that a parameter of the link has there. Rounding leaves 1e-18;
evaluating the torque in double leaves as much as this."""


class Placed(Protocol):
    """The placement of one frame in another: a Placement, or an object with a rotation and a translation in another
    floating-point precision."""

    @property
    def rotation(self) -> NDArray[Any]: ...

    @property
    def translation(self) -> NDArray[Any]: ...


@on_coordinates(sparse_rows_summed)
def regressor(
    frames: Sequence[Frame],
    link_frames: Sequence[Placed],
    wanted: Collection[int],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd_r: Sequence[Scalar],
    base_acceleration: Vector,
    qd_r: Sequence[Scalar] | None = None,
) -> tuple[dict[int, Scalar], ...]:
    """Compute the entries Y[i][p] of the regressor: torque[i] = sum over parameters p of Y[i][p] x[p].

    Returns one mapping per joint rate i, from the index p to the entry. Entries that are zero at every state are left
    out.

    link_frames  n placements of the link frames, about which the parameters are given, in the joint frames
    wanted       indices p of the columns that are computed; x has 11 parameters per link, link by link
    qd_r         reference rates, for the Slotine-Li regressor of M qdd_r + C qd_r + g; None: qd
    """
    first, changes = first_rates(frames), rates(frames, qdd_r)
    forward = sweep_outward(frames, q, qd, qd_r, qdd_r, base_acceleration, PLAIN)
    rows: tuple[dict[int, Scalar], ...] = tuple({} for _ in range(first[-1]))
    twists: list[dict[int, Twist]] = []
    for k, frame in enumerate(frames):
        before = {} if frame.parent == BASE else twists[frame.parent]
        own = {i: carried(frame, forward.states[k], twist) for i, twist in before.items()}
        twists.append(own | dict(enumerate(frame.joint.twists, start=first[k])))
        motion = seen_from(link_frames[k], forward.motions[k], forward.rates[k])
        seen = {i: twist_in(link_frames[k], twist) for i, twist in twists[k].items()}
        for name in range(DRIVE):
            column = PARAMETERS_PER_LINK * k + name
            if column in wanted:
                force, moment = unit_wrench(name, motion)
                for i, (linear, angular) in seen.items():
                    rows[i][column] = dot(linear, force) + dot(angular, moment)
        drive = PARAMETERS_PER_LINK * k + DRIVE
        if drive in wanted and frame.joint.about_z:  # joints of several rates have no drive
            rows[first[k]][drive] = changes[k]
    return rows


def carried(frame: Frame, state: JointState, twist: Twist) -> Twist:
    """Convert a twist (linear and angular velocity) from the parent's frame to this joint's frame: the twist of the new
    origin, along the new axes."""
    linear, angular = twist
    moved = add(linear, cross(angular, state.offset))
    return (
        outward(state.turn, from_previous(frame, moved)),
        outward(state.turn, from_previous(frame, angular)),
    )


def twist_in(place: Placed, twist: Twist) -> Twist:
    """Convert a twist (linear and angular velocity) from a joint frame to a frame that is fixed to the joint frame.
    `place` is the placement of the new frame in the joint frame."""
    rotation, translation = _plain(place)
    linear, angular = twist
    moved = add(linear, cross(angular, translation))
    rows = transpose(rotation)
    return transform(rows, moved), transform(rows, angular)


def seen_from(place: Placed, motion: LinkMotion, rates: Rates) -> LinkMotion:
    """Return the motion of a frame that is fixed to a joint frame, from the motion of the joint frame."""
    rotation, translation = _plain(place)
    rows = transpose(rotation)
    acceleration = add(motion.acceleration, transform(motion.spin.field, translation))
    w = transform(rows, rates.w)
    w_r = None if rates.w_r is None else transform(rows, rates.w_r)
    seen = Rates(w, transform(rows, rates.dw_r), w_r)
    return LinkMotion(transform(rows, acceleration), spin_of(seen))


def _plain(place: Placed) -> tuple[Matrix, Vector]:
    rows = tuple(tuple(row) for row in place.rotation.tolist())
    return rows, tuple(place.translation.tolist())  # type: ignore[return-value]


def unit_wrench(name: int, motion: LinkMotion) -> tuple[Vector, Vector]:
    """Return the force and moment that move a body of which one standard parameter is one and all others are zero.

    name  number of this parameter, 0 to 9, in the order of PARAMETER_NAMES
    """
    (ax, ay, az), (u, d) = motion
    if name == 0:
        return (ax, ay, az), ZERO
    if name <= 3:
        k = name - 1
        force = (u[0][k], u[1][k], u[2][k])
        return force, ((0.0, -az, ay), (az, 0.0, -ax), (-ay, ax, 0.0))[k]
    half = 0.5
    turn_x, turn_y, turn_z = (
        half * (u[2][1] - u[1][2]),
        half * (u[0][2] - u[2][0]),
        half * (u[1][0] - u[0][1]),
    )
    bend_x, bend_y, bend_z = (
        half * (u[2][1] + u[1][2]),
        half * (u[0][2] + u[2][0]),
        half * (u[1][0] + u[0][1]),
    )
    moment = (
        (turn_x, bend_y, -bend_z),
        (-u[2][0], u[2][1], -d[2]),
        (-bend_x, turn_y, bend_z),
        (u[1][0], -d[1], -u[1][2]),
        (-d[0], -u[0][1], u[0][2]),
        (bend_x, -bend_y, turn_z),
    )[name - 4]
    return ZERO, moment


def torque_rows(frames: Sequence[Frame], link_frames: Sequence[Placed], up: Vector) -> Long:
    """Return the (r, 11 n) rows in the standard parameters that span all joint torques, joint by joint. Each joint's
    rows have length one at most.

    r is the number of base parameters of a robot whose standard parameters are not restricted by assumptions.

    link_frames  placements of the link frames, about which the parameters are given, in the joint frames
    up           the base's acceleration against gravity
    """
    n = len(frames)
    own = [echelon_rows(samples) for samples in _own_torques(frames, up)]
    rows = np.zeros((sum(len(part) for part in own), PARAMETERS_PER_LINK * n), np.longdouble)
    carried: list[Long] = []
    places: list[NDArray[np.int64]] = []
    used = 0
    for k, (frame, place, part) in enumerate(zip(frames, link_frames, own, strict=True)):
        fixed = moving_map(_axes_at_rest(frame), np.array(frame.translation, dtype=np.longdouble))
        is_first = frame.parent == BASE
        above = np.zeros((0, BODY_PARAMETERS), np.longdouble) if is_first else carried[frame.parent]
        before, own_rows = len(above), np.arange(used, used + len(part))
        used, first = used + len(part), PARAMETERS_PER_LINK * k
        carried.append(np.vstack([times(above, fixed), part[:, :BODY_PARAMETERS]]))
        places.append(own_rows if is_first else np.concatenate([places[frame.parent], own_rows]))
        about_link = moving_map(place.rotation, place.translation)
        rows[places[k], first : first + BODY_PARAMETERS] = times(carried[k], about_link)
        rows[places[k][before:], first + DRIVE] = part[:, DRIVE]
    return rows


def _axes_at_rest(frame: Frame) -> Long:
    """(3, 3): a frame's axes in its parent's where its joint has not moved. Only what slides shows its turn there: about a
    joint that turns, all directions are alike to what its torque does not depend on."""
    s, c = sine(np.longdouble(frame.offset)), cosine(np.longdouble(frame.offset))
    for _ in range(frame.quarters):
        s, c = c, -s
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], np.longdouble)
    return np.asarray(times(np.array(frame.rotation, np.longdouble), turn))


def _own_torques(frames: Sequence[Frame], up: Vector) -> list[Long]:
    """n of (STATES nv, 11): each joint's torques from its own link's parameters about its own frame, at random motions."""
    nq, nv = (sum(counts) for counts in zip(*((f.joint.nq, f.joint.nv) for f in frames), strict=True))
    drawn = np.random.default_rng(SEED).uniform(-np.pi, np.pi, size=(nq + 2 * nv, STATES))
    drawn = drawn.astype(np.longdouble)
    q, qd, qdd = normalized(frames, drawn[:nq]), drawn[nq : nq + nv], drawn[nq + nv :]
    motions = sweep_outward(frames, list(q), list(qd), None, list(qdd), up, PLAIN).motions
    return [
        _own_torque(frame, motion, acceleration)
        for frame, motion, acceleration in zip(frames, motions, rates(frames, list(qdd)), strict=True)
    ]


def _own_torque(frame: Frame, motion: LinkMotion, acceleration: Scalar) -> Long:
    columns: list[Sequence[Any]] = [efforts(frame.joint, *unit_wrench(name, motion)) for name in range(DRIVE)]
    columns.append((acceleration,) if frame.joint.about_z else (0.0,) * frame.joint.nv)
    rows = [
        np.stack([np.broadcast_to(x, (STATES,)) for x in along], axis=1)
        for along in zip(*columns, strict=True)
    ]
    return np.concatenate(rows).astype(np.longdouble)


def echelon_rows(samples: Long) -> Long:
    """Return (rank, k) rows that span the same space as the sampled rows (m, k). They are scaled so that the longest
    column has length one. Directions shorter than EFFECT are left out."""
    longest = lengths(samples).max(initial=0.0)
    if not longest:
        return samples[:0]
    work = samples / longest
    work[:, lengths(work) <= EFFECT] = 0.0
    pivots, _, _ = graded_pivots(work, np.ones(work.shape[1]), halving_shares(EFFECT))
    return np.asarray(work[: len(pivots)])
