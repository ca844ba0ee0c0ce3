"""Recursive Newton-Euler: outward for motions (motion.py), inward for wrenches, each axis taking its component."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body, turned
from psdmc.dynamics.frames import Frame, Turn, inward, joint_angle, to_previous
from psdmc.dynamics.motion import PLAIN, Choices, Forward, LinkMotion, sweep_outward
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, transform


def wrench(motion: LinkMotion, body: Body) -> tuple[Vector, Vector]:
    """Force (N) and moment about the frame's origin (N m) that give a body the field a + U r.

    force = m a + U h,  moment = h x a + integral of r x (U r), the latter linear in the second moments.
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


def inverse_dynamics(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base: Vector,
    choices: Choices = PLAIN,
    qd_r: Sequence[Scalar] | None = None,
) -> tuple[Scalar, ...]:
    """Joint torques (N m; N for sliding joints), n of them: M(q) qdd + C(q, qd) qd_r + g(q), qd_r = qd if not given.

    Luh, Walker, Paul 1980, with the body's wrench written on its pseudo-inertia.
    """
    forward = sweep_outward(frames, q, qd, qd if qd_r is None else qd_r, qdd, base, choices)
    bodies = list(bodies)
    if forward.folded:
        bodies[-1] = _folded_body(frames[-1], bodies[-1], q[-1], forward.states[-1].turn, choices)
    return sweep_inward(frames, bodies, drive_inertia, qdd, forward, choices)


def _folded_body(frame: Frame, body: Body, q: Scalar, turn: Turn | None, choices: Choices) -> Body:
    angle = joint_angle(frame, q)
    return turned(body, turn, (angle + angle).turn() if choices.fold_double_angle else None)


def sweep_inward(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    qdd: Sequence[Scalar],
    forward: Forward,
    choices: Choices = PLAIN,
) -> tuple[Scalar, ...]:
    """Wrenches down to the base; each axis takes its component. With compound turns the moments' x and y of a group
    of parallel axes are gathered in the frame before its first turn, their z and the forces joint by joint."""
    n = len(frames)
    torques: list[Scalar] = [0.0] * n
    force, moment, gathered = ZERO, ZERO, ZERO
    for i in reversed(range(n)):
        frame, state = frames[i], forward.states[i]
        own_force, own_moment = wrench(forward.motions[i], bodies[i])
        force, moment = add(force, own_force), add(moment, own_moment)
        torque = moment[2] if frame.kind == "revolute" else force[2]
        torques[i] = torque + drive_inertia[i] * qdd[i]
        is_folded = forward.folded and i == n - 1
        own_turn = None if is_folded else state.turn
        turn = None if is_folded else forward.compound_turns[i]
        force = to_previous(frame, inward(own_turn, force))
        joins = choices.compound and i > 0 and frame.is_parallel
        if joins:
            turned = inward(forward.compound_turns[i - 1] if is_folded else turn, moment)
            gathered = (gathered[0] + turned[0], gathered[1] + turned[1], 0.0)
            moment = add((0.0, 0.0, moment[2]), cross(state.offset, force))
        else:
            moment = to_previous(frame, add(inward(turn, moment), gathered))
            gathered = ZERO
            moment = add(moment, cross(state.offset, force))
    return tuple(torques)
