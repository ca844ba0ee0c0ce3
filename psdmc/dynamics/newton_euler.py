"""The recursive Newton-Euler algorithm: motions of bodies from base to tip (motion.py), then forces and moments from
tip to base. Each joint's torque is the component of force and moment along the joint's axis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.coordinates import flat, on_coordinates, positions, rates, summed
from psdmc.dynamics.frames import BASE, Frame, Rotation, Turn, handed_vector, inward, joint_angle, to_previous
from psdmc.dynamics.motion import Forward, LinkMotion, sweep_outward
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, transform
from psdmc.dynamics.spatial import Body, efforts, turned

Wrench = tuple[Vector, Vector]
"""Force (N) and moment about a frame's origin (N m), along its axes."""

NO_WRENCHES: Mapping[int, Wrench] = MappingProxyType({})


def wrench(motion: LinkMotion, body: Body) -> Wrench:
    """Compute the force (N) and the moment (N m) that a body needs for its motion, about the origin of the body's
    frame.

    Points of the body at r accelerate with a + U r, with the matrix U of the angular rates. The force is m a + U h,
    with the mass m and the first moment h. The moment is h x a + integral of r x (U r), whose second part is linear in
    the second moments.
    """
    a, (u, d) = motion
    force = add(transform(u, body.moment), (body.mass * a[0], body.mass * a[1], body.mass * a[2]))
    xx, yy, zz, xy, xz, yz = body.second
    turning = (
        u[2][0] * xy + u[2][1] * yy - u[1][2] * zz - u[1][0] * xz + d[0] * yz,
        u[0][2] * zz + u[0][1] * yz - u[2][0] * xx - u[2][1] * xy + d[1] * xz,
        u[1][0] * xx - u[0][1] * yy + d[2] * xy + u[1][2] * xz - u[0][2] * yz,
    )
    return force, add(cross(body.moment, a), turning)


@on_coordinates(summed)
def inverse_dynamics(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base_acceleration: Vector,
    choices: Choices = PLAIN,
    qd_r: Sequence[Scalar] | None = None,
    external: Mapping[int, Wrench] = NO_WRENCHES,
) -> tuple[Scalar, ...]:
    """Compute joint torques (N m; N for sliding joints), one per joint rate: M(q) qdd + C(q, qd) qd_r + g(q).

    qd_r      reference joint rates; None: qd, which gives ordinary inverse dynamics
    external  force and moment that the world exerts on link i, about the origin of joint frame i, along that frame's
              axes

    Source: Luh, Walker, Paul 1980. The body's wrench is computed from its pseudo-inertia.
    """
    forward = sweep_outward(frames, q, qd, qd_r, qdd, base_acceleration, choices)
    seen = seen_bodies(frames, bodies, q, forward, choices)
    return sweep_inward(frames, seen, drive_inertia, qdd, forward, choices, external)


def seen_bodies(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], forward: Forward, choices: Choices
) -> list[Body]:
    """Return each body's mass parameters about the frame in which the sweep gives the body's motion.

    For a folded body, that is the frame before the joint's rotation. For all other bodies, it is the joint frame.
    """
    return [
        _folded_body(frame, body, value, state.turn, choices) if is_folded else body
        for frame, body, value, state, is_folded in zip(
            frames, bodies, positions(frames, q), forward.states, forward.folded, strict=True
        )
    ]


def _folded_body(frame: Frame, body: Body, q: Scalar, turn: Turn | Rotation | None, choices: Choices) -> Body:
    angle = joint_angle(frame, q)
    return turned(body, turn, (angle + angle).turn() if choices.fold_double_angle else None)


def _relieved(force: Vector, moment: Vector, external: Wrench, turn: Turn | Rotation | None) -> Wrench:
    """A body's wrench less the external one; `turn` where the body's frame is that before its joint's turn."""
    (fx, fy, fz), (mx, my, mz) = (inward(turn, part) for part in external)
    return (
        (force[0] - fx, force[1] - fy, force[2] - fz),
        (moment[0] - mx, moment[1] - my, moment[2] - mz),
    )


def sweep_inward(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    qdd: Sequence[Scalar],
    forward: Forward,
    choices: Choices = PLAIN,
    external: Mapping[int, Wrench] = NO_WRENCHES,
    yielded: Callable[[int, Sequence[Scalar]], Wrench] | None = None,
) -> tuple[Scalar, ...]:
    """Compute the joint torques from the motions of the bodies, from tip to base.

    The force and moment of each body, and those of the bodies further out, are added and passed to the parent. The
    component along a joint's axis is the joint's torque. If the angles of parallel joints are summed (an option in
    choices.py), their x and y moments are summed before the first rotation. Their z moments and forces are summed joint
    by joint.

    yielded  function of a joint's number i and torques; returns a further force and moment that joint i passes to its
             parent, about the origin of body i's frame, along the frame's axes
    """
    n = len(frames)
    torques: list[tuple[Scalar, ...]] = [()] * n
    changes = rates(frames, qdd)
    forces, moments, gathered = [ZERO] * n, [ZERO] * n, [ZERO] * n
    for i in reversed(range(n)):
        frame, state, parent = frames[i], forward.states[i], frames[i].parent
        # The wrench f that the body's motion requires, with those of the bodies beyond it.
        own_force, own_moment = wrench(forward.motions[i], bodies[i])
        if i in external:
            turn = state.turn if forward.folded[i] else None
            own_force, own_moment = _relieved(own_force, own_moment, external[i], turn)
        force, moment = add(forces[i], own_force), add(moments[i], own_moment)
        # Each rate takes the component along its axis s: tau = s^T f.
        own = efforts(frame.joint, force, moment)
        if frame.joint.about_z:  # joints of several rates have no drive
            own = (own[0] + drive_inertia[i] * changes[i],)
        torques[i] = own
        if yielded is not None:
            further_force, further_moment = yielded(i, torques[i])
            force, moment = add(force, further_force), add(moment, further_moment)
        if parent == BASE:
            continue
        # All of f goes on to the parent, turned back and about the parent's origin.
        own_turn = None if forward.folded[i] else state.turn
        force = to_previous(frame, inward(own_turn, force))
        if forward.joins[i]:
            group_turn = forward.compound_turns[parent if forward.folded[i] else i]
            x, y, _ = inward(group_turn, moment)
            across = (gathered[i][0] + x, gathered[i][1] + y, 0.0)
            gathered[parent] = add(gathered[parent], handed_vector(frame, across))
            carried: Vector = (0.0, 0.0, moment[2])
        else:
            turn = None if forward.folded[i] else forward.compound_turns[i]
            carried = to_previous(frame, add(inward(turn, moment), gathered[i]))
        carried = handed_vector(frame, add(carried, cross(state.offset, force)))
        force = handed_vector(frame, force)
        forces[parent], moments[parent] = add(forces[parent], force), add(moments[parent], carried)
    return tuple(flat(torques))
