"""Compute the generalized momentum p = M(q) qd of a robot, its rate without joint torques, and the parts of both that a load
adds. These parts are linear in the load's ten parameters."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body
from psdmc.dynamics.following import columns_summed, matrices_summed, on_coordinates
from psdmc.dynamics.frames import BASE, Frame, from_previous, inward, outward, to_previous
from psdmc.dynamics.momentum import joint_states, momentum_of, twists
from psdmc.dynamics.motion import JointState, LinkMotion
from psdmc.dynamics.regressor import Placed, Twist, carried, twist_in, unit_wrench
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, dot, scale
from psdmc.dynamics.slices import first_rates, rates
from psdmc.dynamics.spin import Rates, spin_of
from psdmc.dynamics.twist import efforts, own_rates


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
        for i, rate in zip(own, own_rates(frames[k].joint, values[k]), strict=True):
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


def _at_parent(frame: Frame, state: JointState, wrench: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    force = to_previous(frame, inward(state.turn, wrench[0]))
    moment = to_previous(frame, inward(state.turn, wrench[1]))
    return force, add(moment, cross(state.offset, force))


def _joined(a: tuple[Vector, Vector], b: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    return add(a[0], b[0]), add(a[1], b[1])
