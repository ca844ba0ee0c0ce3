"""Moving composites: all bodies that a joint carries as one body, and their motion relative to the link before the
joint.

Relative to that link, a mass point at r has the velocity r' and the acceleration r''. Both depend only on this joint
and on the joints further out. Only integrals over the mass of the composite are needed: 2 int r r'^T, 2 int r', int r''
and int r x r''.

Composites are built from tip to base. The composite of a joint's children is rotated and shifted to the joint's frame,
and added to the joint's body. Then the motion by the joint itself is added.
"""

from __future__ import annotations

from typing import NamedTuple

from psdmc.dynamics.coordinates import as_tuple
from psdmc.dynamics.frames import Frame, Rotation, Turn, handed_vector, to_previous
from psdmc.dynamics.motion import LinkMotion, Rates, spin_of
from psdmc.dynamics.newton_euler import wrench
from psdmc.dynamics.scalar import (
    ZERO,
    Matrix,
    Scalar,
    Vector,
    add,
    cross,
    multiply,
    rotated_tensor,
    scale,
    transform,
    transpose,
)
from psdmc.dynamics.spatial import (
    Body,
    combined,
    full,
    handed_body,
    in_previous,
    joined,
    shifted,
    spun,
    spun_matrix,
    turned,
)
from psdmc.robot.joints import JointType


class Momenta(NamedTuple):
    """Two integrals over the mass of a composite (several bodies as one): 2 int r r'^T dm and 2 int r' dm. The points
    at r have the velocities r'.

    `second` is the first integral, a 3 x 3 matrix whose rows belong to the components of r.
    """

    second: Matrix
    first: Vector


class Composite(NamedTuple):
    """A composite (several bodies as one): mass moments about a point, and integrals of the motion relative to a link.

    body     mass, first moment and second moments of all bodies together
    momenta  integrals of the velocities relative to the link
    wrench   the force int r'' dm and the moment int r x r'' dm, with the accelerations r'' relative to the link
    """

    body: Body
    momenta: Momenta
    wrench: tuple[Vector, Vector]


def at_rest(body: Body) -> Composite:
    """Return the composite (several bodies as one) that consists of one body, which does not move relative to the
    link."""
    return Composite(body, Momenta((ZERO, ZERO, ZERO), ZERO), (ZERO, ZERO))


def relieved(composite: Composite, force: Vector, moment: Vector) -> Composite:
    """Return the composite with an external wrench subtracted from the wrench that its motion needs. The external wrench is
    constant along the link's axes."""
    own_force, own_moment = composite.wrench
    return composite._replace(
        wrench=(add(own_force, scale(force, -1.0)), add(own_moment, scale(moment, -1.0)))
    )


def both(a: Composite, b: Composite) -> Composite:
    """Add two composites (several bodies as one), both about one point and relative to one link."""
    second = tuple(add(x, y) for x, y in zip(a.momenta.second, b.momenta.second, strict=True))
    return Composite(
        joined(a.body, b.body),
        Momenta(second, add(a.momenta.first, b.momenta.first)),  # type: ignore[arg-type]
        (add(a.wrench[0], b.wrench[0]), add(a.wrench[1], b.wrench[1])),
    )


def moved_to(composite: Composite, offset: Vector) -> Composite:
    """Return a composite (several bodies as one) with its moments about another point of the link. `offset` leads from
    the new point to the old one."""
    (second, first), (force, moment) = composite.momenta, composite.wrench
    rows = tuple(add(row, scale(first, length)) for row, length in zip(second, offset, strict=True))
    return Composite(
        shifted(composite.body, offset),
        Momenta(rows, first),  # type: ignore[arg-type]
        (force, add(moment, cross(offset, force))),
    )


def along_parent(frame: Frame, composite: Composite) -> Composite:
    """Rotate a composite (several bodies as one) from a joint's axes, before the joint's motion, to the axes of the
    link before the joint."""
    if frame.is_parallel:
        return composite
    second, first = composite.momenta
    second = rotated_tensor(frame.inward_rows, second)
    force, moment = (to_previous(frame, v) for v in composite.wrench)
    body = in_previous(frame, composite.body)
    return Composite(body, Momenta(second, to_previous(frame, first)), (force, moment))


def handed_composite(frame: Frame, composite: Composite) -> Composite:
    """Return the composite (several bodies as one) that a joint's frame adds to its parent; the given composite is
    about the parent's frame. If the frame represents several equal limbs (such as legs), the result is the sum over all
    limbs."""
    (x, y, z), first = composite.momenta
    second = (handed_vector(frame, x), handed_vector(frame, y), handed_vector(frame, z))
    force, moment = (handed_vector(frame, v) for v in composite.wrench)
    body = handed_body(frame, composite.body)
    return Composite(body, Momenta(second, handed_vector(frame, first)), (force, moment))


def before_turn(composite: Composite, turn: Turn | Rotation | None) -> Composite:
    """Rotate a composite (several bodies as one) from the axes after a joint's rotation to the axes before the
    rotation."""
    if turn is None:
        return composite
    if isinstance(turn, Rotation):
        return _rotated(composite, turn)
    force, moment = (turn.inward(v) for v in composite.wrench)
    body = spun(composite.body, turn)
    second = spun_matrix(composite.momenta.second, turn)
    return Composite(body, Momenta(second, turn.inward(composite.momenta.first)), (force, moment))


def _rotated(composite: Composite, turn: Rotation) -> Composite:
    second, first = composite.momenta
    second = multiply(multiply(turn.rows, second), transpose(turn.rows))
    force, moment = (turn.inward(v) for v in composite.wrench)
    return Composite(turned(composite.body, turn), Momenta(second, turn.inward(first)), (force, moment))


def driven(joint: JointType, composite: Composite, qd: Scalar, qdd: Scalar) -> Composite:
    """Add a joint's motion to a composite. The given composite moves relative to the link after the joint, the returned
    one relative to the link before the joint."""
    rate, slide = joint.turn(qd), joint.slide(qd)
    found = composite if rate is None else _spinning(composite, rate, joint.turn(qdd))
    return found if slide is None else _sliding(found, slide, joint.slide(qdd))


def driven_freely(joint: JointType, composite: Composite, qd: Scalar, qdd: Scalar) -> Composite:
    """Add the motion of a joint with several coordinates to a composite. The given composite moves relative to the link
    after the joint, the returned one relative to the link before the joint.

    The joint's linear velocity u and angular velocity s are along the axes after the motion. The velocity r' of a point
    at r increases by s x r + u. The acceleration r'' increases by du/dt + s x u + U r + 2 s x r', with the matrix U of
    s and ds/dt.
    """
    (u, s), (u_change, s_change) = (
        combined(joint, as_tuple(qd)),
        combined(joint, as_tuple(qdd)),
    )
    body, (second, first), (force, moment) = composite
    pushed = wrench(LinkMotion(add(u_change, cross(s, u)), spin_of(Rates(s, s_change))), body)
    force = add(force, add(pushed[0], cross(s, first)))
    moment = add(moment, add(pushed[1], swept(second, s)))
    rows: list[Vector] = []
    for row, inertia, h in zip(second, full(body.second), body.moment, strict=True):
        rows.append(add(row, scale(add(cross(s, inertia), scale(u, h)), 2.0)))
    first = add(first, scale(add(cross(s, body.moment), scale(u, body.mass)), 2.0))
    return Composite(body, Momenta((rows[0], rows[1], rows[2]), first), (force, moment))


def swept(second: Matrix, s: Vector) -> Vector:
    """Compute the moment of the Coriolis accelerations of a composite (several bodies as one). The moment is int r x (2
    s x r') dm = (tr P - P^T) s.

    s is the angular velocity of the axes, r' are the velocities of the points r, and P is the integral 2 int r r'^T dm.
    """
    trace = second[0][0] + second[1][1] + second[2][2]
    return add(scale(s, trace), scale(transform(transpose(second), s), -1.0))


def _spinning(composite: Composite, rate: Scalar, acceleration: Scalar) -> Composite:
    """r' gets rate z x r; r'' gets (acceleration z x + rate^2 z x z x) r + 2 rate z x r'."""
    body, (second, first), (force, moment) = composite
    (hx, hy, _), (xx, yy, _, xy, xz, yz) = body.moment, body.second
    (x, y, z), (px, py, _) = second, first
    twice, square = rate + rate, rate * rate
    force = (
        force[0] - (rate * py + acceleration * hy + square * hx),
        force[1] + (rate * px + acceleration * hx - square * hy),
        force[2],
    )
    moment = (
        moment[0] - (rate * z[0] + acceleration * xz - square * yz),
        moment[1] - (rate * z[1] + acceleration * yz + square * xz),
        moment[2] + (rate * (x[0] + y[1]) + acceleration * (xx + yy)),
    )
    rows = (_plus_turned(x, twice, xx, xy), _plus_turned(y, twice, xy, yy), _plus_turned(z, twice, xz, yz))
    return Composite(body, Momenta(rows, _plus_turned(first, twice, hx, hy)), (force, moment))


def _plus_turned(v: Vector, rate: Scalar, x: Scalar, y: Scalar) -> Vector:
    """v + rate z x (x, y, .)"""
    return (v[0] - rate * y, v[1] + rate * x, v[2])


def _sliding(composite: Composite, rate: Scalar, acceleration: Scalar) -> Composite:
    """r' gets rate z, r'' gets acceleration z."""
    body, ((x, y, z), first), (force, moment) = composite
    twice, (hx, hy, hz) = rate + rate, body.moment
    rows = (_plus_along(x, twice * hx), _plus_along(y, twice * hy), _plus_along(z, twice * hz))
    force = _plus_along(force, body.mass * acceleration)
    moment = (moment[0] + hy * acceleration, moment[1] - hx * acceleration, moment[2])
    return Composite(body, Momenta(rows, _plus_along(first, twice * body.mass)), (force, moment))


def _plus_along(v: Vector, value: Scalar) -> Vector:
    """v + value z"""
    return (v[0], v[1], v[2] + value)
