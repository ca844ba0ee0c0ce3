"""The revolute joint, which turns about the z axis of the joint frame."""

from __future__ import annotations

import math
from typing import ClassVar

from psdmc.robot.joints.basis import TRIGONOMETRIC, Basis
from psdmc.robot.joints.joint_type import TURNS, JointType, Scalar, Twist


class Revolute(JointType):
    """The revolute joint; q is the angle about z, rad."""

    __slots__ = ()

    word: ClassVar[str] = "revolute"
    urdf_words: ClassVar[tuple[str, ...]] = ("revolute", "continuous")
    twists: ClassVar[tuple[Twist, ...]] = (TURNS[2],)
    basis: ClassVar[Basis] = TRIGONOMETRIC
    length_order: ClassVar[int] = 0
    position_unit: ClassVar[str] = "rad"
    effort_unit: ClassVar[str] = "N m"
    free_range: ClassVar[float] = math.pi
    ordinary: ClassVar[tuple[float, float, float]] = (math.radians(170.0), 3.0, 15.0)
    verb: ClassVar[str] = "turns"
    pinocchio: ClassVar[str] = "RZ"
    mujoco: ClassVar[str] = "hinge"

    def turn(self, x: Scalar) -> Scalar:
        return x

    def slide(self, x: Scalar) -> None:
        return None


REVOLUTE = Revolute()
