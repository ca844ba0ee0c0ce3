"""Momentum and energy of single bodies and of the whole robot, its centre of mass, and derivatives.

The momentum is linear and angular, about the base or about the centre of mass, or the generalized momentum p = M(q) qd.
The parts of the generalized momentum that a load adds are linear in the load's ten parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.coordinates import (
    as_tuple,
    columns_summed,
    each_summed,
    first_rates,
    matrices_summed,
    neutral,
    on_coordinates,
    positions,
    rates,
)
from psdmc.dynamics.derivatives import composites, swept, wrenches_of_motions
from psdmc.dynamics.frames import (
    BASE,
    Frame,
    from_previous,
    inward,
    joint_offset,
    joint_turn,
    outward,
    to_previous,
)
from psdmc.dynamics.kinematics import AT_BASE, forward_kinematics
from psdmc.dynamics.motion import JointState, LinkMotion, Rates, spin_of, sweep_outward
from psdmc.dynamics.newton_euler import wrench
from psdmc.dynamics.regressor import Placed, Twist, carried, twist_in, unit_wrench
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, dot, scale, transform
from psdmc.dynamics.spatial import (
    Body,
    combined,
    efforts,
    in_previous,
    joined,
    momentum,
    momentum_of,
    shifted,
    turned,
)
from psdmc.dynamics.spatial import momentum as unit_momentum

Wrench = tuple[Vector, Vector]

Rows = Sequence[Sequence[Scalar]]


def twists(frames: Sequence[Frame], q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[Twist]:
    """Return, for every joint frame, the velocity of its origin and its angular velocity, along the frame's axes."""
    found: list[Twist] = []
    for frame, state, rate in zip(frames, joint_states(frames, q), rates(frames, qd), strict=True):
        before = (ZERO, ZERO) if frame.parent == BASE else found[frame.parent]
        linear, angular = carried(frame, state, before)
        own_linear, own_angular = combined(frame.joint, as_tuple(rate))
        found.append((add(linear, own_linear), add(angular, own_angular)))
    return found


@on_coordinates()
def total_momentum(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], qd: Sequence[Scalar]
) -> tuple[Vector, Vector]:
    """Compute the momentum (kg m/s) and angular momentum (kg m^2/s) of all bodies, about the origin of the base frame.

    The bodies must be the robot's real ones: bodies made from base parameters have the same torques, but another
    momentum.
    """
    moving = [momentum_of(body, twist) for body, twist in zip(bodies, twists(frames, q, qd), strict=True)]
    return _at_base(frames, joint_states(frames, q), moving)


@on_coordinates()
def total_momentum_rate(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
) -> tuple[Vector, Vector]:
    """Compute the derivative of `total_momentum` by time: the sums of all external forces (N) and of their moments (N m)."""
    forward = sweep_outward(frames, q, qd, None, qdd, ZERO)
    moving = [wrench(motion, body) for motion, body in zip(forward.motions, bodies, strict=True)]
    return _at_base(frames, forward.states, moving)


def _at_base(frames: Sequence[Frame], states: Sequence[JointState], moving: list[Wrench]) -> Wrench:
    """Sum forces, and moments about each joint frame's origin, along and about the frame that the first joint frame turns
    from. Momenta are summed likewise."""
    total = (ZERO, ZERO)
    for i in reversed(range(len(frames))):
        parent, handed = frames[i].parent, _at_parent(frames[i], states[i], moving[i])
        if parent == BASE:
            total = _joined(total, handed)
        else:
            moving[parent] = _joined(moving[parent], handed)
    return total


def _at_parent(frame: Frame, state: JointState, given: Wrench) -> Wrench:
    force = to_previous(frame, inward(state.turn, given[0]))
    moment = to_previous(frame, inward(state.turn, given[1]))
    return force, add(moment, cross(state.offset, force))


def _joined(a: Wrench, b: Wrench) -> Wrench:
    return add(a[0], b[0]), add(a[1], b[1])


@on_coordinates(columns_summed)
def momentum_matrix(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar]
) -> list[list[Scalar]]:
    """Compute the 6 x nv matrix whose products with joint rates are the momentum and angular momentum of all bodies.

    The method is that of composite bodies, which join each body with all bodies that it carries. The bodies must be the
    robot's real ones, not bodies made from base parameters.
    """
    found: list[list[tuple[Vector, Vector]]] = [[] for _ in frames]
    placed, states, composites = forward_kinematics(frames, q), joint_states(frames, q), list(bodies)
    for i in reversed(range(len(frames))):
        frame, (rotation, origin) = frames[i], placed[i]
        for twist in frame.joint.twists:
            force, moment = (transform(rotation, v) for v in unit_momentum(composites[i], twist))
            found[i].append((force, add(moment, cross(origin, force))))
        if frame.parent != BASE:
            before = in_previous(frame, turned(composites[i], states[i].turn))
            composites[frame.parent] = joined(composites[frame.parent], shifted(before, states[i].offset))
    columns = [(*linear, *angular) for own in found for linear, angular in own]
    return [list(row) for row in zip(*columns, strict=True)]


def joint_states(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[JointState]:
    """Return every joint's rotation and the origin of its frame, at q."""
    return [
        JointState(joint_turn(frame, value), joint_offset(frame, value))
        for frame, value in zip(frames, positions(frames, q), strict=True)
    ]


@on_coordinates()
def kinetic_energy(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
) -> Scalar:
    """Return the kinetic energy qd^T M(q) qd / 2 of all bodies, J, with drive inertias.

    The bodies may be other ones with the same joint torques as the robot's, such as bodies made from base parameters.
    """
    twice: Scalar = 0.0
    for twist, body in zip(twists(frames, q, qd), bodies, strict=True):
        linear, angular = momentum_of(body, twist)
        twice = twice + (dot(twist[0], linear) + dot(twist[1], angular))
    for frame, drive, rate in zip(frames, drive_inertia, rates(frames, qd), strict=True):
        if frame.joint.about_z:
            twice = twice + drive * rate * rate
    return 0.5 * twice


@on_coordinates()
def potential_energy(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], base_acceleration: Vector
) -> Scalar:
    """Return the potential energy of all bodies, J, relative to that at q = 0.

    The bodies may be other ones with the same joint torques as the robot's, because torques do not depend on a constant
    energy.

    base_acceleration  m/s^2 in the base frame, minus gravity
    """
    here = dot(base_acceleration, first_moment(frames, bodies, q))
    return here - dot(base_acceleration, first_moment(frames, bodies, neutral(frames)))


@on_coordinates()
def first_moment(frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar]) -> Vector:
    """Return the total mass times the centre of mass, kg m. The centre is given in the base frame of these joint
    frames."""
    own = positions(frames, q)
    masses, moments = [body.mass for body in bodies], [body.moment for body in bodies]
    total = ZERO
    for i in reversed(range(len(frames))):
        frame, mass = frames[i], masses[i]
        turned = to_previous(frame, inward(joint_turn(frame, own[i]), moments[i]))
        x, y, z = joint_offset(frame, own[i])
        moment = add(turned, (mass * x, mass * y, mass * z))
        if frame.parent == BASE:
            total = add(total, moment)
        else:
            masses[frame.parent] = masses[frame.parent] + mass
            moments[frame.parent] = add(moments[frame.parent], moment)
    return total


class RateSlopes(NamedTuple):
    """Derivatives of the momentum's rate, 6 x nv each: by q, along its tangent, by qd and by qdd."""

    by_q: Rows
    by_qd: Rows
    by_qdd: Rows


def about_centre(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], moved: Wrench
) -> Wrench:
    """Convert a momentum, or its rate, from the origin of the first joint frame to the bodies' centre of mass. The bodies
    must be the real ones."""
    linear, angular = moved
    centre = scale(first_moment(frames, bodies, q), 1.0 / _mass(bodies))
    return linear, add(angular, cross(linear, centre))


def _mass(bodies: Sequence[Body]) -> Scalar:
    return sum(body.mass for body in bodies)


@on_coordinates(each_summed(columns_summed))
def momentum_rate_slopes(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
) -> RateSlopes:
    """Compute the derivatives of the rates of the bodies' linear momentum, and of their angular momentum about the centre
    of mass. Components are along the axes that the first joint frame turns from. The bodies must be the real ones.

    The rate is A qdd + dA/dt qd with the centroidal momentum matrix A. At qd = 0, with rates in the place of qdd, the rate
    is therefore the momentum at these rates, and the derivatives are those of the momentum.

    A joint's motion requires a wrench on the bodies beyond the joint (derivatives.py); the momentum of other bodies does
    not change. By q the centre of mass c moves too, so that c x force changes."""
    moving = swept(frames, q, qd, qdd, ZERO)
    carried = composites(moving, bodies)
    share, placed = 1.0 / _mass(bodies), forward_kinematics(frames, q)
    force = centre = ZERO
    for i, composite in carried:
        if frames[i].parent == BASE:
            body, step = composite.body, moving.steps[i]
            force = add(force, step.to_link(composite.wrench[0]))
            moved = add(step.to_link(body.moment), scale(step.offset, body.mass))
            centre = add(centre, scale(moved, share))
    first = first_rates(frames)
    blocks: list[list[tuple[Scalar, ...]]] = [[()] * first[-1] for _ in range(3)]
    for i, composite in carried:
        frame, step = frames[i], moving.steps[i]
        axes_of, origin = AT_BASE if frame.parent == BASE else placed[frame.parent]
        before = axes_of, add(origin, scale(centre, -1.0))
        required = wrenches_of_motions(frame, moving.axes[i], composite, moving.qd[i])
        for k, (by_q, by_qd), twist in zip(
            range(first[i], first[-1]), required, frame.joint.twists, strict=False
        ):
            wrenches = (by_q, by_qd, momentum(composite.body, twist))
            by_q, by_qd, by_qdd = (_placed(step.to_parent(each), before) for each in wrenches)
            shifted = by_q[0], add(by_q[1], cross(force, scale(by_qdd[0], share)))
            for block, (linear, angular) in zip(blocks, (shifted, by_qd, by_qdd), strict=True):
                block[k] = (*linear, *angular)
    return RateSlopes(*(tuple(zip(*block, strict=True)) for block in blocks))


def _placed(wrench: Wrench, frame: tuple[Matrix, Vector]) -> Wrench:
    """Convert a wrench from a frame to the axes and the origin in which the frame is given."""
    rotation, origin = frame
    force = transform(rotation, wrench[0])
    return force, add(transform(rotation, wrench[1]), cross(origin, force))


@on_coordinates(columns_summed)
def generalized_momentum(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    base_acceleration: Vector,
) -> tuple[list[Scalar], list[Scalar]]:
    """Compute the generalized momentum p = M(q) qd, and its rate without joint torques, C(q, qd)^T qd - g(q).

    With the joint torques tau, dp/dt = tau + C^T qd - g. The formula contains no acceleration. C is the Coriolis matrix
    of the Christoffel symbols, g the torques of gravity.

    Joint i's entries are s . h and (v x s) . h + s . w. s is the joint's twist per unit rate and v the twist of frame i.
    h is the momentum of the bodies that joint i carries and w gravity's wrench on them, both about the origin of frame i.

    Source: De Luca, Mattone 2003 (momentum observer), with spatial vectors as in Featherstone 2008.
    """
    states = joint_states(frames, q)
    moving, ups = twists(frames, q, qd), _upward(frames, states, base_acceleration)
    momenta = [momentum_of(body, twist) for body, twist in zip(bodies, moving, strict=True)]
    supports = [(scale(up, body.mass), cross(body.moment, up)) for body, up in zip(bodies, ups, strict=True)]
    found: list[tuple[list[Scalar], list[Scalar]]] = [([], []) for _ in frames]
    for i in reversed(range(len(frames))):
        frame, (linear, angular) = frames[i], moving[i]
        force, moment = momenta[i]
        # (v x s) . h = -s . (v x* h), the force of the frame's own motion.
        turning = cross(angular, force), add(cross(angular, moment), cross(linear, force))
        own = efforts(frame.joint, force, moment)
        rate = tuple(-value for value in efforts(frame.joint, *_joined(turning, supports[i])))
        if frame.joint.about_z:  # joints of several rates have no drive
            own = (own[0] + drive_inertia[i] * rates(frames, qd)[i],)
        found[i] = list(own), list(rate)
        if frame.parent != BASE:
            for sums in (momenta, supports):
                sums[frame.parent] = _joined(sums[frame.parent], _at_parent(frame, states[i], sums[i]))
    return [x for own, _ in found for x in own], [x for _, rate in found for x in rate]


@on_coordinates(matrices_summed)
def load_momentum(
    frames: Sequence[Frame],
    place: Placed,
    carrier: int,
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    base_acceleration: Vector,
    count: int,
) -> tuple[list[list[Scalar]], list[list[Scalar]]]:
    """Compute the derivatives of the two results of `generalized_momentum` by the parameters of a load. Returns two
    matrices, with a row for each of the load's first `count` parameters and a column for each joint rate.

    place    placement of the load's frame in the joint frame `carrier`
    count    4: mass and first moments about the load's frame; 10: also the six inertias
    """
    states, path = joint_states(frames, q), [carrier]
    while frames[path[-1]].parent != BASE:
        path.append(frames[path[-1]].parent)
    first, seen, up = first_rates(frames), dict[int, Twist](), base_acceleration
    for k in reversed(path):
        before = {i: carried(frames[k], states[k], twist) for i, twist in seen.items()}
        seen = before | dict(enumerate(frames[k].joint.twists, start=first[k]))
        up = outward(states[k].turn, from_previous(frames[k], up))
    seen = {i: twist_in(place, twist) for i, twist in seen.items()}
    _, gravity = twist_in(place, (ZERO, up))
    values, total, upto = rates(frames, qd), (ZERO, ZERO), dict[int, Twist]()
    for k in reversed(path):
        own = range(first[k], first[k] + frames[k].joint.nv)
        for i, rate in zip(own, as_tuple(values[k]), strict=True):
            total = add(total[0], scale(seen[i][0], rate)), add(total[1], scale(seen[i][1], rate))
        upto |= dict.fromkeys(own, total)
    moving = LinkMotion(total[0], spin_of(Rates(ZERO, total[1])))
    momentum, rate_of = ([[0.0] * first[-1] for _ in range(count)] for _ in range(2))
    for name in range(count):
        force, moment = unit_wrench(name, moving)
        weight = unit_wrench(name, LinkMotion(gravity, spin_of(Rates(ZERO, ZERO))))
        for i, (linear, angular) in seen.items():
            v, w = upto[i]
            change = add(cross(w, linear), cross(v, angular)), cross(w, angular)
            momentum[name][i] = dot(linear, force) + dot(angular, moment)
            own_weight = dot(linear, weight[0]) + dot(angular, weight[1])
            rate_of[name][i] = dot(change[0], force) + dot(change[1], moment) - own_weight
    return momentum, rate_of


def _upward(frames: Sequence[Frame], states: Sequence[JointState], base_acceleration: Vector) -> list[Vector]:
    """The base's acceleration against gravity, along the axes of every joint frame."""
    found: list[Vector] = []
    for frame, state in zip(frames, states, strict=True):
        before = base_acceleration if frame.parent == BASE else found[frame.parent]
        found.append(outward(state.turn, from_previous(frame, before)))
    return found
