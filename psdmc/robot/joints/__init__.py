"""The joint types that psdmc supports: one file for each type, and the table of all types."""

from __future__ import annotations

from psdmc.robot.joints.free import FREE
from psdmc.robot.joints.joint_type import JointType, Twist
from psdmc.robot.joints.planar import PLANAR
from psdmc.robot.joints.prismatic import PRISMATIC
from psdmc.robot.joints.revolute import REVOLUTE
from psdmc.robot.joints.spherical import SPHERICAL
from psdmc.robot.joints.translation import TRANSLATION

__all__ = [
    "FREE",
    "JOINT_TYPES",
    "PLANAR",
    "PRISMATIC",
    "REVOLUTE",
    "SPHERICAL",
    "TRANSLATION",
    "URDF_TYPES",
    "WIDE_TYPES",
    "JointType",
    "Twist",
    "joint_type",
]

JOINT_TYPES: dict[str, JointType] = {kind.word: kind for kind in (REVOLUTE, PRISMATIC)}
"""Of one coordinate, by their word in robot files and model files."""

WIDE_TYPES: dict[str, JointType] = {kind.word: kind for kind in (FREE, SPHERICAL, PLANAR, TRANSLATION)}
"""Of several coordinates, by their word in model files."""

URDF_TYPES: dict[str, JointType] = {
    word: kind for kind in (JOINT_TYPES | WIDE_TYPES).values() for word in kind.urdf_words
}
"""By the type of a URDF's <joint>."""


def joint_type(word: str) -> JointType:
    """Return the joint type with this name, such as 'revolute'. Raises ValueError if no type has this name."""
    known = JOINT_TYPES | WIDE_TYPES
    if word not in known:
        raise ValueError(f"joint kind {word!r}")
    return known[word]
