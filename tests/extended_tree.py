"""A URDF's dynamics with more digits than doubles have: the file's numbers as doubles, everything after in extended
precision, which is what rounding errors of 1e-13 are measured against.

Each body's motion in the root's axes about its centre of mass, projected by Jacobians (Kane): no code and no formula shared
with psdmc's recursions, nor with Pinocchio's. Joints that turn or slide, mimic joints, fixed links, a floating base.
"""

from __future__ import annotations

import xml.etree.ElementTree as xml
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

Array = np.ndarray
GRAVITY = 9.81
ROOT_Q, ROOT_V = 7, 6
"""Of a floating base: position and quaternion xyzw; linear and angular velocity along its own axes."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Of a frame or a body's centre, a row per state, in the root's axes (m, rad, s).

    turned    (count, 3, 3)        its axes
    at, v, a  (count, 3)           position, velocity and acceleration of its origin
    w, dw     (count, 3)           angular velocity and its rate
    linear    (count, 3, nv)       derivative of v by the rates
    angular   (count, 3, nv)       that of w
    """

    turned: Array
    at: Array
    v: Array
    a: Array
    w: Array
    dw: Array
    linear: Array
    angular: Array

    def moved(self, way: Array) -> Motion:
        """Of a point at `way` (count, 3) from this one on the same body."""
        spinning = np.cross(self.w, way)
        return replace(
            self,
            at=self.at + way,
            v=self.v + spinning,
            a=self.a + np.cross(self.dw, way) + np.cross(self.w, spinning),
            linear=self.linear + np.cross(self.angular, way[:, :, None], axis=1),
        )

    def placed(self, rotation: Array, translation: Array) -> Motion:
        there = self.moved(self.turned @ translation)
        return replace(there, turned=self.turned @ rotation)


@dataclass(frozen=True, eq=False)
class Body:
    """At one state each: kg, the motion of its centre of mass, and its inertia about that, kg m^2 in the root's axes."""

    mass: Array
    centre: Motion
    inertia: Array


class ExtendedTree:
    """order  names of the joints in the order in which states have the coordinates of those that follow no other, behind
    those of a floating base"""

    def __init__(self, text: str, order: Sequence[str], is_floating: bool = False) -> None:
        robot = xml.fromstring(text)
        self._links = {link.get("name"): link for link in robot.findall("link")}
        self._joints = {joint.get("name"): joint for joint in robot.findall("joint")}
        free = (name for name in order if self._joints[name].find("mimic") is None)
        self._order, self._first = list(free), ROOT_V if is_floating else 0
        self.is_floating, self.nv = is_floating, self._first + len(self._order)
        children = {_named(joint, "child") for joint in self._joints.values()}
        self._root = next(name for name in self._links if name not in children)

    def at(self, q: Array, v: Array, a: Array) -> Moving:
        """(count, nq), (count, nv) and (count, nv)."""
        return Moving(self, *(np.asarray(each, np.longdouble) for each in (q, v, a)))

    def bodies(self, q: Array, v: Array, a: Array) -> Iterator[Body]:
        waiting = [(self._root, self._rooted(q, v, a))]
        while waiting:
            link, motion = waiting.pop()
            if (inertial := self._links[link].find("inertial")) is not None:
                yield _body(inertial, motion)
            for joint in self._joints.values():
                if _named(joint, "parent") == link:
                    waiting.append((_named(joint, "child"), self._beyond(joint, motion, q, v, a)))

    def _rooted(self, q: Array, v: Array, a: Array) -> Motion:
        count = len(q)
        still, flat = np.zeros((count, 3), np.longdouble), np.zeros((count, 3, self.nv), np.longdouble)
        turned = np.broadcast_to(np.eye(3, dtype=np.longdouble), (count, 3, 3))
        if not self.is_floating:
            return Motion(turned, still, still, still, still, still, flat, flat)
        turned, linear, angular = _turned_by(q[:, 3:7]), flat.copy(), flat.copy()
        linear[:, :, :3], angular[:, :, 3:6] = turned, turned
        along = a[:, :3] + np.cross(v[:, 3:6], v[:, :3])
        own = (v[:, :3], along, v[:, 3:6], a[:, 3:6])
        return Motion(turned, q[:, :3], *(_times(turned, each) for each in own), linear, angular)

    def _beyond(self, joint: xml.Element, motion: Motion, q: Array, v: Array, a: Array) -> Motion:
        motion = motion.placed(*_origin(joint))
        kind, axis = joint.get("type"), _axis(joint)
        if kind == "fixed":
            return motion
        leader, ratio, offset = self._led(joint)
        k = self._first + leader
        angle = ratio * q[:, leader - len(self._order)] + offset
        rate, gain = ratio * v[:, k, None], ratio * a[:, k, None]
        along = motion.turned @ axis
        column = np.zeros_like(motion.linear)
        column[:, :, k] = ratio * along
        if kind == "prismatic":
            there = motion.moved(angle[:, None] * along)
            a_own = there.a + gain * along + 2.0 * np.cross(motion.w, rate * along)
            return replace(there, v=there.v + rate * along, a=a_own, linear=there.linear + column)
        return replace(
            motion,
            turned=motion.turned @ about(axis, angle),
            w=motion.w + rate * along,
            dw=motion.dw + gain * along + np.cross(motion.w, rate * along),
            angular=motion.angular + column,
        )

    def _led(self, joint: xml.Element) -> tuple[int, np.longdouble, np.longdouble]:
        """The joint whose coordinate this one follows, and by what."""
        ratio, offset = np.longdouble(1.0), np.longdouble(0.0)
        while (mimic := joint.find("mimic")) is not None:
            own = np.longdouble(float(mimic.get("multiplier", "1")))
            offset, ratio = offset + ratio * np.longdouble(float(mimic.get("offset", "0"))), ratio * own
            joint = self._joints[mimic.get("joint")]
        return self._order.index(str(joint.get("name"))), ratio, offset


class Moving:
    """A tree's dynamics at states."""

    def __init__(self, tree: ExtendedTree, q: Array, v: Array, a: Array) -> None:
        self.tree, self.q, self.v, self.a = tree, q, v, a

    @cached_property
    def bodies(self) -> list[Body]:
        """Those that some joint moves."""
        every = self.tree.bodies(self.q, self.v, self.a)
        return [body for body in every if body.centre.linear.any() or body.centre.angular.any()]

    @property
    def torques(self) -> Array:
        """(count, nv): M a + nonlinear effects, gravity along -z."""
        total = np.zeros_like(self.v)
        for body in self.bodies:
            at = body.centre
            force = body.mass * (at.a + np.array([0.0, 0.0, np.longdouble(GRAVITY)]))
            moment = _times(body.inertia, at.dw) + np.cross(at.w, _times(body.inertia, at.w))
            total += _back(at.linear, force) + _back(at.angular, moment)
        return total

    @property
    def mass_matrix(self) -> Array:
        """(count, nv, nv)."""
        return sum(
            body.mass * body.centre.linear.swapaxes(1, 2) @ body.centre.linear
            + body.centre.angular.swapaxes(1, 2) @ body.inertia @ body.centre.angular
            for body in self.bodies
        )

    @property
    def kinetic_energy(self) -> Array:
        """(count,) J."""
        return 0.5 * np.einsum("si,sij,sj->s", self.v, self.mass_matrix, self.v)

    @property
    def potential_energy(self) -> Array:
        """(count,) J, zero with all masses at the root's height."""
        return np.longdouble(GRAVITY) * sum(body.mass * body.centre.at[:, 2] for body in self.bodies)

    @property
    def centre_of_mass(self) -> Array:
        """(count, 3) m."""
        return sum(body.mass * body.centre.at for body in self.bodies) / sum(
            each.mass for each in self.bodies
        )

    @property
    def centroidal_momentum_matrix(self) -> Array:
        """(count, 6, nv): linear momentum and angular momentum about the centre of mass, in the root's (world's) axes."""
        centre = self.centre_of_mass
        linear = sum(body.mass * body.centre.linear for body in self.bodies)
        angular = sum(
            body.inertia @ body.centre.angular
            + np.cross((body.centre.at - centre)[:, :, None], body.mass * body.centre.linear, axis=1)
            for body in self.bodies
        )
        return np.concatenate([linear, angular], axis=1)


def _named(joint: xml.Element, role: str) -> str:
    return str(joint.find(role).get("link"))  # type: ignore[union-attr]


def _numbers(element: xml.Element | None, key: str, default: str = "0 0 0") -> Array:
    text = default if element is None else element.get(key, default)
    return np.array([float(word) for word in text.split()]).astype(np.longdouble)


def _axis(joint: xml.Element) -> Array:
    axis = _numbers(joint.find("axis"), "xyz", "1 0 0")
    return axis / np.sqrt(axis @ axis) if axis.any() else axis


def _origin(element: xml.Element) -> tuple[Array, Array]:
    """A rotation of three angles about fixed axes x, y, z, and a translation."""
    found, turned = element.find("origin"), np.eye(3, dtype=np.longdouble)
    for axis, angle in zip(np.eye(3), _numbers(found, "rpy"), strict=True):
        turned = about(axis, angle[None])[0] @ turned
    return turned, _numbers(found, "xyz")


def _body(inertial: xml.Element, motion: Motion) -> Body:
    place, tensor = _origin(inertial), inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (
        _numbers(tensor, f"i{key}", "0")[0] for key in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    centre = motion.placed(*place)
    mass = _numbers(inertial.find("mass"), "value", "0")[0]
    return Body(mass, centre, centre.turned @ own @ centre.turned.swapaxes(1, 2))


def about(axis: Array, angles: Array) -> Array:
    """(count, 3, 3) turns about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], np.longdouble)
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def _turned_by(quaternions: Array) -> Array:
    """(count, 3, 3) of quaternions xyzw, brought to length one."""
    x, y, z, w = (quaternions / np.sqrt((quaternions**2).sum(axis=1))[:, None]).T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return np.eye(3) + 2.0 * w[:, None, None] * cross + 2.0 * cross @ cross


def _times(matrices: Array, vectors: Array) -> Array:
    return (matrices @ vectors[:, :, None])[:, :, 0]


def _back(jacobians: Array, vectors: Array) -> Array:
    return (jacobians.swapaxes(1, 2) @ vectors[:, :, None])[:, :, 0]
