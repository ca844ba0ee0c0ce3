"""The robot of a seed: chains below FIRST_TREE, then trees, robots with contacts and loops from FIRST_CONTACTS on."""

from __future__ import annotations

from campaign_contacts import ContactRobot, random_contact_robot
from campaign_robots import RandomRobot, random_robot
from campaign_trees import random_tree

FIRST_TREE, FIRST_CONTACTS = 1_000_000, 2_000_000


def robot_of(seed: int) -> RandomRobot | ContactRobot:
    if seed >= FIRST_CONTACTS:
        return random_contact_robot(seed)
    return random_robot(seed) if seed < FIRST_TREE else random_tree(seed)


def described(robot: RandomRobot | ContactRobot) -> str:
    """In a line."""
    if isinstance(robot, ContactRobot):
        return robot.described
    tilts = f", tilts {min(robot.tilts):.1g} to {max(robot.tilts):.1g} rad" if robot.tilts else ""
    mixed = ", of many scales" if robot.is_mixed else ""
    mimic = f", {len(robot.mimics)} of them mimic joints" if robot.mimics else ""
    options = "".join(f", {name} {value}" for name, value in robot.options.items())
    return f"{len(robot.joints)} joints{mimic}, {robot.style}{tilts}{mixed}{options}"
