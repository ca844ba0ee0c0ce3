"""Kinetic and potential energy."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body
from psdmc.dynamics.following import on_coordinates
from psdmc.dynamics.frames import BASE, Frame, inward, joint_offset, joint_turn, to_previous
from psdmc.dynamics.momentum import momentum_of, twists
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, dot
from psdmc.dynamics.slices import neutral, positions, rates


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
