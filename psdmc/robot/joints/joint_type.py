"""The class JointType, which describes how a joint moves. All stages of psdmc use the properties of this class.

To add a joint type, add a file to this folder and a line to the table of types (__init__.py). Code outside this folder
does not distinguish joint types.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from psdmc.reproducible import cosine, sine
from psdmc.robot.joints.basis import NO_BASIS, Basis
from psdmc.robot.joints.scalars import Scalar as Scalar
from psdmc.robot.joints.scalars import unit
from psdmc.robot.placement import Array, Placement

Twist = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Linear velocity of a frame's origin and angular velocity, along the frame's own axes."""

SLIDES: tuple[Twist, Twist, Twist] = (
    ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((0.0, 1.0, 0.0), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
)
"""Along x, y and z."""

TURNS: tuple[Twist, Twist, Twist] = (
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
)
"""About x, y and z."""

Vector = tuple[Scalar, Scalar, Scalar]
Rows = tuple[Vector, Vector, Vector]


class JointType:
    """One type of joint. If `about_z` is true, it turns about z, slides along z, or does both in a fixed ratio, by one
    coordinate. Else it has several coordinates, and the functions `rotation` and `displacement` give the placement of the
    moved frame. Rates are along the axes of the moved frame.

    word           name in robot files, model files and tables
    urdf_words     types of a URDF's <joint> that move like this; the last one is for joints without position limits
    follows_axis   True: the z axis of the joint frame is a URDF's <axis>; False: the joint frame is the child link's
    only_axis      the only direction that a URDF's <axis> may have, in the child link; None: any
    nq, nv         numbers of coordinates and of rates
    coordinates    description of q and the rates in words, if there are several
    q_names        names of the nq coordinates, if there are several
    v_names        names of the nv rates, if there are several
    neutral        the nq coordinates at which the frame has not moved
    unit           slice of the coordinates whose length must be one: a quaternion, or a cosine and a sine
    about_z        whether one coordinate moves the joint about and along z
    twists         nv pairs (the motion subspace): linear and angular velocity of the joint frame at a rate of one
    basis          functions of q of which the joint's transform consists
    length_order   exponent of the metre in the unit of the coordinate: 0 for an angle
    position_unit  unit of q
    effort_unit    unit of the joint's torque or force
    free_range     range of q for a joint without limits, plus or minus, in the unit of q
    ordinary       largest position, rate and acceleration of this type of joint in an ordinary arm
    verb           the verb for the motion in sentences about the joint
    pinocchio      short name of Pinocchio's joint model: JointModel...
    mujoco         MuJoCo's name of the joint type
    """

    __slots__ = ()

    word: ClassVar[str]
    urdf_words: ClassVar[tuple[str, ...]]
    follows_axis: ClassVar[bool] = True
    only_axis: ClassVar[tuple[float, float, float] | None] = None
    nq: ClassVar[int] = 1
    nv: ClassVar[int] = 1
    coordinates: ClassVar[str] = ""
    q_names: ClassVar[tuple[str, ...]] = ()
    v_names: ClassVar[tuple[str, ...]] = ()
    neutral: ClassVar[tuple[float, ...]] = (0.0,)
    unit: ClassVar[slice] = slice(0, 0)
    about_z: ClassVar[bool] = True
    twists: ClassVar[tuple[Twist, ...]]
    basis: ClassVar[Basis]
    length_order: ClassVar[int]
    position_unit: ClassVar[str]
    effort_unit: ClassVar[str]
    free_range: ClassVar[float]
    ordinary: ClassVar[tuple[float, float, float]]
    verb: ClassVar[str]
    pinocchio: ClassVar[str]
    mujoco: ClassVar[str]

    def turn(self, x: Scalar) -> Scalar | None:
        """Return the angle about z at coordinate x. Return None if the joint never turns.

        The angle is proportional to x, so the function also converts rates and accelerations.
        """
        return None

    def slide(self, x: Scalar) -> Scalar | None:
        """Return the displacement along z in m at coordinate x. Return None if the joint never slides.

        The displacement is proportional to x, so the function also converts rates and accelerations.
        """
        return None

    def rotation(self, q: Sequence[Scalar]) -> Rows | None:
        """Return the rotation matrix of the joint frame at nq coordinates, relative to the frame at the neutral
        position. Return None if the joint never turns, or turns about z (see `turn`)."""
        return None

    def displacement(self, q: Sequence[Scalar]) -> Vector | None:
        """Return the displacement of the joint frame's origin at nq coordinates, in m, relative to the neutral
        position. Return None if the origin stays, or moves along z (see `slide`)."""
        return None

    def transform(self, q: float | Sequence[float]) -> Placement:
        """Return the placement of the joint frame at the position q, relative to the frame at the neutral position; q
        is a number, or nq numbers."""
        values = [float(x) for x in np.atleast_1d(q)]
        if not self.about_z:
            rows, moved = self.rotation(values), self.displacement(values)
            return Placement(
                np.eye(3) if rows is None else np.array(rows),
                np.zeros(3) if moved is None else np.array(moved),
            )
        angle, height = self.turn(values[0]), self.slide(values[0])
        c, s = (1.0, 0.0) if angle is None else (cosine(angle), sine(angle))
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Placement(rotation, np.array([0.0, 0.0, 0.0 if height is None else height]))

    def restored(self, q: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return the valid coordinates nearest to q: quaternions, and pairs of cosine and sine, get length one."""
        part = self.unit
        return (*q[: part.start], *unit(q[part]), *q[part.stop :]) if part.stop else tuple(q)

    def normalized(self, q: Array) -> Array:
        """Return coordinates (nq, ...) with quaternions and pairs of length one, in the precision of q."""
        return np.stack(self.restored(list(q)))

    def integrated(self, q: Sequence[Scalar], step: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return the nq coordinates after a motion of one second at the nv constant rates `step`. Quaternions in the
        result have length one."""
        return tuple(here + change for here, change in zip(q, step, strict=True))

    def difference(self, q: Sequence[Scalar], other: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return the nv constant rates from q to `other` in one second, with a rotation of at most half a turn."""
        return tuple(there - here for here, there in zip(q, other, strict=True))

    def coordinate_rates(self, q: Sequence[Scalar], rates: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return the time derivatives of the nq coordinates at given joint rates (nv). They are linear in the rates."""
        return tuple(rates)

    def rates_bent(
        self, q: Sequence[Scalar], rates: Sequence[Scalar], motion: Sequence[Scalar]
    ) -> tuple[Scalar, ...]:
        """Return how fast the result of `coordinate_rates`, at constant `rates`, changes while q moves at the nv joint
        rates `motion`. These are second derivatives of the coordinates."""
        return (0.0,) * self.nq

    def tangent(self, q: Sequence[Scalar], moved: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return the nv joint rates at which the joint moves while the nq coordinates change at the rates `moved`.
        Quaternions in q may have any length; the motion is that of the quaternion normalized to length one."""
        return tuple(moved)

    @property
    def hidden(self) -> int:
        """Return how many inertial parameters of the joint's body have the effect of parameters of the body before the
        joint. They cannot be identified separately.

        In terms of 4 x 4 pseudo-inertias, this is k (k + 1) / 2. Here k is the dimension of the common null space of
        the joint's twists, written as 4 x 4 matrices.
        """
        k = 4 - int(np.linalg.matrix_rank(np.vstack([_generator(twist) for twist in self.twists])))
        return k * (k + 1) // 2

    @property
    def q_orders(self) -> tuple[int, ...]:
        """Return the exponent of the metre in the unit of each coordinate: 0 for an angle, 1 for a length."""
        part = range(self.unit.start, self.unit.stop)
        return tuple(0 if k in part else self.length_order for k in range(self.nq))

    @property
    def v_orders(self) -> tuple[int, ...]:
        """Return the exponent of the metre in each rate's unit: 0 for an angular, 1 for a linear velocity."""
        return tuple(0 if any(angular) else 1 for _, angular in self.twists)

    @property
    def has_length(self) -> bool:
        """Return whether the joint type itself contains a length in m, such as the pitch of a screw."""
        return any(any(linear) and any(angular) for linear, angular in self.twists)

    @property
    def comes_round(self) -> bool:
        """Return whether q and q plus a full turn are the same position, as for a revolute joint."""
        return self.basis.has_sincos and not any(power for power, _, _ in self.basis.exponents)

    @property
    def effort_order(self) -> int:
        """Return the exponent of the metre in the unit of the joint's effort: 2 for a torque, 1 for a force."""
        return 2 - self.length_order

    @property
    def drive_order(self) -> int:
        """Return the exponent of the metre in the unit of the drive inertia, effort per acceleration."""
        return self.effort_order - self.length_order

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other)

    def __hash__(self) -> int:
        return hash(self.word)

    def __repr__(self) -> str:
        return f"<joint type {self.word}>"


def _generator(twist: Twist) -> Array:
    """(4, 4) velocity of a point (x, y, z, 1) at a unit rate."""
    linear, (x, y, z) = twist
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    matrix[:3, 3] = linear
    return matrix


class WideJoint(JointType):
    """A joint with several coordinates, most of them lengths, such as a floating base. It has no drive inertia, and
    psdmc does not write its torques as expanded polynomials."""

    __slots__ = ()

    about_z: ClassVar[bool] = False
    follows_axis: ClassVar[bool] = False
    basis: ClassVar[Basis] = NO_BASIS
    length_order: ClassVar[int] = 1
    position_unit: ClassVar[str] = "m"
    effort_unit: ClassVar[str] = "N"
    free_range: ClassVar[float] = 1.0
    ordinary: ClassVar[tuple[float, float, float]] = (1.0, 1.0, 10.0)
