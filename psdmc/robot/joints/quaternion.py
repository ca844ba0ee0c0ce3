"""Operations on unit quaternions (x, y, z, w), which are coordinates of joints. They work on floats, arrays and symbols
(which record code)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from psdmc.robot.joints.joint_type import Rows, Scalar, Vector
from psdmc.robot.joints.scalars import TINY, root, sign, sincos, square_of, unit

Quaternion = tuple[Scalar, Scalar, Scalar, Scalar]

HALVINGS = 3
"""Of the angle that a quaternion turns by: half of it, a quarter turn at most, becomes pi/16, whose sine is 0.195."""

ARCSINE = tuple(math.comb(2 * k, k) / (4**k * (2 * k + 1)) for k in range(12))
"""Series of asin(x)/x in x^2: beyond these terms less than 1e-18 for x <= 0.195."""


def rotation_of(quaternion: Sequence[Scalar]) -> Rows:
    """Return the rotation matrix, as three rows, of a quaternion (x, y, z, w). The quaternion must have length one."""
    x, y, z, w = quaternion
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz, xy, xz, yz = x2 * x, y2 * y, z2 * z, y2 * x, z2 * x, z2 * y
    wx, wy, wz = x2 * w, y2 * w, z2 * w
    return (
        (1.0 - (yy + zz), xy - wz, xz + wy),
        (xy + wz, 1.0 - (xx + zz), yz - wx),
        (xz - wy, yz + wx, 1.0 - (xx + yy)),
    )


def turned_by(quaternion: Sequence[Scalar], angles: Sequence[Scalar]) -> tuple[Quaternion, Scalar, Scalar]:
    """Return a unit quaternion rotated by the rotation vector `angles` (rad), which is about axes of the rotated frame.

    Return also sin(h)/h and cos(h), where h is half of the angle of rotation. The new quaternion has length one.
    """
    half = root(0.25 * square_of(angles) + TINY)
    sine, cosine = sincos(half)
    share = sine / half
    x, y, z = (0.5 * share * angle for angle in angles)
    moved = product(quaternion, (x, y, z, cosine))
    i, j, k, w = unit(moved)
    return (i, j, k, w), share, cosine


def angles_between(quaternion: Sequence[Scalar], other: Sequence[Scalar]) -> tuple[Vector, Scalar]:
    """Return the rotation vector (rad, at most half a turn) that leads from the first quaternion to the other one. It
    is about the axes that the first quaternion has rotated. Return also h cot(h), where h is half of the angle.

    The result is accurate for very small angles and for angles near half a turn. The angle comes from a series of the
    arcsine after repeated halving. The sine is computed from the difference of the quaternions, because their product
    loses digits if they are nearly equal.
    """
    back = inverse(quaternion)
    w = product(back, other)[3]
    nearer = sign(w)
    x, y, z, _ = product(back, [nearer * there - here for here, there in zip(quaternion, other, strict=True)])
    length = 1.0 / root(x * x + y * y + z * z + w * w)
    sine, cosine = (x * length, y * length, z * length), w * nearer * length
    share = arc(square_of(sine), cosine)
    angles = (2.0 * share * sine[0], 2.0 * share * sine[1], 2.0 * share * sine[2])
    return angles, share * cosine


def arc(square: Scalar, cosine: Scalar) -> Scalar:
    """Return h / sin(h) for an angle h of at most a quarter turn, from the square of sin(h) and cos(h) >= 0."""
    shrunk: Scalar = 1.0
    for _ in range(HALVINGS):
        cosine = root(0.5 + 0.5 * cosine)
        shrunk = shrunk / (2.0 * cosine)
    part = square * shrunk * shrunk
    total: Scalar = ARCSINE[-1]
    for term in reversed(ARCSINE[:-1]):
        total = total * part + term
    return 2.0**HALVINGS * shrunk * total


def rates_of(quaternion: Sequence[Scalar], angular: Sequence[Scalar]) -> Quaternion:
    """Return the derivative of a quaternion at an angular velocity along the axes of the rotated frame."""
    x, y, z = (0.5 * rate for rate in angular)
    return product(quaternion, (x, y, z, 0.0))


def rates_bent(
    quaternion: Sequence[Scalar], angular: Sequence[Scalar], motion: Sequence[Scalar]
) -> Quaternion:
    """Return how fast the result of `rates_of`, at constant angular velocity `angular`, changes while the quaternion
    turns at the angular velocity `motion`."""
    return rates_of(rates_of(quaternion, motion), angular)


def turning(quaternion: Sequence[Scalar], moved: Sequence[Scalar]) -> Vector:
    """Return the angular velocity at which a quaternion turns while its entries change at the rates `moved`. It is
    along the axes of the rotated frame. The quaternion may have any length."""
    x, y, z, _ = product(inverse(quaternion), moved)
    twice = 2.0 / square_of(quaternion)
    return (twice * x, twice * y, twice * z)


def product(a: Sequence[Scalar], b: Sequence[Scalar]) -> Quaternion:
    """Return the product a b of two quaternions. It is the rotation a, followed by the rotation b about the axes that a
    has rotated."""
    (x, y, z, w), (i, j, k, r) = a, b
    return (
        w * i + x * r + (y * k - z * j),
        w * j + y * r + (z * i - x * k),
        w * k + z * r + (x * j - y * i),
        w * r - (x * i + y * j + z * k),
    )


def inverse(quaternion: Sequence[Scalar]) -> Quaternion:
    """Return the inverse of a unit quaternion."""
    x, y, z, w = quaternion
    return (-x, -y, -z, w)
