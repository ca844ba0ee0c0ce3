"""The data that reading a robot file gives, before psdmc applies assumptions such as assume_zero."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from psdmc.robot.coordinates import Coordinate
from psdmc.robot.mechanism import BASE as ON_BASE
from psdmc.robot.mechanism import Array, Joint, NamedFrame, Placement


@dataclass(frozen=True, slots=True)
class Snap:
    """Records that a rotation of the robot file was replaced by a near one with exact zeros (snapped). `angle` is the
    angle between both, rad; `where` names the rotation.

    segment   number of the joint that the rotation comes before: 0 for the first joint, and so on. n is between the
              last link and the tip, BASE between the root and the base
    """

    where: str
    angle: float
    segment: int


BASE = -1
"""Segment of the rotation that turns gravity with the base."""


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """A robot with n joints as its file states it.

    parameters     n arrays (11,), about the link frames; NaN if unknown; the drive inertia Im is 0 if the file gives
                   none
    zeros          n tuples of names that the file states to be zero (psdmc.robot.inertia.ZERO_NAMES)
    drives         n flags: the file makes this joint's drive inertia a parameter
    gravity        (3,) m/s^2 in the base frame
    frames         named frames; empty: the tip alone
    massless       moving links without inertia in the file, which psdmc treats as massless
    loops          tables of closed loops in the file
    frame_of       returns the frame of a link by its name, with the joint BASE if the link is fixed to the base
    parents, tip_body, coordinates   as in Mechanism; left out: those of a serial chain without mimic joints
    """

    name: str
    convention: Literal["urdf", "standard", "modified"]
    base_name: str
    tip_name: str
    joints: tuple[Joint, ...]
    parameters: tuple[Array, ...]
    zeros: tuple[tuple[str, ...], ...]
    drives: tuple[bool, ...]
    gravity: Array
    tip: Placement
    snaps: tuple[Snap, ...]
    notes: tuple[str, ...]
    frames: tuple[NamedFrame, ...] = ()
    parents: tuple[int, ...] = ()
    tip_body: int = ON_BASE
    coordinates: tuple[Coordinate, ...] = ()
    massless: tuple[str, ...] = ()
    loops: tuple[Any, ...] = ()
    frame_of: Callable[[str], NamedFrame] | None = None

    @property
    def tip_frame(self) -> NamedFrame:
        body = len(self.joints) - 1 if self.tip_body == ON_BASE else self.tip_body
        return NamedFrame(self.tip_name, body, self.tip)
