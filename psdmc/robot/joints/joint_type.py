"""What a joint type is: everything that any stage needs to know about the way a joint moves.

A new type is one file beside this one and a line in the table of types (__init__.py). Code outside this folder never
distinguishes types; it uses the properties below.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from psdmc.robot.joints.basis import Basis
from psdmc.robot.placement import Placement

Scalar = Any
"""A float, an array of states, or a symbol."""

Twist = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Linear velocity of a frame's origin and angular velocity, along the frame's own axes."""


class JointType(ABC):
    """One way to move: a turn about z, a slide along z, or both in a fixed ratio.

    word           in robot files, model files and tables
    urdf_words     types of a URDF's <joint> that move so
    nq, nv         numbers of coordinates and of rates
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
    nq: ClassVar[int] = 1
    nv: ClassVar[int] = 1
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

    @abstractmethod
    def turn(self, x: Scalar) -> Scalar | None:
        """Angle about z at coordinate x, or its rate or acceleration at that of x (all are linear); None: it never
        turns."""

    @abstractmethod
    def slide(self, x: Scalar) -> Scalar | None:
        """Displacement along z in m at coordinate x, or its rate or acceleration; None: it never slides."""

    def transform(self, q: float) -> Placement:
        """The moved joint frame in the one at q = 0."""
        angle, way = self.turn(q), self.slide(q)
        c, s = (1.0, 0.0) if angle is None else (math.cos(angle), math.sin(angle))
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Placement(rotation, np.array([0.0, 0.0, 0.0 if way is None else way]))

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
