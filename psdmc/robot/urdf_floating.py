"""The root link of a URDF on a free joint: a robot that stands, walks, swims or flies."""

from __future__ import annotations

from dataclasses import replace

from psdmc.errors import InputError
from psdmc.robot.joints import FREE
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Limits
from psdmc.robot.urdf import Origin, UrdfJoint, UrdfRobot

ROOT_JOINT = "root_joint"
"""Pinocchio's name of the free joint."""

WORLD = "universe"
"""Pinocchio's name of what the free joint hangs on; more underscores follow where a link of the file is called so."""


def on_free_root(robot: UrdfRobot, source: str) -> UrdfRobot:
    """The robot with its root link on a free joint ROOT_JOINT, whose frames are the world's and the root link's own.

    InputError where a joint of the file is called so.
    """
    if any(joint.name == ROOT_JOINT for joint in robot.joints):
        raise InputError(
            f"{source}: joint {shown(ROOT_JOINT)} of the file has the name of the joint that --floating adds",
            "give the file's joint another name",
        )
    world = WORLD
    while world in robot.inertials:
        world += "_"
    free = UrdfJoint(
        name=ROOT_JOINT,
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
        free_root=ROOT_JOINT,
    )
