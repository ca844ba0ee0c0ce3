"""The root link of a URDF on a free joint: a robot that stands, walks, swims or flies."""

from __future__ import annotations

from dataclasses import replace

from psdmc.robot.joints import FREE
from psdmc.robot.mechanism import Limits
from psdmc.robot.names import free_name
from psdmc.robot.urdf import Origin, UrdfJoint, UrdfRobot

ROOT_JOINT = "root_joint"
"""Pinocchio's name of the free joint; more underscores follow where a joint of the file is called so."""

WORLD = "universe"
"""Pinocchio's name of what the free joint hangs on; more underscores follow where a link of the file is called so."""


def on_free_root(robot: UrdfRobot) -> UrdfRobot:
    """The robot with its root link on a free joint, whose frames are the world's and the root link's own."""
    name = free_name(ROOT_JOINT, {joint.name for joint in robot.joints})
    world = free_name(WORLD, set(robot.inertials))
    free = UrdfJoint(
        name=name,
        type=FREE.urdf_words[0],
        parent=world,
        child=robot.root,
        origin=Origin(),
        axis=(0.0, 0.0, 1.0),
        limits=Limits(),
        mimic=None,
        has_dynamics=False,
    )
    return replace(
        robot,
        root=world,
        inertials={world: None, **robot.inertials},
        joints=(free, *robot.joints),
        free_root=name,
    )
