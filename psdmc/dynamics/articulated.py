"""Articulated inertias: the wrench per acceleration of a body whose further joints move freely, as symmetric 6 x 6
matrices in blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.body import Body
from psdmc.dynamics.frames import Frame, Rotation, Turn, handed_on, handed_vector
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, multiply, transpose

Six = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
"""A symmetric matrix: xx, yy, zz, xy, xz, yz; or a force and a moment, a linear and an angular acceleration."""

_PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Articulated(NamedTuple):
    """Articulated inertia of a frame: force = linear a + mixed alpha, moment = mixed^T a + angular alpha.

    linear   kg, symmetric
    mixed    kg m
    angular  kg m^2, symmetric
    """

    linear: Six
    mixed: Matrix
    angular: Six


NOTHING = Articulated((0.0,) * 6, (ZERO, ZERO, ZERO), (0.0,) * 6)


def rigid(body: Body) -> Articulated:
    """A body with no joint beyond it."""
    m, (x, y, z), (xx, yy, zz, xy, xz, yz) = body
    return Articulated(
        (m, m, m, 0.0, 0.0, 0.0),
        ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)),
        (yy + zz, xx + zz, xx + yy, -xy, -xz, -yz),
    )


def both(a: Articulated, b: Articulated) -> Articulated:
    """Two about one frame as one."""
    mixed = tuple(add(x, y) for x, y in zip(a.mixed, b.mixed, strict=True))
    return Articulated(_sum(a.linear, b.linear), mixed, _sum(a.angular, b.angular))  # type: ignore[arg-type]


def moved_to(inertia: Articulated, offset: Vector) -> Articulated:
    """About a point from which the present one lies at `offset` p: with G = mixed - linear [p], angular gets
    [p] G + ([p] mixed)^T."""
    x, y, z = offset
    skew: Matrix = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    pushed = multiply(full(inertia.linear), skew)
    mixed: Matrix = tuple(  # type: ignore[assignment]
        tuple(a - b for a, b in zip(row, other, strict=True))
        for row, other in zip(inertia.mixed, pushed, strict=True)
    )
    near, far = multiply(skew, mixed), multiply(skew, inertia.mixed)
    angular = tuple(
        own + (near[i][j] + far[j][i]) for own, (i, j) in zip(inertia.angular, _PLACES, strict=True)
    )
    return Articulated(inertia.linear, mixed, angular)


def handed(frame: Frame, inertia: Articulated) -> Articulated:
    """Return what a frame passes to its parent, about the parent's frame: the sum over all limbs that the frame
    represents."""
    rows = tuple(handed_vector(frame, row) for row in inertia.mixed)
    linear, angular = (tuple(handed_on(frame, part)) for part in (inertia.linear, inertia.angular))
    return Articulated(linear, rows, angular)  # type: ignore[arg-type]


def along_parent(frame: Frame, inertia: Articulated) -> Articulated:
    """Rotate from the axes before a joint's motion to the axes of the frame that carries the joint."""
    return inertia if frame.is_parallel else rotated(inertia, frame.rotation)


def before_turn(inertia: Articulated, turn: Turn | Rotation | None) -> Articulated:
    """Seen from before a joint's turn."""
    if turn is None:
        return inertia
    if isinstance(turn, Rotation):
        return rotated(inertia, turn.rows)
    return Articulated(
        _turned(inertia.linear, turn), _turned_mixed(inertia.mixed, turn), _turned(inertia.angular, turn)
    )


def rotated(inertia: Articulated, rows: Matrix) -> Articulated:
    """Along other axes, of which the rows give the present ones."""
    back = transpose(rows)
    linear, mixed, angular = (
        multiply(multiply(rows, part), back)
        for part in (full(inertia.linear), inertia.mixed, full(inertia.angular))
    )
    return Articulated(_half(linear), mixed, _half(angular))


def full(six: Six) -> Matrix:
    """The symmetric matrix."""
    xx, yy, zz, xy, xz, yz = six
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def rows_of(inertia: Articulated) -> list[list[Scalar]]:
    """6 x 6, linear parts first."""
    upper = [[*a, *b] for a, b in zip(full(inertia.linear), inertia.mixed, strict=True)]
    lower = [[*a, *b] for a, b in zip(transpose(inertia.mixed), full(inertia.angular), strict=True)]
    return upper + lower


def from_rows(rows: Sequence[Sequence[Scalar]]) -> Articulated:
    """Build from a 6 x 6 matrix; of its symmetric blocks only the upper triangles are read."""
    linear = tuple(rows[i][j] for i, j in _PLACES)
    mixed = tuple((row[3], row[4], row[5]) for row in rows[:3])
    angular = tuple(rows[i + 3][j + 3] for i, j in _PLACES)
    return Articulated(linear, mixed, angular)  # type: ignore[arg-type]


def _sum(a: Six, b: Six) -> Six:
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _half(rows: Matrix) -> Six:
    return tuple(rows[i][j] for i, j in _PLACES)


def _turned(six: Six, turn: Turn) -> Six:
    """Symmetric, before a turn about z, products nested: with t = s (xx - yy) + 2 c xy, xx loses s t and xy becomes
    c t - xy."""
    xx, yy, zz, xy, xz, yz = six
    slope = turn.sine * (xx - yy) + turn.cosine * (xy + xy)
    moved = turn.sine * slope
    xz, yz, _ = turn.inward((xz, yz, 0.0))
    return (xx - moved, yy + moved, zz, turn.cosine * slope - xy, xz, yz)


def _turned_mixed(rows: Matrix, turn: Turn) -> Matrix:
    """Rotate a matrix that is not symmetric."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rows
    slope = turn.sine * (xx - yy) + turn.cosine * (xy + yx)
    moved, crossed = turn.sine * slope, turn.cosine * slope
    xz, yz, _ = turn.inward((xz, yz, 0.0))
    zx, zy, _ = turn.inward((zx, zy, 0.0))
    return ((xx - moved, crossed - yx, xz), (crossed - xy, yy + moved, yz), (zx, zy, zz))
