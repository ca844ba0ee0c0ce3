"""Kinetic and potential energy."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body
from psdmc.dynamics.frames import BASE, Frame, inward, joint_angle, joint_offset, to_previous
from psdmc.dynamics.momentum import momentum_of, twists
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, dot


def kinetic_energy(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
) -> Scalar:
    """Kinetic energy qd^T M(q) qd / 2 in J, with drive inertias. Bodies that have the torques of the real ones are
    enough."""
    twice: Scalar = 0.0
    for twist, body in zip(twists(frames, q, qd), bodies, strict=True):
        linear, angular = momentum_of(body, twist)
        twice = twice + (dot(twist[0], linear) + dot(twist[1], angular))
    for drive, rate in zip(drive_inertia, qd, strict=True):
        twice = twice + drive * rate * rate
    return 0.5 * twice


def potential_energy(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], base_acceleration: Vector
) -> Scalar:
    """Potential energy in J, zero at q = 0. `base_acceleration` is minus gravity, m/s^2 in the base frame.

    Torques do not depend on the energy at q = 0: bodies that have the torques of the real ones give the same
    differences.
    """
    rest = [0.0] * len(frames)
    moved, resting = first_moment(frames, bodies, q), first_moment(frames, bodies, rest)
    return dot(base_acceleration, moved) - dot(base_acceleration, resting)


def first_moment(frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar]) -> Vector:
    """Total mass times its centre, kg m, along and about the frame that the first joint frame turns from."""
    masses, moments = [body.mass for body in bodies], [body.moment for body in bodies]
    total = ZERO
    for i in reversed(range(len(frames))):
        frame, mass = frames[i], masses[i]
        turned = to_previous(frame, inward(joint_angle(frame, q[i]).turn(), moments[i]))
        x, y, z = joint_offset(frame, q[i])
        moment = add(turned, (mass * x, mass * y, mass * z))
        if frame.parent == BASE:
            total = add(total, moment)
        else:
            masses[frame.parent] = masses[frame.parent] + mass
            moments[frame.parent] = add(moments[frame.parent], moment)
    return total
