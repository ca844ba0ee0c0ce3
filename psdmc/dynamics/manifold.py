"""The position after motion at constant rates, and the rates that lead from one position to another, joint by joint.
The values can be numbers or symbols.

If a joint has several coordinates, its q is a point on a manifold: a quaternion has length one. Its tangents are the
rates, nv in total, along the axes of the moved frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.slices import leading
from psdmc.dynamics.solve import inner_product
from psdmc.robot.joints import JointType


def integrated(frames: Sequence[Frame], q: Sequence[Scalar], step: Sequence[Scalar]) -> list[Scalar]:
    """Return the nq coordinates after one second of motion from q at constant rates `step`, nv of them."""
    return [x for joint, here, way in _joints(frames, q, step) for x in joint.integrated(here, way)]


def difference(frames: Sequence[Frame], q: Sequence[Scalar], other: Sequence[Scalar]) -> list[Scalar]:
    """Return the nv constant rates that lead from q to `other` in one second, along the shortest rotation."""
    return [x for joint, here, there in _coordinates(frames, q, other) for x in joint.difference(here, there)]


def coordinate_rates(frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Scalar]:
    """Return the changes per second of the nq coordinates at these nv rates."""
    return [x for joint, here, own in _joints(frames, q, rates) for x in joint.coordinate_rates(here, own)]


def rates_bent(
    frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar], way: Sequence[Scalar]
) -> list[Scalar]:
    """Return the changes per second of `coordinate_rates`, for constant joint rates `rates`, while q moves at the joint
    rates `way`."""
    both = zip(_joints(frames, q, rates), _joints(frames, q, way), strict=True)
    return [x for (joint, here, own), (_, _, moved) in both for x in joint.rates_bent(here, own, moved)]


def tangent(frames: Sequence[Frame], q: Sequence[Scalar], moved: Sequence[Scalar]) -> list[Scalar]:
    """Return the nv rates of `restored(q)` while the coordinates q change by the nq values `moved` per second.
    Quaternions in q may have any length."""
    return [x for joint, here, own in _coordinates(frames, q, moved) for x in joint.tangent(here, own)]


def restored(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[Scalar]:
    """Return the nearest positions that the joints can have; for example, quaternions get length one."""
    return [x for joint, here, _ in _joints(frames, q, ()) for x in joint.restored(here)]


def pulled_back(frames: Sequence[Frame], q: Sequence[Scalar], gradient: Sequence[Scalar]) -> list[Scalar]:
    """Convert nq derivatives of a quantity by the coordinates to its nv derivatives along the tangent at q."""
    found: list[Scalar] = []
    for joint, here, own in _coordinates(frames, q, gradient):
        for k in range(joint.nv):
            moved = joint.coordinate_rates(here, [1.0 if i == k else 0.0 for i in range(joint.nv)])
            found.append(inner_product(moved, own))
    return found


def _coordinates(
    frames: Sequence[Frame], q: Sequence[Scalar], other: Sequence[Scalar]
) -> Iterator[tuple[JointType, Sequence[Scalar], Sequence[Scalar]]]:
    """Joint by joint what two vectors of nq have of it."""
    used = 0
    for frame in leading(frames):
        part = slice(used, used + frame.joint.nq)
        yield frame.joint, q[part], other[part]
        used = part.stop


def _joints(
    frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar]
) -> Iterator[tuple[JointType, Sequence[Scalar], Sequence[Scalar]]]:
    """Each joint that has coordinates of its own, with these and its rates."""
    at, way = 0, 0
    for frame in leading(frames):
        joint = frame.joint
        yield joint, q[at : at + joint.nq], rates[way : way + joint.nv]
        at, way = at + joint.nq, way + joint.nv
