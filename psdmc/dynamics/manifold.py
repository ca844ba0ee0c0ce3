"""Position after constant rates for a time, and the rates between two positions: joint by joint, over abstract scalars.

q ranges over a manifold where joints have several coordinates: a quaternion stays on its sphere. Tangents are rates, nv
of them, along each moved frame's own axes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.slices import leading
from psdmc.dynamics.solve import inner_product
from psdmc.robot.joints import JointType


def integrated(frames: Sequence[Frame], q: Sequence[Scalar], step: Sequence[Scalar]) -> list[Scalar]:
    """nq coordinates where constant rates lead from q in a second; `step` are nv of them."""
    return [x for joint, here, way in _joints(frames, q, step) for x in joint.integrated(here, way)]


def difference(frames: Sequence[Frame], q: Sequence[Scalar], other: Sequence[Scalar]) -> list[Scalar]:
    """nv constant rates that lead from q to `other` in a second, the short way round."""
    return [x for joint, here, there in _coordinates(frames, q, other) for x in joint.difference(here, there)]


def coordinate_rates(frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Scalar]:
    """How the nq coordinates change per second at these nv rates."""
    return [x for joint, here, own in _joints(frames, q, rates) for x in joint.coordinate_rates(here, own)]


def rates_bent(
    frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar], way: Sequence[Scalar]
) -> list[Scalar]:
    """How `coordinate_rates` change per second while q moves at nv rates of `way`."""
    both = zip(_joints(frames, q, rates), _joints(frames, q, way), strict=True)
    return [x for (joint, here, own), (_, _, moved) in both for x in joint.rates_bent(here, own, moved)]


def tangent(frames: Sequence[Frame], q: Sequence[Scalar], moved: Sequence[Scalar]) -> list[Scalar]:
    """nv rates at which `restored(q)` moves while coordinates q, of any length, move by nq of `moved` per second."""
    return [x for joint, here, own in _coordinates(frames, q, moved) for x in joint.tangent(here, own)]


def restored(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[Scalar]:
    """The nearest positions that the joints can have: quaternions of length one and so on."""
    return [x for joint, here, _ in _joints(frames, q, ()) for x in joint.restored(here)]


def pulled_back(frames: Sequence[Frame], q: Sequence[Scalar], gradient: Sequence[Scalar]) -> list[Scalar]:
    """nv derivatives by the tangent at q of what has these nq derivatives by the coordinates."""
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
