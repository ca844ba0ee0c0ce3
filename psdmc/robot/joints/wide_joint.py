"""Common parts of joints with several coordinates."""

from __future__ import annotations

from typing import ClassVar

from psdmc.robot.joints.basis import NO_BASIS, Basis
from psdmc.robot.joints.joint_type import JointType


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
