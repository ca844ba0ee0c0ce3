"""The robot of a seed: chains below FIRST_TREE, trees from there on."""

from __future__ import annotations

from campaign_robots import RandomRobot, random_robot
from campaign_trees import random_tree

FIRST_TREE = 1_000_000


def robot_of(seed: int) -> RandomRobot:
    return random_robot(seed) if seed < FIRST_TREE else random_tree(seed)


def described(robot: RandomRobot) -> str:
    """In a line."""
    tilts = f", tilts {min(robot.tilts):.1g} to {max(robot.tilts):.1g} rad" if robot.tilts else ""
    mixed = ", of many scales" if robot.is_mixed else ""
    mimic = f", {len(robot.follows)} of them mimic joints" if robot.follows else ""
    options = "".join(f", {name} {value}" for name, value in robot.options.items())
    return f"{len(robot.joints)} joints{mimic}, {robot.style}{tilts}{mixed}{options}"
