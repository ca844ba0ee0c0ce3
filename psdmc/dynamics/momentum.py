"""Linear and angular momentum of single bodies and of the whole robot."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body, in_previous, joined, shifted, turned
from psdmc.dynamics.following import columns_summed, on_coordinates
from psdmc.dynamics.frames import BASE, Frame, inward, joint_offset, joint_turn, to_previous
from psdmc.dynamics.kinematics import forward_kinematics
from psdmc.dynamics.motion import JointState, sweep_outward
from psdmc.dynamics.newton_euler import wrench
from psdmc.dynamics.regressor import Twist, carried
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, scale, transform
from psdmc.dynamics.slices import positions, rates
from psdmc.dynamics.twist import combined, own_rates
from psdmc.dynamics.twist import momentum as unit_momentum


def twists(frames: Sequence[Frame], q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[Twist]:
    """Return, for every joint frame, the velocity of its origin and its angular velocity, along the frame's axes."""
    found: list[Twist] = []
    for frame, state, rate in zip(frames, joint_states(frames, q), rates(frames, qd), strict=True):
        before = (ZERO, ZERO) if frame.parent == BASE else found[frame.parent]
        linear, angular = carried(frame, state, before)
        own_linear, own_angular = combined(frame.joint, own_rates(frame.joint, rate))
        found.append((add(linear, own_linear), add(angular, own_angular)))
    return found


def momentum_of(body: Body, twist: Twist) -> tuple[Vector, Vector]:
    """Return a body's momentum m v + w x h, and its angular momentum h x v + I w about the origin of a frame.

    The frame has velocity v and angular velocity w. The body has mass m, first moments h and inertia I about its
    origin.
    """
    linear, (wx, wy, wz) = twist
    xx, yy, zz, xy, xz, yz = body.second
    own = (
        (yy + zz) * wx - xy * wy - xz * wz,
        (xx + zz) * wy - xy * wx - yz * wz,
        (xx + yy) * wz - xz * wx - yz * wy,
    )
    moved = add(scale(linear, body.mass), cross((wx, wy, wz), body.moment))
    return moved, add(cross(body.moment, linear), own)


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


def _at_base(
    frames: Sequence[Frame], states: Sequence[JointState], moving: list[tuple[Vector, Vector]]
) -> tuple[Vector, Vector]:
    """Sum forces, and moments about each joint frame's origin, along and about the frame that the first joint frame turns
    from. Momenta are summed likewise."""
    total = (ZERO, ZERO)
    for i in reversed(range(len(frames))):
        frame, (linear, angular) = frames[i], moving[i]
        linear = to_previous(frame, inward(states[i].turn, linear))
        angular = add(to_previous(frame, inward(states[i].turn, angular)), cross(states[i].offset, linear))
        if frame.parent == BASE:
            total = add(total[0], linear), add(total[1], angular)
        else:
            before = moving[frame.parent]
            moving[frame.parent] = add(before[0], linear), add(before[1], angular)
    return total


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
