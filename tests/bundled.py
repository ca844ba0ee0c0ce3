"""The robots that come with psdmc, derived once for all tests of a process."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from psdmc.compiler import derive
from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import LoadedRobot, load_robot
from psdmc.robot.reference import Reference

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


@cache
def weighed_model(name: str) -> DynamicsModel:
    """Return the model of a bundled robot for functions with gravity as an input."""
    return derive_model(bundled_robot(name).mechanism, gravity_input=True)


def under_gravity(robot: Reference, gravity: object) -> Reference:
    """Return a robot in Pinocchio, whose model has another gravity, (3,)."""
    model = robot.model.copy()
    model.gravity.linear = np.array(gravity)
    return replace(robot, model=model)
