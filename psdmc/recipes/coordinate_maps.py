"""Matrices that convert changes of joint coordinates (such as quaternions) to joint rates (such as angular velocities)
and back, for k states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from psdmc.recipes.on_arrays import columns, matrix
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import Array


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateMaps:
    """Conversions between changes of coordinates and joint rates, for a sequence of joints. For k states, q is (k, nq)
    and qd is (k, nv); nq and nv are the numbers of coordinates and of rates."""

    joints: Sequence[JointType]

    def rates(self, q: Array) -> Array:
        """Return the matrices (k, nq, nv) that multiply joint rates qd to give the time derivatives of the coordinates
        q. A matrix depends on q."""
        parts = self._parts(q, None)
        return _diagonal(
            [_columns(partial(kind.coordinate_rates, own), kind.nv, len(q)) for kind, own, _ in parts]
        )

    def bent(self, q: Array, qd: Array) -> Array:
        """Return the derivatives (k, nq, nv) of the time derivative of q by small motions of the joints. The joint
        rates qd are fixed.

        The nv motions are along the directions of the joint rates; a quaternion moves by small rotations.
        """
        parts = self._parts(q, qd)
        return _diagonal(
            [_columns(partial(kind.rates_bent, own, way), kind.nv, len(q)) for kind, own, way in parts]
        )

    def tangents(self, q: Array) -> Array:
        """Return the matrices (k, nv, nq) that multiply changes of q to give the joint motions. Quaternions in q may
        have any length; the motion is that of the quaternion normalized to length one."""
        parts = self._parts(q, None)
        return _diagonal([_columns(partial(kind.tangent, own), kind.nq, len(q)) for kind, own, _ in parts])

    def restored(self, q: Array) -> Array:
        """Return q (k, nq) with the nearest valid coordinates. For example, quaternions get length one."""
        return columns([x for joint, own, _ in self._parts(q, None) for x in joint.restored(own)], len(q))

    def _parts(self, q: Array, qd: Array | None) -> Iterator[tuple[JointType, list[Array], list[Array]]]:
        at, way = 0, 0
        for joint in self.joints:
            rates = [] if qd is None else list(qd.T[way : way + joint.nv])
            yield joint, list(q.T[at : at + joint.nq]), rates
            at, way = at + joint.nq, way + joint.nv


def _columns(function: Callable[[list[float]], Sequence[Array]], width: int, count: int) -> Array:
    """(k, rows, width): the values of the unit vectors."""
    values = [function([float(i == j) for i in range(width)]) for j in range(width)]
    return matrix(values, count).transpose(0, 2, 1)


def _diagonal(blocks: Sequence[Array]) -> Array:
    rows, width = (sum(block.shape[axis] for block in blocks) for axis in (1, 2))
    whole, at, way = np.zeros((len(blocks[0]), rows, width)), 0, 0
    for block in blocks:
        whole[:, at : at + block.shape[1], way : way + block.shape[2]] = block
        at, way = at + block.shape[1], way + block.shape[2]
    return whole
