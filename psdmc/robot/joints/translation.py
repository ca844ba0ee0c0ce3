"""The translation joint, which moves along all three axes and never turns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from psdmc.robot.joints.joint_type import SLIDES, Scalar, Twist, Vector, WideJoint


class Translation(WideJoint):
    """The translation joint; q is the position (x, y, z), m."""

    __slots__ = ()

    word: ClassVar[str] = "translation"
    urdf_words: ClassVar[tuple[str, ...]] = ()
    nq: ClassVar[int] = 3
    nv: ClassVar[int] = 3
    coordinates: ClassVar[str] = "q: x y z (m); rates: velocity (m/s); efforts: force (N)"
    q_names: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    v_names: ClassVar[tuple[str, ...]] = ("vx", "vy", "vz")
    neutral: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0)
    twists: ClassVar[tuple[Twist, ...]] = SLIDES
    verb: ClassVar[str] = "goes along every axis"
    pinocchio: ClassVar[str] = "Translation"
    mujoco: ClassVar[str] = "none"

    def displacement(self, q: Sequence[Scalar]) -> Vector:
        return (q[0], q[1], q[2])


TRANSLATION = Translation()
