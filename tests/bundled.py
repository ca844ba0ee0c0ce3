"""The robots that come with psdmc, derived once for all tests of a process."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from psdmc.compiler import derive
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import LoadedRobot, load_robot

ROBOTS = Path(__file__).parent.parent / "examples" / "robots"


def robot_path(name: str) -> Path:
    """File of a bundled robot, by its stem."""
    return next(path for path in sorted(ROBOTS.iterdir()) if path.stem == name)


@cache
def bundled_robot(name: str) -> LoadedRobot:
    return load_robot(robot_path(name))


@cache
def bundled_model(name: str) -> DynamicsModel:
    return derive(robot_path(name))
