"""The robot as psdmc sees it: a serial chain of one-axis joints, each turning or sliding along its own z."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.robot.small import times

Array = NDArray[np.float64]
JointKind = Literal["revolute", "prismatic"]

PARAMETER_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz", "Im")
"""Standard parameters of one link, in the order of x; about the link frame, Im the joint's drive inertia."""

PARAMETERS_PER_LINK = len(PARAMETER_NAMES)


def frozen_array(values: object, shape: tuple[int, ...], what: str) -> Array:
    """A private read-only float64 copy of `values`; ValueError where its shape is another."""
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{what} has shape {array.shape}, expected {shape}")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Where a frame sits in another: x_outer = rotation @ x_inner + translation.

    rotation     (3, 3)  orthonormal
    translation  (3,)    m
    """

    rotation: Array
    translation: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen_array(self.rotation, (3, 3), "rotation"))
        object.__setattr__(self, "translation", frozen_array(self.translation, (3,), "translation"))

    @staticmethod
    def identity() -> Placement:
        return Placement(np.eye(3), np.zeros(3))

    def __matmul__(self, inner: Placement) -> Placement:
        translation = times(self.rotation, inner.translation) + self.translation
        return Placement(times(self.rotation, inner.rotation), translation)

    def inverse(self) -> Placement:
        return Placement(self.rotation.T, -times(self.rotation.T, self.translation))


@dataclass(frozen=True, slots=True)
class Limits:
    """A joint's limits in SI units (rad or m and their rates, N m or N); infinite where the file gives none."""

    lower: float = -math.inf
    upper: float = math.inf
    speed: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """One movable joint and the link that it carries.

    The joint frame F is psdmc's own: its z is the joint's axis, it turns (or slides) with the link. At q = 0 it sits
    at `placement` in the previous joint frame (the first: in the chain's base frame), so that
    F_prev -> F  is  placement @ Rz(q)  (revolute)  or  placement @ Tz(q)  (prismatic).
    The link frame is the file's (URDF child link frame, DH distal frame), `link_frame` its constant placement in F.
    """

    name: str
    link_name: str
    kind: JointKind
    placement: Placement
    link_frame: Placement
    limits: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """A serial robot: kinematics, gravity and what is known of its inertia. n joints.

    joints           n, from base to tip
    parameters       (n, 11)   standard parameters x about the link frames (PARAMETER_NAMES), SI; NaN where unknown
    parameter_span   (11 n, k) columns span the parameters that the assumptions allow (assume-zero, no drive inertia,
                               links without inertia), in reduced column echelon form: each column leads with a one,
                               in a row where all others are zero
    gravity          (3,)      m/s^2, acceleration of gravity in the base frame
    tip              tip frame in the last joint frame
    notes            what was snapped, merged, locked, assumed or found odd, one sentence each, for `show`
    """

    name: str
    convention: Literal["urdf", "standard", "modified"]
    base_name: str
    tip_name: str
    joints: tuple[Joint, ...]
    parameters: Array
    parameter_span: Array
    gravity: Array
    tip: Placement
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.joints)
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(
            self, "parameters", frozen_array(self.parameters, (n, PARAMETERS_PER_LINK), "parameters")
        )
        span = np.asarray(self.parameter_span)
        expected = (PARAMETERS_PER_LINK * n, span.shape[-1])
        object.__setattr__(self, "parameter_span", frozen_array(span, expected, "parameter_span"))
        object.__setattr__(self, "gravity", frozen_array(self.gravity, (3,), "gravity"))
        object.__setattr__(self, "notes", tuple(self.notes))

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def is_revolute(self) -> tuple[bool, ...]:
        return tuple(joint.kind == "revolute" for joint in self.joints)

    def __len__(self) -> int:
        return len(self.joints)


def parameter_names(link_names: Sequence[str]) -> tuple[str, ...]:
    """Names of x, link by link: 'link:mx' and so on."""
    return tuple(f"{link}:{name}" for link in link_names for name in PARAMETER_NAMES)
