"""A joint that goes along every axis and never turns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from psdmc.robot.joints.basis import NO_BASIS, Basis
from psdmc.robot.joints.joint_type import JointType, Scalar, Twist, Vector


class Translation(JointType):
    """q is the position, m."""

    __slots__ = ()

    word: ClassVar[str] = "translation"
    urdf_words: ClassVar[tuple[str, ...]] = ()
    nq: ClassVar[int] = 3
    nv: ClassVar[int] = 3
    coordinates: ClassVar[str] = "q: x y z (m); rates: velocity (m/s); efforts: force (N)"
    neutral: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0)
    about_z: ClassVar[bool] = False
    twists: ClassVar[tuple[Twist, ...]] = (
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((0.0, 1.0, 0.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
    )
    basis: ClassVar[Basis] = NO_BASIS
    length_order: ClassVar[int] = 1
    position_unit: ClassVar[str] = "m"
    effort_unit: ClassVar[str] = "N"
    free_range: ClassVar[float] = 1.0
    ordinary: ClassVar[tuple[float, float, float]] = (1.0, 1.0, 10.0)
    verb: ClassVar[str] = "goes along every axis"
    pinocchio: ClassVar[str] = "Translation"
    mujoco: ClassVar[str] = "none"

    def way(self, q: Sequence[Scalar]) -> Vector:
        return (q[0], q[1], q[2])


TRANSLATION = Translation()
