"""Linear and angular momentum of single bodies and of the whole robot."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body, in_previous, joined, shifted, turned
from psdmc.dynamics.following import columns_summed, on_coordinates
from psdmc.dynamics.frames import BASE, Frame, inward, joint_offset, joint_turn, to_previous
from psdmc.dynamics.kinematics import forward_kinematics
from psdmc.dynamics.motion import JointState
from psdmc.dynamics.regressor import Twist, carried
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, scale, transform
from psdmc.dynamics.slices import positions, rates
from psdmc.dynamics.twist import combined, own_rates
from psdmc.dynamics.twist import momentum as unit_momentum


def twists(frames: Sequence[Frame], q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[Twist]:
    """Return, for every joint frame, the velocity of its origin and its angular velocity, along the frame's axes."""
    found: list[Twist] = []
    for frame, state, rate in zip(frames, _states(frames, q), rates(frames, qd), strict=True):
        before = (ZERO, ZERO) if frame.parent == BASE else found[frame.parent]
        linear, angular = carried(frame, state, before)
        own_linear, own_angular = combined(frame.joint, own_rates(frame.joint, rate))
        found.append((add(linear, own_linear), add(angular, own_angular)))
    return found


def momentum_of(body: Body, twist: Twist) -> tuple[Vector, Vector]:
    """Compute a body's momentum m v + w x h, and its angular momentum h x v + I w about the frame's origin."""
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
    """Compute the momentum (kg m/s) and angular momentum (kg m^2/s) of all bodies, in the base frame of the joint
    frames. The bodies must be the real ones: others with the same torques have another momentum."""
    moving = [momentum_of(body, twist) for body, twist in zip(bodies, twists(frames, q, qd), strict=True)]
    states, total = _states(frames, q), (ZERO, ZERO)
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
    """Compute the 6 x nv matrix whose columns are `total_momentum` at unit rate of each joint, by composite bodies. The
    bodies must be the real ones."""
    found: list[list[tuple[Vector, Vector]]] = [[] for _ in frames]
    placed, states, composites = forward_kinematics(frames, q), _states(frames, q), list(bodies)
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


def _states(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[JointState]:
    return [
        JointState(joint_turn(frame, value), joint_offset(frame, value))
        for frame, value in zip(frames, positions(frames, q), strict=True)
    ]
