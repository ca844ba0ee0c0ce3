"""Rigid bodies as pseudo-inertias, constant twists such as a joint's motion per unit rate, and operations on them.

Bodies are rotated, shifted and joined. Twists are multiplied with forces, rates and bodies. Zeros and ones of a twist
cost no operation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.frames import Frame, Rotation, Turn, handed_on, handed_vector, to_previous
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
from psdmc.robot.joints import JointType, Twist

Six = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
"""A symmetric 3 x 3 matrix: xx, yy, zz, xy, xz, yz."""

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Where these entries are in the matrix."""


def full(six: Six) -> Matrix:
    """Return the symmetric matrix with these six entries."""
    xx, yy, zz, xy, xz, yz = six
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def half(rows: Matrix) -> Six:
    """Return the six entries of a symmetric matrix."""
    return tuple(rows[i][j] for i, j in PLACES)


def spun_matrix(rows: Matrix, turn: Turn) -> Matrix:
    """Return R A R^T of a matrix A, given in a joint's rotated frame, with the joint's rotation R about z. Products are
    nested as in `spun`."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rows
    slope = turn.sine * (xx - yy) + turn.cosine * (xy + yx)
    moved, crossed = turn.sine * slope, turn.cosine * slope
    xz, yz, _ = turn.inward((xz, yz, 0.0))
    zx, zy, _ = turn.inward((zx, zy, 0.0))
    return ((xx - moved, crossed - yx, xz), (crossed - xy, yy + moved, yz), (zx, zy, zz))


def spun_six(six: Six, turn: Turn) -> Six:
    """Return R A R^T of a symmetric matrix A, with products nested as in `spun`."""
    xx, yy, zz, xy, xz, yz = six
    slope = turn.sine * (xx - yy) + turn.cosine * (xy + xy)
    moved = turn.sine * slope
    xz, yz, _ = turn.inward((xz, yz, 0.0))
    return (xx - moved, yy + moved, zz, turn.cosine * slope - xy, xz, yz)


class Body(NamedTuple):
    """The mass and the moments of a rigid body, relative to a frame: integrals of 1, r and r r^T over the mass.

    mass    kg
    moment  kg m, (hx, hy, hz) = mass times centre of mass
    second  kg m^2, (xx, yy, zz, xy, xz, yz); the inertia is Ixx = yy + zz, Ixy = -xy and so on

    In this form, rotating, shifting and adding bodies takes the fewest operations. The 4 x 4 matrix of all ten numbers
    is called the pseudo-inertia (Wensing, Kim, Slotine 2018).
    """

    mass: Scalar
    moment: Vector
    second: Six


def body_from_parameters(x: Sequence[Scalar]) -> Body:
    """Return a Body from ten standard parameters (m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz). The frame stays the
    same."""
    m, hx, hy, hz, ixx, ixy, iyy, ixz, iyz, izz = x[:10]
    half_trace = 0.5 * (ixx + iyy + izz)
    return Body(m, (hx, hy, hz), (half_trace - ixx, half_trace - iyy, half_trace - izz, -ixy, -ixz, -iyz))


def turned(body: Body, turn: Turn | Rotation | None, double: Turn | None = None) -> Body:
    """Return a body, given in a joint's rotated frame, along the axes before the rotation: moments R h, R S R^T.

    The second moment xx decreases by s^2 (xx - yy) + 2 s c xy, and yy increases by as much (s, c: sine and cosine).

    turn    the joint's rotation; None: no rotation
    double  rotation by twice the angle, for the difference of xx and yy and the product xy; None: `turn` is used for
            them
    """
    if turn is None:
        return body
    if isinstance(turn, Rotation):
        return _rotated(body, turn.rows)
    xx, yy, zz, xy, xz, yz = body.second
    difference = xx - yy
    if double is None:
        square, product = turn.sine * turn.sine, turn.sine * turn.cosine
        moved = square * difference + (product + product) * xy
        xy = product * difference + (1.0 - (square + square)) * xy
    else:
        half = 0.5 * difference
        moved = half - (double.cosine * half - double.sine * xy)
        xy = double.sine * half + double.cosine * xy
    xz, yz, _ = turn.inward((xz, yz, 0.0))
    return Body(body.mass, turn.inward(body.moment), (xx - moved, yy + moved, zz, xy, xz, yz))


def spun(body: Body, turn: Turn | None) -> Body:
    """Return a body, given in a joint's rotated frame, along the axes before the rotation about z, like `turned`.

    Nested products take four operations fewer than in `turned`, but depend on each other in a longer chain. With t = s
    (xx - yy) + 2 c xy, xx decreases by s t, and xy becomes c t - xy (s, c: sine and cosine).
    """
    if turn is None:
        return body
    second = spun_six(body.second, turn)
    return Body(body.mass, turn.inward(body.moment), second)


def in_previous(frame: Frame, body: Body) -> Body:
    """Return a body along the axes of the parent's frame, given along the axes of `frame` before the joint's rotation.

    The reference point, the frame's origin, stays.
    """
    if frame.is_parallel:
        return body
    moment = to_previous(frame, body.moment)
    xx, yy, zz, xy, xz, yz = body.second
    sine, cosine = frame.rotation[2][1], frame.rotation[1][1]
    if frame.rotation[0] == (1.0, 0.0, 0.0) and sine and cosine:
        difference = yy - zz
        moved = sine * sine * difference + 2.0 * sine * cosine * yz
        yz = sine * cosine * difference + (1.0 - 2.0 * sine * sine) * yz
        xy, xz, _ = Turn(sine, cosine).inward((xy, xz, 0.0))
        return Body(body.mass, moment, (xx, yy - moved, zz + moved, xy, xz, yz))
    return Body(body.mass, moment, half(rotated_tensor(frame.inward_rows, full(body.second))))


def _rotated(body: Body, rows: Matrix) -> Body:
    """A body about one frame along the axes of another, of which the rows give its own."""
    second = multiply(multiply(rows, full(body.second)), transpose(rows))
    return Body(body.mass, transform(rows, body.moment), half(second))


def shifted(body: Body, offset: Vector) -> Body:
    """Return a body relative to another point, from which `offset` p (m) leads to the present reference point.

    The first moments become h + m p, the second moments S + h p^T + p h^T + m p p^T.
    """
    px, py, pz = offset
    hx, hy, hz = body.moment
    xx, yy, zz, xy, xz, yz = body.second
    gx, gy, gz = hx + body.mass * px, hy + body.mass * py, hz + body.mass * pz
    second = (
        xx + px * (hx + gx),
        yy + py * (hy + gy),
        zz + pz * (hz + gz),
        xy + hx * py + px * gy,
        xz + hx * pz + px * gz,
        yz + hy * pz + py * gz,
    )
    return Body(body.mass, (gx, gy, gz), second)


def joined(a: Body, b: Body) -> Body:
    """Two bodies about one frame as one."""
    second = tuple(x + y for x, y in zip(a.second, b.second, strict=True))
    return Body(a.mass + b.mass, add(a.moment, b.moment), second)


def handed_body(frame: Frame, body: Body) -> Body:
    """Return the body that a frame passes to its parent, relative to the parent's frame.

    If the frame stands for several equal limbs, such as legs, the result is the sum of their bodies.
    """
    (mass,), moment = handed_on(frame, [body.mass]), handed_vector(frame, body.moment)
    return Body(mass, moment, tuple(handed_on(frame, body.second)))


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


def effort(joint: JointType, force: Vector, moment: Vector) -> Scalar:
    """Return the component of a force and a moment along the joint's axis: N m, or N for a sliding joint. The moment is
    about the joint frame's origin."""
    linear, angular = axis_twist(joint)
    return weighted((*linear, *angular), (*force, *moment))


def turned_constant(rotation: Matrix, v: tuple[float, float, float]) -> Vector:
    """rotation @ v for a constant v."""
    return (weighted(v, rotation[0]), weighted(v, rotation[1]), weighted(v, rotation[2]))


def momentum_of(body: Body, twist: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    """Return a body's momentum m v + w x h, and its angular momentum h x v + I w about the origin of a frame.

    The frame has velocity v and angular velocity w. The body has mass m, first moments h and inertia I about its origin.
    Accelerations of a body at rest give likewise the force and the moment that it needs.
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
