"""A tool frame, given by numbers in the tip frame."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.robot.mechanism import NamedFrame, Placement
from psdmc.robot.urdf import Origin
from psdmc.robot.urdf_bodies import placement_of

TOOL = "tool"
"""Name of the frame."""


def tool_in_tip(tool: Sequence[float]) -> Placement:
    """x y z (m) and roll pitch yaw (rad, about fixed axes x, y, z in turn, as in URDF), with noise of zeros removed."""
    x, y, z, roll, pitch, yaw = tool
    return placement_of(Origin(xyz=(x, y, z), rpy=(roll, pitch, yaw)))


def tool_frame(tip: NamedFrame, tool: Sequence[float]) -> NamedFrame:
    """The frame 'tool', given by x y z (m), roll pitch yaw (rad) in the tip's."""
    return NamedFrame(TOOL, tip.joint, tip.placement @ tool_in_tip(tool))
