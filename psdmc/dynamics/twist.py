"""Multiplication of constant twists, such as a joint's motion per unit rate, with forces, rates and bodies. Zeros and
ones of the twist cost no operation."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.body import Body
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add
from psdmc.robot.joints import JointType, Twist


def weighted(weights: Sequence[float], values: Sequence[Scalar]) -> Scalar:
    """The sum of constant weights times values."""
    total: Scalar | None = None
    for weight, value in zip(weights, values, strict=True):
        if weight == 0.0:
            continue
        part = value if weight == 1.0 else value * weight
        total = part if total is None else total + part
    return 0.0 if total is None else total


def axis_twist(joint: JointType) -> Twist:
    """Return the joint's linear and angular velocity per unit rate, for a joint with one rate. Raises ValueError if the
    joint has more rates."""
    (twist,) = joint.twists
    return twist


def efforts(joint: JointType, force: Vector, moment: Vector) -> tuple[Scalar, ...]:
    """Return, for each of the joint's rates, the component of a force and a moment along the rate's twist. The moment
    is about the joint frame's origin."""
    values = (*force, *moment)
    return tuple(weighted((*linear, *angular), values) for linear, angular in joint.twists)


def combined(joint: JointType, rates: Sequence[Scalar]) -> tuple[Vector, Vector]:
    """Return the joint's linear and angular velocity: the sum of the joint's twists per unit rate times the given
    rates."""
    parts = [
        weighted([(*linear, *angular)[part] for linear, angular in joint.twists], rates) for part in range(6)
    ]
    return (parts[0], parts[1], parts[2]), (parts[3], parts[4], parts[5])


def own_rates(joint: JointType, rates: Scalar) -> tuple[Scalar, ...]:
    """Return the rates of one joint as a tuple; a single rate becomes a tuple with one entry."""
    return rates if isinstance(rates, tuple) else (rates,)


def effort(joint: JointType, force: Vector, moment: Vector) -> Scalar:
    """Return the component of a force and a moment along the joint's axis: N m, or N for a sliding joint. The moment is
    about the joint frame's origin."""
    linear, angular = axis_twist(joint)
    return weighted((*linear, *angular), (*force, *moment))


def turned(rotation: Matrix, v: tuple[float, float, float]) -> Vector:
    """rotation @ v for a constant v."""
    return (weighted(v, rotation[0]), weighted(v, rotation[1]), weighted(v, rotation[2]))


def momentum(body: Body, twist: Twist) -> tuple[Vector, Vector]:
    """Return the linear momentum of a body that moves with a constant twist, and the angular momentum about the frame's
    origin."""
    found: tuple[Vector, Vector] | None = None
    for weight, part in zip((*twist[0], *twist[1]), range(6), strict=True):
        if weight == 0.0:
            continue
        force, moment = (
            v if weight == 1.0 else (v[0] * weight, v[1] * weight, v[2] * weight)
            for v in _unit_momentum(body, part)
        )
        found = (force, moment) if found is None else (add(found[0], force), add(found[1], moment))
    return (ZERO, ZERO) if found is None else found


def _unit_momentum(body: Body, part: int) -> tuple[Vector, Vector]:
    """Momentum and angular momentum for a unit velocity along x, y or z (part 0, 1, 2), or about it (3, 4, 5)."""
    m, (hx, hy, hz) = body.mass, body.moment
    if part == 0:
        return (m, 0.0, 0.0), (0.0, hz, -hy)
    if part == 1:
        return (0.0, m, 0.0), (-hz, 0.0, hx)
    if part == 2:
        return (0.0, 0.0, m), (hy, -hx, 0.0)
    xx, yy, zz, xy, xz, yz = body.second
    if part == 3:
        return (0.0, -hz, hy), (yy + zz, -xy, -xz)
    if part == 4:
        return (hz, 0.0, -hx), (-xy, xx + zz, -yz)
    return (-hy, hx, 0.0), (-xz, -yz, xx + yy)
