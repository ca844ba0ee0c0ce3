"""Converts derivatives by the entries of q to derivatives along joint rates (the tangent), on arrays of JAX, PyTorch or
NumPy. The two differ if q contains quaternions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import Mechanism

Array = Any
"""An array of the framework's, with leading axes (...) for states."""

ON_COORDINATES = {"integrate": "integrated", "difference": "difference"}
"""Functions that JAX and PyTorch compute themselves, so that they differentiate them as often as wanted, and the methods of
Coordinates that compute them."""


@dataclass(frozen=True, slots=True)
class Coordinates:
    """Conversions between derivatives by the nq entries of q and derivatives along the nv joint rates (the tangent),
    for one robot.

    The arrays of a call have the shapes (..., nq) or (..., nv), with equal leading axes.

    arrays  the library: jax.numpy, torch or numpy
    joints  types of the joints, without mimic joints
    """

    arrays: Any
    joints: tuple[JointType, ...]
    _runs: tuple[tuple[JointType, int], ...] = field(init=False)
    """Joints, and how many of one coordinate follow one another; made once, as PyTorch's compiler cannot follow groupby."""

    def __post_init__(self) -> None:
        runs: list[tuple[JointType, int]] = []
        for is_plain, joints in groupby(self.joints, lambda joint: joint.about_z):
            own = tuple(joints)
            runs += [(own[0], len(own))] if is_plain else [(joint, 1) for joint in own]
        object.__setattr__(self, "_runs", tuple(runs))

    @classmethod
    def of(cls, mechanism: Mechanism, arrays: Any) -> Coordinates:
        """Return a robot's Coordinates (conversions between q's entries and rates), for joints that do not mimic."""
        return cls(arrays, tuple(mechanism.joints[i].type for i in mechanism.own_joints))

    @property
    def are_plain(self) -> bool:
        """Whether every joint has one coordinate, so that q's entries are the nv joint coordinates themselves."""
        return all(joint.about_z for joint in self.joints)

    def normalized(self, q: Array) -> Array:
        """Return q with quaternions and pairs of cosine and sine normalized; NaN if one is zero."""
        return self._made([joint.restored(here) for joint, here in self._parts(q)], q)

    def tangent(self, q: Array, moved: Array) -> Array:
        """Return the displacements (..., nv), one per rate, for a small change `moved` (..., nq) of q's entries."""
        return self._made([joint.tangent(here, own) for joint, here, own in self._pairs(q, moved)], q)

    def gradient(self, q: Array, by_tangent: Array) -> Array:
        """Return the gradient (..., nq) by q's entries, from that by displacements, `by_tangent` (..., nv)."""
        found = []
        for joint, here, own in self._pairs(q, by_tangent, rates=True):
            for k in range(joint.nq):
                moved = [1.0 if i == k else 0.0 for i in range(joint.nq)]
                found.append([_inner(joint.tangent(here, moved), own)])
        return self._made(found, q)

    def rates(self, q: Array, v: Array) -> Array:
        """Return the rates of change (..., nq) of q's entries at rates v (..., nv). Quaternions must have length one."""
        return self._made(
            [j.coordinate_rates(here, own) for j, here, own in self._pairs(q, v, rates=True)], q
        )

    def pulled_back(self, q: Array, gradient: Array) -> Array:
        """Return the gradient (..., nv) by displacements, one per rate, from that (..., nq) by q's entries."""
        found = []
        for joint, here, own in self._pairs(q, gradient):
            for k in range(joint.nv):
                rates = [1.0 if i == k else 0.0 for i in range(joint.nv)]
                found.append([_inner(joint.coordinate_rates(here, rates), own)])
        return self._made(found, q)

    def integrated(self, q: Array, v: Array) -> Array:
        """Return q after one second at the constant rates v, like the generated function `integrate`."""
        return self._made([j.integrated(here, own) for j, here, own in self._pairs(q, v, rates=True)], q)

    def difference(self, q0: Array, q1: Array) -> Array:
        """Return the constant rates that lead from q0 to q1 in one second, like the generated function `difference`."""
        return self._made([joint.difference(here, there) for joint, here, there in self._pairs(q0, q1)], q0)

    def _parts(self, values: Array, rates: bool = False) -> Iterator[tuple[JointType, list[_Entry]]]:
        """Joint by joint the entries that belong to it, (..., 1) each. Joints of one coordinate in a row come together, as
        one joint whose entry is (..., k)."""
        at = 0
        for joint, together in self._runs:
            count = together if joint.about_z else joint.nv if rates else joint.nq
            size = together if joint.about_z else 1
            yield joint, [_Entry(values[..., k : k + size], self.arrays) for k in range(at, at + count, size)]
            at += count

    def _pairs(self, q: Array, other: Array, rates: bool = False) -> Iterator[tuple[JointType, Any, Any]]:
        parts = zip(self._parts(q), self._parts(other, rates), strict=True)
        return ((joint, here, own) for (joint, here), (_, own) in parts)

    def _made(self, parts: Sequence[Sequence[Any]], like: Array) -> Array:
        """The entries as the last axis of one array."""
        zero = self.arrays.zeros_like(like[..., :1])
        values = [x.value if isinstance(x, _Entry) else zero + x for part in parts for x in part]
        return self.arrays.concatenate(values, -1)


def _inner(a: Sequence[Any], b: Sequence[Any]) -> Any:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """Entries of q or of a tangent, (..., k), as the abstract scalar that joint types compute with."""

    value: Array
    arrays: Any

    def root(self) -> _Entry:
        return _Entry(self.arrays.sqrt(self.value), self.arrays)

    def sincos(self) -> tuple[_Entry, _Entry]:
        sine, cosine = self.arrays.sin(self.value), self.arrays.cos(self.value)
        return _Entry(sine, self.arrays), _Entry(cosine, self.arrays)

    def __add__(self, other: Any) -> _Entry:
        return _Entry(self.value + _plain(other), self.arrays)

    def __sub__(self, other: Any) -> _Entry:
        return _Entry(self.value - _plain(other), self.arrays)

    def __rsub__(self, other: Any) -> _Entry:
        return _Entry(_plain(other) - self.value, self.arrays)

    def __mul__(self, other: Any) -> _Entry:
        return _Entry(self.value * _plain(other), self.arrays)

    def __truediv__(self, other: Any) -> _Entry:
        return _Entry(self.value / _plain(other), self.arrays)

    def __rtruediv__(self, other: Any) -> _Entry:
        return _Entry(_plain(other) / self.value, self.arrays)

    def __neg__(self) -> _Entry:
        return _Entry(-self.value, self.arrays)

    __radd__, __rmul__ = __add__, __mul__


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, _Entry) else value
