"""Joint types: one file each, and the table of them."""

from __future__ import annotations

from psdmc.robot.joints.joint_type import JointType, Twist
from psdmc.robot.joints.prismatic import PRISMATIC
from psdmc.robot.joints.revolute import REVOLUTE

__all__ = ["JOINT_TYPES", "PRISMATIC", "REVOLUTE", "URDF_TYPES", "JointType", "Twist", "joint_type"]

JOINT_TYPES: dict[str, JointType] = {kind.word: kind for kind in (REVOLUTE, PRISMATIC)}
"""By the word of robot files and model files."""

URDF_TYPES: dict[str, JointType] = {word: kind for kind in JOINT_TYPES.values() for word in kind.urdf_words}
"""By the type of a URDF's <joint>."""


def joint_type(word: str) -> JointType:
    """The type of that word; ValueError where there is none."""
    if word not in JOINT_TYPES:
        raise ValueError(f"joint kind {word!r}")
    return JOINT_TYPES[word]
