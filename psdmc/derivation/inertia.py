"""Coefficients of the mass matrix, for each standard parameter apart.

The part of M_ij (i <= j) that one parameter of link k >= j makes is a bilinear form in the twists that joints
i and j give to that link's frame. Joint i's twist is a polynomial of degree one in each of q_{i+1} ... q_k,
so the product has degree one in q_{i+1} ... q_j, where joint j's twist is constant, and degree two in q_{j+1}
... q_k: only the latter need a grid.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.derivation.functions import Functions
from psdmc.derivation.interpolate import LINEAR_SIZE, QUADRATIC_SIZE, along_axes, evaluation, interpolation
from psdmc.derivation.terms import Terms, joined
from psdmc.dynamics.frames import Frame, joint_angle, joint_offset
from psdmc.dynamics.motion import JointState
from psdmc.dynamics.regressor import DRIVE, Placed, Twist, carried, own_twist, twist_in
from psdmc.dynamics.scalar import Scalar, Vector, cross, dot
from psdmc.robot.chain import PARAMETERS_PER_LINK, JointKind

Array = NDArray[np.float64]


class FormalAngle:
    """A revolute joint's q at three formal points (s, c) = (0, 0), (1, 0), (0, 1), from which the
    coefficients of 1, s and c follow by exact differences. It enters the dynamics as their abstract
    scalar."""

    def sincos(self) -> tuple[Array, Array]:
        return np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


class Moving(NamedTuple):
    """One joint at its formal points."""

    kind: JointKind
    frame: Frame
    state: JointState


def moving(frame: Frame) -> Moving:
    q: Scalar = FormalAngle() if frame.kind == "revolute" else np.array([0.0, 1.0])
    return Moving(frame.kind, frame, JointState(joint_angle(frame, q).turn(), joint_offset(frame, q)))


def coefficients(at_points: Scalar, count: int, kind: JointKind) -> Array:
    """Coefficients of degree one from values at the formal points, the new joint's axis last: (count * 3 or
    2,)."""
    values = np.broadcast_to(_at_least_double(at_points), (count, LINEAR_SIZE[kind]))
    return np.concatenate([values[:, :1], values[:, 1:] - values[:, :1]], axis=1).reshape(-1)


def _at_least_double(values: Scalar) -> Array:
    found = np.asarray(values)
    return np.asarray(found, dtype=np.result_type(found, np.float64))


def column(v: Vector) -> Vector:
    """Coefficient vectors with an axis appended for the next joint."""
    return (v[0][:, None], v[1][:, None], v[2][:, None])


def expanded(v: Vector, count: int, kind: JointKind) -> Vector:
    x, y, z = (coefficients(entry, count, kind) for entry in v)
    return (x, y, z)


def carried_twist(joint: Moving, twist: Twist) -> Twist:
    """A twist's coefficients, carried across one more joint."""
    linear, angular = twist
    moved = carried(joint.frame, joint.state, (column(linear), column(angular)))
    count = len(linear[0])
    return expanded(moved[0], count, joint.kind), expanded(moved[1], count, joint.kind)


def constant_twist(frame: Frame) -> Twist:
    linear, angular = own_twist(frame)
    return _as_arrays(linear), _as_arrays(angular)


def _as_arrays(v: Vector) -> Vector:
    return (np.array([v[0]]), np.array([v[1]]), np.array([v[2]]))


def mass_matrix_terms(
    frames: Sequence[Frame], link_frames: Sequence[Placed], functions: Functions, tolerance: float
) -> dict[tuple[int, int], Terms]:
    """M_ij for i <= j as terms in codes and standard parameters (11 per link); `row` is the link.

    Lengths in a unit near the robot's size: `tolerance` is absolute, and decides which coefficients are zero.
    """
    n = len(frames)
    parts: dict[tuple[int, int], list[Terms]] = {(i, j): [] for i in range(n) for j in range(i, n)}
    twists: list[Twist] = []
    for k, frame in enumerate(frames):
        joint = moving(frame)
        twists = [carried_twist(joint, twist) for twist in twists] + [constant_twist(frame)]
        seen = [np.stack([*v, *w]) for v, w in (twist_in(link_frames[k], twist) for twist in twists)]
        for i, j, found in _link_terms(seen, k, functions, tolerance):
            parts[i, j].append(found)
        parts[k, k].append(_drive_term(k))
    return {pair: joined(found) for pair, found in parts.items()}


def _drive_term(k: int) -> Terms:
    """The drive's inertia of joint k adds to M_kk and to nothing else."""
    parameter = PARAMETERS_PER_LINK * k + DRIVE
    return Terms(np.array([k]), np.array([0]), np.array([parameter]), np.array([1.0]))


def _link_terms(
    twists: Sequence[Array], k: int, functions: Functions, tolerance: float
) -> Iterator[tuple[int, int, Terms]]:
    """The parts of M_ij that link k's ten parameters make; twists[i] is (6, coefficients)."""
    kinds = functions.kinds
    for j in range(k + 1):
        inner = kinds[j + 1 : k + 1]
        second = _at_nodes(twists[j], inner)
        for i in range(j + 1):
            first = _at_nodes(twists[i], inner)
            products = mass_features(first, second)
            found = _interpolated(products, inner)
            sizes = [LINEAR_SIZE[kind] for kind in kinds[i + 1 : j + 1]]
            sizes += [QUADRATIC_SIZE[kind] for kind in inner]
            parameter, place = np.nonzero(np.abs(found) > tolerance)
            codes = functions.tensor_codes(i + 1, sizes)[place]
            columns = PARAMETERS_PER_LINK * k + parameter
            yield i, j, Terms(np.full(len(codes), k), codes, columns, found[parameter, place])


def _at_nodes(twist: Array, inner: Sequence[JointKind]) -> Array:
    """(6, outer, nodes): a twist's coefficients along the outer joints, its values along the inner ones."""
    size = int(np.prod([LINEAR_SIZE[kind] for kind in inner], dtype=np.int64))
    batch = twist.reshape(-1, size)
    values = along_axes([evaluation(kind, twist.dtype) for kind in inner], np.ascontiguousarray(batch.T))
    return values.reshape(6, -1, values.shape[1])


def _interpolated(products: Array, inner: Sequence[JointKind]) -> Array:
    """(10, outer * coefficients) from (10, outer, nodes)."""
    batch = products.reshape(-1, products.shape[-1])
    found = along_axes([interpolation(kind, products.dtype) for kind in inner], np.ascontiguousarray(batch.T))
    return found.reshape(products.shape[0], -1)


def mass_features(first: Array, second: Array) -> Array:
    """(10, ...): for each standard parameter of a body, two twists' part of the mass matrix when it is one.

    first, second   (6, ...) linear velocity of the frame's origin and angular velocity; broadcast
    """
    v, w = first[:3], first[3:]
    u, o = second[:3], second[3:]
    x, y, z = (a + b for a, b in zip(_crossed(v, o), _crossed(u, w), strict=True))
    return np.stack(
        [
            dot((v[0], v[1], v[2]), (u[0], u[1], u[2])),
            x,
            y,
            z,
            w[0] * o[0],
            w[0] * o[1] + w[1] * o[0],
            w[1] * o[1],
            w[0] * o[2] + w[2] * o[0],
            w[1] * o[2] + w[2] * o[1],
            w[2] * o[2],
        ]
    )


def _crossed(a: Array, b: Array) -> Vector:
    return cross((a[0], a[1], a[2]), (b[0], b[1], b[2]))
