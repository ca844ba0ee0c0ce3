"""The prismatic joint, which slides along the z axis of the joint frame."""

from __future__ import annotations

from typing import ClassVar

from psdmc.robot.joints.basis import POLYNOMIAL, Basis
from psdmc.robot.joints.joint_type import SLIDES, JointType, Scalar, Twist


class Prismatic(JointType):
    """The prismatic joint; q is the displacement along z, m."""

    __slots__ = ()

    word: ClassVar[str] = "prismatic"
    urdf_words: ClassVar[tuple[str, ...]] = ("prismatic",)
    twists: ClassVar[tuple[Twist, ...]] = (SLIDES[2],)
    basis: ClassVar[Basis] = POLYNOMIAL
    length_order: ClassVar[int] = 1
    position_unit: ClassVar[str] = "m"
    effort_unit: ClassVar[str] = "N"
    free_range: ClassVar[float] = 1.0
    ordinary: ClassVar[tuple[float, float, float]] = (0.3, 0.5, 3.0)
    verb: ClassVar[str] = "slides"
    pinocchio: ClassVar[str] = "PZ"
    mujoco: ClassVar[str] = "slide"

    def turn(self, x: Scalar) -> None:
        return None

    def slide(self, x: Scalar) -> Scalar:
        return x


PRISMATIC = Prismatic()
