"""The joint-torque regressor: the matrix that gives the joint torques when it is multiplied by the standard parameters.

The force and moment that a body needs are linear in the body's standard parameters. An entry of the regressor belongs
to one joint rate and one parameter. The entry is the torque for a robot in which this parameter is one and all other
parameters are zero.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Protocol

from numpy.typing import NDArray

from psdmc.dynamics.choices import PLAIN
from psdmc.dynamics.following import on_coordinates, sparse_rows_summed
from psdmc.dynamics.frames import BASE, Frame, from_previous, outward
from psdmc.dynamics.motion import JointState, LinkMotion, sweep_outward
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, dot, transform, transpose
from psdmc.dynamics.slices import first_rates, rates
from psdmc.dynamics.spin import Rates, spin_of
from psdmc.robot.mechanism import DRIVE, PARAMETERS_PER_LINK

Twist = tuple[Vector, Vector]
"""Linear velocity of a frame's origin and angular velocity, along the frame's axes."""


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
