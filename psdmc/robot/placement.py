"""Positions and orientations of frames: placements, rotation matrices, and how rounded entries become exact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.reproducible import arcsine, cosine, length, sine, times
from psdmc.robot.limits import shown

Array = NDArray[np.float64]


def frozen_array(values: object, shape: tuple[int, ...], what: str) -> Array:
    """Return a read-only float64 copy of `values`. Raises ValueError if its shape differs from `shape`."""
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{what} has shape {array.shape}, expected {shape}")
    array.setflags(write=False)
    return array


def made_again(value: Any) -> tuple[type[Any], tuple[Any, ...]]:
    """Return the value of `__reduce__` with which pickle and copy call the constructor of a dataclass. The arrays of
    the copy are then read-only, too."""
    return type(value), tuple(getattr(value, field.name) for field in fields(value) if field.init)


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Position and orientation of a frame in another: x_outer = rotation @ x_inner + translation.

    rotation     (3, 3)  orthonormal
    translation  (3,)    m
    """

    rotation: Array
    translation: Array

    __reduce__ = made_again

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen_array(self.rotation, (3, 3), "rotation"))
        object.__setattr__(self, "translation", frozen_array(self.translation, (3,), "translation"))

    @staticmethod
    def identity() -> Placement:
        return Placement(np.eye(3), np.zeros(3))

    def __matmul__(self, inner: Placement) -> Placement:
        translation = times(self.rotation, inner.translation) + self.translation
        return Placement(times(self.rotation, inner.rotation), translation)

    def inverse(self) -> Placement:
        return Placement(self.rotation.T, -times(self.rotation.T, self.translation))


def about(axis: int, angle: float) -> Array:
    """Return the matrix (3, 3) of a rotation by `angle` (rad) about the x, y or z axis; `axis` is 0, 1 or 2."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = cosine(angle)
    rotation[j, i] = sine(angle)
    rotation[i, j] = -rotation[j, i]
    return rotation


def roll_pitch_yaw(angles: tuple[float, float, float], snap: float = 0.0) -> Array:
    """Return the rotation matrix (3, 3) Rz(yaw) Ry(pitch) Rx(roll). Each of the three rotations is snapped (a near
    right angle becomes exact) separately, because the file rounds each angle separately.

    angles, snap   rad
    """
    roll, pitch, yaw = (snap_rotation(about(axis, angle), snap)[0] for axis, angle in enumerate(angles))
    return np.asarray(times(times(yaw, pitch), roll))


def from_quaternion(x: float, y: float, z: float, w: float) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion, whose real part is w."""
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


# Snapping: rounded entries of a file's rotations become exact zeros and ones.
#
# Files write pi/2 as 1.5708, and even sin(pi) is 1.2e-16 in floats. Both turn an exact zero of the dynamics into a tiny
# number, which later steps would take for a real value.
#
# Because the rows are orthogonal, a rotation matrix has six zeros (axes map to axes), four (one axis maps to an axis),
# one, or none. The patterns with six, four and one zero are tried, in this order.
ROUNDING = 1e-14
"""rad: a smaller angle is floating-point noise of composing rotations, always cleaned, never reported."""

LENGTH_ROUNDING = 4e-15
"""A coordinate below this fraction of the chain's length is noise of composing placements, some units in the last place:
zero. What a file means by 1.57079632679 for a right angle is a thousand times larger."""


def snap_rotation(rotation: Array, tolerance: float) -> tuple[Array, float]:
    """Return a rotation (3, 3) near the given one, with as many exact zeros as possible, and the angle between both
    (rad). The angle is at most `tolerance` (rad).

    Zeros and ones are exact, and the other entries are orthonormal to machine precision. If no rotation with zeros is
    near, the function returns the given rotation and 0. Floating-point noise (ROUNDING) is removed with any tolerance.
    """
    if np.all((rotation == 0.0) | (np.abs(rotation) == 1.0)):
        return rotation + 0.0, 0.0
    reach = max(tolerance, ROUNDING)
    for candidates in (_six_zeros(rotation), _four_zeros(rotation), _one_zero(rotation)):
        angle, _, nearest = min(
            (angle_between(rotation, candidate), k, candidate) for k, candidate in enumerate(candidates)
        )
        if angle <= reach:
            return nearest + 0.0, angle
    return rotation + 0.0, 0.0


def snap_axis(axis: Array, tolerance: float) -> tuple[Array, float]:
    """Return a unit vector (3,) near the given axis, with as many exact zeros as possible, and the angle between both
    (rad). The angle is at most `tolerance` (rad)."""
    unit = axis / length(axis)
    kept = np.where(np.abs(unit) > max(tolerance, ROUNDING) / math.sqrt(2.0), unit, 0.0)
    snapped = np.sign(kept) if np.count_nonzero(kept) == 1 else kept / length(kept)
    return snapped + 0.0, length(snapped - unit)


def snap_translation(translation: Array, chain_length: float) -> Array:
    """Return a translation (3,) in m with entries of rounding size (LENGTH_ROUNDING) set to zero."""
    return np.where(np.abs(translation) > LENGTH_ROUNDING * chain_length, translation, 0.0) + 0.0


def angle_between(a: Array, b: Array) -> float:
    """Return the angle between the orientations a and b (rotation matrices), rad. It is accurate for tiny angles."""
    return float(2.0 * arcsine(min(1.0, length((a - b).reshape(-1)) / math.sqrt(8.0))))


def _six_zeros(rotation: Array) -> list[Array]:
    """The signed permutation that rounding suggests, for each order of the axes."""
    candidates = []
    for order in permutations(range(3)):
        candidate = np.zeros((3, 3))
        for row, column in enumerate(order):
            candidate[row, column] = math.copysign(1.0, rotation[row, column])
        candidates.append(candidate)
    return candidates


def _four_zeros(rotation: Array) -> list[Array]:
    """The nearest rotation that maps axis `column` to plus or minus axis `row`, for each such pair.

    The 2 x 2 block left over, [[c, -s d], [s, c d]] with d = +-1 its determinant, is the one nearest in
    Frobenius norm.
    """
    candidates = []
    for row in range(3):
        for column in range(3):
            i, j = (row + 1) % 3, (row + 2) % 3
            k, l = (column + 1) % 3, (column + 2) % 3
            d = math.copysign(1.0, rotation[row, column])
            c, s = _unit(rotation[i, k] + d * rotation[j, l], rotation[j, k] - d * rotation[i, l])
            candidate = np.zeros((3, 3))
            candidate[row, column] = d
            candidate[i, k], candidate[i, l], candidate[j, k], candidate[j, l] = c, -d * s, s, d * c
            candidates.append(candidate)
    return candidates


def _one_zero(rotation: Array) -> list[Array]:
    """A rotation near to first order with a zero at (row, column), for each such place.

    Its row is (0, u, v), its column (0, c, s) with unit lengths; the other rows lie in the plane of the
    column's axis and (0, -v, u), which fixes the rest: products of one sine or cosine each.
    """
    candidates = []
    for row in range(3):
        for column in range(3):
            i, j = (row + 1) % 3, (row + 2) % 3
            k, l = (column + 1) % 3, (column + 2) % 3
            u, v = _unit(rotation[row, k], rotation[row, l])
            c, s = _unit(rotation[i, column], rotation[j, column])
            candidate = np.zeros((3, 3))
            candidate[row, k], candidate[row, l] = u, v
            candidate[i, column], candidate[j, column] = c, s
            candidate[i, k], candidate[i, l] = -s * v, s * u
            candidate[j, k], candidate[j, l] = c * v, -c * u
            candidates.append(candidate)
    return candidates


def _unit(x: float, y: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    return (x / length, y / length) if length else (1.0, 0.0)


def link_rotation(axis: Array) -> Array:
    """Return the rotation (3, 3) from a link's frame into the joint frame that psdmc chooses. The z axis of the joint
    frame is the given unit axis in the link.

    The x axis of the joint frame is the coordinate axis most perpendicular to z, made exactly perpendicular. So an axis
    along a coordinate axis gives an exact signed permutation, and parallel axes give parallel frames.
    """
    k = int(np.argmin(np.abs(axis)))
    x = np.eye(3)[k] - axis[k] * axis
    x /= length(x)
    return np.array([x, np.cross(axis, x), axis]) + 0.0


DIGITS = (2, 3, 4, 5)
"""Digits behind the point. An angle that a calibration found has more of them, and is no right angle."""
MOST = 8
"""Joints in one note."""


def coarse_right_angles(angles: Mapping[str, Sequence[float]], snap: float) -> tuple[str, ...]:
    """Return a note if the file states right angles with few digits, such as 1.57. The note names joints whose angles
    differ by more than `snap` (rad) from exact multiples of pi/2.

    angles  rad, by the joint's name
    snap    rad; 0 means that the user wants the file's angles, so there is no note
    """
    found = {
        name: coarse
        for name, own in angles.items()
        if (coarse := [x for x in own if _off(x) > snap and any(x == round(_nearest(x), d) for d in DIGITS)])
    }
    if not found or snap == 0.0:
        return ()
    each = [f"{shown(name)} ({', '.join(f'{x:g}' for x in own)})" for name, own in found.items()]
    said = ", ".join(each[:MOST]) + (f" and {len(each) - MOST} more" if len(each) > MOST else "")
    off = max(_off(x) for own in found.values() for x in own)
    unit = 10.0 ** math.floor(math.log10(off))
    return (
        f"right angles written with few digits, at joint(s) {said}: kept as written, up to {off:.1e} rad off; "
        f"--snap {math.ceil(off / unit) * unit:g} takes them for exact",
    )


def _nearest(angle: float) -> float:
    """The multiple of pi/2 that is nearest."""
    return round(angle / (math.pi / 2)) * (math.pi / 2)


def _off(angle: float) -> float:
    return abs(angle - _nearest(angle))
