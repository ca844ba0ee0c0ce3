"""The spherical (ball) joint, which turns about every axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from psdmc.robot.joints.joint_type import TURNS, Rows, Scalar, Twist, WideJoint
from psdmc.robot.joints.quaternion import (
    angles_between,
    rates_bent,
    rates_of,
    rotation_of,
    turned_by,
    turning,
)
from psdmc.robot.joints.scalars import unit


class Spherical(WideJoint):
    """The spherical joint: q is a unit quaternion (x, y, z, w), rates are about the moved frame's axes, rad/s."""

    __slots__ = ()

    word: ClassVar[str] = "spherical"
    urdf_words: ClassVar[tuple[str, ...]] = ()
    nq: ClassVar[int] = 4
    nv: ClassVar[int] = 3
    coordinates: ClassVar[str] = (
        "q: unit quaternion x y z w"
        "; rates: angular velocity (rad/s) along its own axes"
        "; efforts: moment (N m)"
    )
    q_names: ClassVar[tuple[str, ...]] = ("qx", "qy", "qz", "qw")
    v_names: ClassVar[tuple[str, ...]] = ("wx", "wy", "wz")
    neutral: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0, 1.0)
    unit: ClassVar[slice] = slice(0, 4)
    twists: ClassVar[tuple[Twist, ...]] = TURNS
    length_order: ClassVar[int] = 0
    position_unit: ClassVar[str] = "1"
    effort_unit: ClassVar[str] = "N m"
    ordinary: ClassVar[tuple[float, float, float]] = (math.pi, 3.0, 15.0)
    verb: ClassVar[str] = "turns about every axis"
    pinocchio: ClassVar[str] = "Spherical"
    mujoco: ClassVar[str] = "ball"

    def rotation(self, q: Sequence[Scalar]) -> Rows:
        return rotation_of(q)

    def integrated(self, q: Sequence[Scalar], step: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return turned_by(unit(q), step)[0]

    def difference(self, q: Sequence[Scalar], other: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return angles_between(q, other)[0]

    def coordinate_rates(self, q: Sequence[Scalar], rates: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return rates_of(q, rates)

    def rates_bent(
        self, q: Sequence[Scalar], rates: Sequence[Scalar], motion: Sequence[Scalar]
    ) -> tuple[Scalar, ...]:
        return rates_bent(q, rates, motion)

    def tangent(self, q: Sequence[Scalar], moved: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return turning(q, moved)


SPHERICAL = Spherical()
