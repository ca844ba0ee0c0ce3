"""Computes the position after motion at constant joint rates, and the constant rates between two positions.

The values can be numbers or symbols. If a joint has several coordinates, such as a quaternion, its nq coordinates q
must satisfy a condition: the length of a quaternion is one. Its rates, fewer in number (nv), are along the axes of the
frame that the joint moves.
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
    """Return the changes per second of the nq coordinates q, such as quaternions, at nv joint rates `rates`."""
    return [x for joint, here, own in _joints(frames, q, rates) for x in joint.coordinate_rates(here, own)]


def rates_bent(
    frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar], way: Sequence[Scalar]
) -> list[Scalar]:
    """Return the changes per second (nq) of the result of `coordinate_rates` at constant joint rates, while q moves.

    rates  (nv) the constant joint rates
    way    (nv) joint rates at which q moves
    """
    both = zip(_joints(frames, q, rates), _joints(frames, q, way), strict=True)
    return [x for (joint, here, own), (_, _, moved) in both for x in joint.rates_bent(here, own, moved)]


def tangent(frames: Sequence[Frame], q: Sequence[Scalar], moved: Sequence[Scalar]) -> list[Scalar]:
    """Return the nv joint rates that correspond to given changes per second of the nq coordinates q.

    Quaternions in q may have any length. Their coordinates are scaled to length one before the rates are computed.

    moved  (nq) changes per second of the coordinates
    """
    return [x for joint, here, own in _coordinates(frames, q, moved) for x in joint.tangent(here, own)]


def restored(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[Scalar]:
    """Return the nearest positions that the joints can have; for example, quaternions get length one."""
    return [x for joint, here, _ in _joints(frames, q, ()) for x in joint.restored(here)]


def pulled_back(frames: Sequence[Frame], q: Sequence[Scalar], gradient: Sequence[Scalar]) -> list[Scalar]:
    """Return the nv derivatives of a quantity by motion at the joint rates, from its nq derivatives by the coordinates
    q."""
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
