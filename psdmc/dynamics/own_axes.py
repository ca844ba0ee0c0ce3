"""Formulas for joints with several coordinates, such as spherical joints, in the recursion of torque derivatives
(derivatives.py).

Each rate of such a joint is along or about one axis of the frame that the joint moves. The formulas for a joint about z
apply, with this axis in place of z. All vectors are along the axes after the joint's rotation. One term is added, V x
E: the joint's twist V rotates the unit twist E of each rate.
"""

from __future__ import annotations

from psdmc.dynamics.body import Body
from psdmc.dynamics.joint_steps import Axis, Row, Wrench, axis_of
from psdmc.dynamics.moving_composite import Composite, Momenta
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, scale, transform, transpose
from psdmc.dynamics.twist import combined, efforts
from psdmc.robot.joints import JointType

Vectors = tuple[Vector, Vector]
"""A linear and an angular one."""


def unit_twists(joint: JointType) -> list[tuple[int, bool]]:
    """Return one pair per joint rate: the number of the axis (0, 1, 2 for x, y, z), and whether the rate is a rotation
    about this axis."""
    places = [(*linear, *angular).index(1.0) for linear, angular in joint.twists]
    return [(place % 3, place >= 3) for place in places]


def to_z(v: Vector, axis: int) -> Vector:
    """Permute the entries x, y, z of a vector cyclically so that the given axis becomes z."""
    return (v[(axis + 1) % 3], v[(axis + 2) % 3], v[axis])


def from_z(v: Vector, axis: int) -> Vector:
    """Back."""
    return to_z(v, (1 - axis) % 3)


def axis_along(axis: Axis, number: int) -> Axis:
    """Return the motion of the link before a joint, with the entries of all vectors permuted so that the axis `number`
    becomes z."""
    vectors = (to_z(v, number) for v in (axis.w, axis.dw, axis.acceleration, axis.up))
    return axis_of(*vectors)


def composite_along(composite: Composite, number: int) -> Composite:
    """Return a composite (several bodies as one) with the entries of all vectors permuted so that the axis `number`
    becomes z."""
    body, (second, first), (force, moment) = composite
    xx, yy, zz, xy, xz, yz = body.second
    squares, products = to_z((xx, yy, zz), number), to_z((yz, xz, xy), number)
    turned = Body(body.mass, to_z(body.moment, number), (*squares, products[2], products[1], products[0]))
    rows = to_z((second[0], second[1], second[2]), number)
    a, b, c = (to_z(row, number) for row in rows)
    return Composite(
        turned, Momenta((a, b, c), to_z(first, number)), (to_z(force, number), to_z(moment, number))
    )


def bending(own: Vectors, number: int, turns: bool) -> Vectors:
    """Compute V x E, linear and angular: the change of a rate's unit twist E by the joint's motion V.

    own     V, the joint's linear and angular velocity
    number  axis of E: 0, 1, 2 for x, y, z
    turns   whether E is a rotation about the axis; otherwise E is a motion along the axis
    """
    (u, s), e = own, (float(number == 0), float(number == 1), float(number == 2))
    return (cross(u, e), cross(s, e)) if turns else (cross(s, e), ZERO)


def accelerating(body: Body, linear: Vector, angular: Vector) -> Wrench:
    """Return the force and moment that give a body at rest the given linear and angular accelerations."""
    xx, yy, zz, xy, xz, yz = body.second
    ax, ay, az = angular
    spun = (
        (yy + zz) * ax - xy * ay - xz * az,
        (xx + zz) * ay - xy * ax - yz * az,
        (xx + yy) * az - xz * ax - yz * ay,
    )
    force = add(scale(linear, body.mass), cross(angular, body.moment))
    return force, add(spun, cross(body.moment, linear))


def by_own_axes(
    joint: JointType, axis: Axis, row: Row, rates: Scalar
) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...], tuple[Scalar, ...]]:
    """Compute the derivatives of one torque by the positions, the rates and the accelerations of one joint with several
    coordinates.

    row  the vectors (A, B, C) of the torque; the module docstring of derivatives.py defines them
    """
    (a, b, c), (u, s) = row, combined(joint, rates)
    field = transpose(axis.spin.field)
    turning = add(transform(field, a), add(cross(b, axis.w), cross(c, axis.acceleration)))
    by_q = efforts(joint, transform(field, c), turning)
    bent = add(scale(axis.w, 2.0), s)
    by_qd = efforts(joint, cross(c, bent), add(add(cross(a, bent), b), cross(c, u)))
    return by_q, by_qd, efforts(joint, c, a)
