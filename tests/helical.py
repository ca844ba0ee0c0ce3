"""A joint type that psdmc does not have, in one file: a screw about z. What runs on it asks no joint what kind it is."""

from __future__ import annotations

from typing import ClassVar

from psdmc.robot.joints.basis import POLYNOMIAL, TRIGONOMETRIC, Basis
from psdmc.robot.joints.joint_type import JointType, Scalar, Twist

PITCH = 0.3
"""m per rad."""


class Helical(JointType):
    """q is the angle about z, rad; the joint advances PITCH q along it."""

    __slots__ = ()

    word: ClassVar[str] = "helical"
    urdf_words: ClassVar[tuple[str, ...]] = ()
    twists: ClassVar[tuple[Twist, ...]] = (((0.0, 0.0, PITCH), (0.0, 0.0, 1.0)),)
    basis: ClassVar[Basis] = Basis(
        (*TRIGONOMETRIC.exponents[:3], *POLYNOMIAL.exponents[1:2]),
        4,
        (*TRIGONOMETRIC.derivatives[:3], ((0, 1.0),)),
        (0.0, 1.0, 2.0, 3.0),
    )
    length_order: ClassVar[int] = 0
    position_unit: ClassVar[str] = "rad"
    effort_unit: ClassVar[str] = "N m"
    free_range: ClassVar[float] = 1.0
    ordinary: ClassVar[tuple[float, float, float]] = (1.0, 1.0, 1.0)
    verb: ClassVar[str] = "screws"
    pinocchio: ClassVar[str] = "HZ"
    mujoco: ClassVar[str] = "none"

    def turn(self, x: Scalar) -> Scalar:
        return x

    def slide(self, x: Scalar) -> Scalar:
        return x * PITCH


HELICAL = Helical()
