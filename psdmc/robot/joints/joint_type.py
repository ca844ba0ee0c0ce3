"""Joint types: everything that a stage needs to know about how a joint moves.

A new type is one file beside this one and a line in the table of types (__init__.py). Code outside this folder never
distinguishes types; it uses the properties below.
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
    """One way to move: a turn about z, a slide along z, or both in a fixed ratio; or, where not `about_z`, by several
    coordinates, from which `rotation` and `way` give the frame's place. Rates are along the moved frame's own axes.

    word           in robot files, model files and tables
    urdf_words     types of a URDF's <joint> that move so, the last for one without position limits
    follows_axis   whether its frame's z is along a URDF's <axis>; else its frame is the child link's
    only_axis      the only direction that a URDF's <axis> may have, in the child link; None: any
    nq, nv         numbers of coordinates and of rates
    coordinates    what q and its rates are, in words, where there are several
    q_names        nq names of its coordinates, and
    v_names        nv names of its rates, where there are several
    neutral        nq coordinates at which the frame has not moved
    unit           those of its coordinates whose length must be one: a quaternion's, or a cosine and a sine
    about_z        whether it is moved about and along z by one coordinate
    twists         nv of them, the motion subspace: the joint frame's velocity per unit rate, along its own axes
    basis          the factors in q that its transform is made of
    length_order   exponent of the metre in the coordinate: 0 for an angle
    position_unit  unit of q
    effort_unit    unit of the joint's torque or force
    free_range     range of q for a joint without limits, plus or minus, in the unit of q
    ordinary       largest position, rate and acceleration of an ordinary arm's joint
    verb           the verb for its motion, for sentences about it
    pinocchio      Pinocchio's short name of it: JointModel...
    mujoco         MuJoCo's word for it
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
        """Angle about z at coordinate x, or its rate or acceleration at that of x (all are linear); None: it never
        turns."""
        return None

    def slide(self, x: Scalar) -> Scalar | None:
        """Displacement along z in m at coordinate x, or its rate or acceleration; None: it never slides."""
        return None

    def rotation(self, q: Sequence[Scalar]) -> Rows | None:
        """The moved frame's axes as columns in the one that has not moved, from nq coordinates; None: it never turns, or by
        `turn`."""
        return None

    def way(self, q: Sequence[Scalar]) -> Vector | None:
        """The moved frame's origin in the one that has not moved, m; None: it stays, or goes along z by `slide`."""
        return None

    def transform(self, q: float | Sequence[float]) -> Placement:
        """The moved joint frame in the one that has not moved; q: a number, or nq of them."""
        values = [float(x) for x in np.atleast_1d(q)]
        if not self.about_z:
            rows, moved = self.rotation(values), self.way(values)
            return Placement(
                np.eye(3) if rows is None else np.array(rows),
                np.zeros(3) if moved is None else np.array(moved),
            )
        angle, way = self.turn(values[0]), self.slide(values[0])
        c, s = (1.0, 0.0) if angle is None else (cosine(angle), sine(angle))
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Placement(rotation, np.array([0.0, 0.0, 0.0 if way is None else way]))

    def restored(self, q: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """The coordinates nearest to q that are the joint's: quaternions of length one and so on."""
        part = self.unit
        return (*q[: part.start], *unit(q[part]), *q[part.stop :]) if part.stop else tuple(q)

    def normalized(self, q: Array) -> Array:
        """Normalize an array (nq, ...) in its precision."""
        return np.stack(self.restored(list(q)))

    def integrated(self, q: Sequence[Scalar], step: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """nq coordinates where a joint at q comes that moves at constant rates for one second by nv of `step`; what must be
        of length one is made so."""
        return tuple(here + way for here, way in zip(q, step, strict=True))

    def difference(self, q: Sequence[Scalar], other: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """The nv constant rates that bring a joint from q to `other` in one second, the short way round."""
        return tuple(there - here for here, there in zip(q, other, strict=True))

    def coordinate_rates(self, q: Sequence[Scalar], rates: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """How the nq coordinates change per second at nv rates; linear in these."""
        return tuple(rates)

    def rates_bent(
        self, q: Sequence[Scalar], rates: Sequence[Scalar], way: Sequence[Scalar]
    ) -> tuple[Scalar, ...]:
        """How `coordinate_rates` at fixed rates change per second while q moves at nv rates of `way`."""
        return (0.0,) * self.nq

    def tangent(self, q: Sequence[Scalar], moved: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """The nv rates at which `restored(q)` moves where the coordinates q, of any length, move by nq of `moved` per
        second."""
        return tuple(moved)

    @property
    def hidden(self) -> int:
        """How many inertial parameters of its body the joint cannot tell from those of the body before it.

        They are the pseudo-inertias in the common null space of its twists as 4 x 4 matrices: k (k + 1) / 2 of k dimensions.
        """
        k = 4 - int(np.linalg.matrix_rank(np.vstack([_generator(twist) for twist in self.twists])))
        return k * (k + 1) // 2

    @property
    def q_orders(self) -> tuple[int, ...]:
        """Exponent of the metre in each coordinate."""
        part = range(self.unit.start, self.unit.stop)
        return tuple(0 if k in part else self.length_order for k in range(self.nq))

    @property
    def v_orders(self) -> tuple[int, ...]:
        """Exponent of the metre in each rate."""
        return tuple(0 if any(angular) else 1 for _, angular in self.twists)

    @property
    def has_length(self) -> bool:
        """Whether the type itself contains a length in m, such as the pitch of a screw."""
        return any(any(linear) and any(angular) for linear, angular in self.twists)

    @property
    def comes_round(self) -> bool:
        """Whether q and q plus a whole turn are the same position."""
        return self.basis.has_sincos and not any(power for power, _, _ in self.basis.exponents)

    @property
    def effort_order(self) -> int:
        """Exponent of metre in the unit of its effort: power is effort times rate."""
        return 2 - self.length_order

    @property
    def drive_order(self) -> int:
        """Exponent of metre in the unit of its drive inertia: effort per acceleration."""
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
    """A joint of several coordinates, most of them lengths: no drive turns it, and its torques are not expanded."""

    __slots__ = ()

    about_z: ClassVar[bool] = False
    follows_axis: ClassVar[bool] = False
    basis: ClassVar[Basis] = NO_BASIS
    length_order: ClassVar[int] = 1
    position_unit: ClassVar[str] = "m"
    effort_unit: ClassVar[str] = "N"
    free_range: ClassVar[float] = 1.0
    ordinary: ClassVar[tuple[float, float, float]] = (1.0, 1.0, 10.0)
