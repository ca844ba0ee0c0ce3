"""Kinetic and potential energy."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.kinematics import forward_kinematics
from psdmc.dynamics.scalar import Scalar, Vector, add, dot, transform


def potential_energy(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], base: Vector
) -> Scalar:
    """J, zero where every body's centre is at the base's origin; `base` is minus gravity, m/s^2 in the base frame."""
    total: Scalar = 0.0
    for body, (rotation, origin) in zip(bodies, forward_kinematics(frames, q), strict=True):
        m = body.mass
        moment = add(transform(rotation, body.moment), (m * origin[0], m * origin[1], m * origin[2]))
        total = total + dot(base, moment)
    return total


def kinetic_energy(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
) -> Scalar:
    """J, drive inertias included."""
    total: Scalar = 0.0
    for rate, row in zip(qd, mass_matrix(frames, bodies, drive_inertia, q), strict=True):
        for other, entry in zip(qd, row, strict=True):
            total = total + 0.5 * rate * entry * other
    return total
