"""The matrix U of a frame: the part of the acceleration of the frame's points that angular rates cause. U is computed
from the angular rates, or from the matrix U of the parent frame."""

from __future__ import annotations

from typing import NamedTuple

from psdmc.dynamics.frames import IDENTITY, Frame
from psdmc.dynamics.scalar import Matrix, Scalar, Vector, rotated_tensor, transpose


class Spin(NamedTuple):
    """The matrix U of a frame, which depends on the angular rates only. A point at r accelerates with a + U r, with the
    acceleration a of the frame's origin.

    field        the 3 x 3 matrix U
    differences  (Uzz - Uyy, Uxx - Uzz, Uyy - Uxx), computed from squares of rates if that takes fewer operations
    """

    field: Matrix
    differences: Vector


class Rates(NamedTuple):
    """Angular rates of one frame, along the frame's axes.

    w     angular velocity
    dw_r  derivative of the reference angular velocity
    w_r   reference angular velocity (of the Slotine-Li form); None: w takes the place of w_r
    """

    w: Vector
    dw_r: Vector
    w_r: Vector | None = None

    @property
    def reference(self) -> Vector:
        """The reference angular velocity."""
        return self.w if self.w_r is None else self.w_r


class JointRates(NamedTuple):
    """Rate, reference acceleration and reference rate of a joint that rotates about z or slides along z. If qd_r is
    None, qd takes the place of qd_r."""

    qd: Scalar
    qdd_r: Scalar
    qd_r: Scalar | None = None

    @property
    def reference(self) -> Scalar:
        return self.qd if self.qd_r is None else self.qd_r


def spin_of(rates: Rates) -> Spin:
    """Compute the matrix U = [w][w_r] + [dw_r] = w_r w^T - (w . w_r) 1 + [dw_r] from a frame's angular rates. [w] is
    the matrix of the cross product with w."""
    (wx, wy, wz), (rx, ry, rz), (ax, ay, az) = rates.w, rates.reference, rates.dw_r
    xx, yy, zz = wx * rx, wy * ry, wz * rz
    field = (
        (-(yy + zz), rx * wy - az, rx * wz + ay),
        (ry * wx + az, -(xx + zz), ry * wz - ax),
        (rz * wx - ay, rz * wy + ax, -(xx + yy)),
    )
    return Spin(field, (zz - yy, xx - zz, yy - xx))


def spin_before_turn(frame: Frame, previous: Spin, before: Rates, turning: JointRates | None) -> Spin:
    """Compute the matrix U of a body without children, along the axes before the body's rotation.

    The result is the parent's matrix U plus ([qd w_r + qd_r w + qd qd_r z] + qdd_r)[z]. [z] is the matrix of the cross
    product with the joint's axis z.
    """
    (u, d) = _turned_field(frame, previous)
    if turning is None:
        return Spin(u, d)
    qd, qdd_r, w = turning.qd, turning.qdd_r, before.w
    if turning.qd_r is None or before.w_r is None:
        twice = qd + qd
        vx, vy, vz = twice * w[0], twice * w[1], qd * (w[2] + (w[2] + qd))
    else:
        qd_r, w_r = turning.qd_r, before.w_r
        vx, vy, vz = (
            qd * w_r[0] + qd_r * w[0],
            qd * w_r[1] + qd_r * w[1],
            qd * w_r[2] + qd_r * (w[2] + qd),
        )
    field = (
        (u[0][0] - vz, u[0][1] - qdd_r, u[0][2]),
        (u[1][0] + qdd_r, u[1][1] - vz, u[1][2]),
        (u[2][0] + vx, u[2][1] + vy, u[2][2]),
    )
    return Spin(field, (d[0] + vz, d[1] - vz, d[2]))


def _turned_field(frame: Frame, spin: Spin) -> Spin:
    """The spin of the parent's frame, along this frame's axes before its turn."""
    if frame.is_parallel:
        return spin
    field = rotated_tensor(frame.outward_rows, spin.field)
    return Spin(field, _permuted_differences(frame.rotation, spin, field))


def _permuted_differences(rotation: Matrix, spin: Spin, field: Matrix) -> Vector:
    """The differences of the turned field: the old ones in another order where axes map to axes, else from the
    diagonal."""
    axes = [_axis(column) for column in transpose(rotation)]
    known = {(2, 1): spin.differences[0], (0, 2): spin.differences[1], (1, 0): spin.differences[2]}
    known |= {(b, a): -value for (a, b), value in known.items()}

    def difference(a: int, b: int) -> Scalar:
        pair = (axes[a], axes[b])
        return known[pair] if pair in known else field[a][a] - field[b][b]

    return (difference(2, 1), difference(0, 2), difference(1, 0))


def _axis(direction: Vector) -> int:
    """Return the number of the axis that a direction is along, in either sense; -1 if it is along none. Beside a cosine
    that is 1.0, a sine may be 1e-9."""
    sizes = tuple(map(abs, direction))
    return IDENTITY.index(sizes) if sizes in IDENTITY else -1
