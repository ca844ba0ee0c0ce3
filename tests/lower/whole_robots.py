"""Whole robots of others, on a floating base or branched, with functions lowered once for all tests."""

from __future__ import annotations

from functools import cache

from lowered import lowered as lowered_once
from pinocchio_robots import PinocchioRobot, robot_at_hand

from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.kernel import Kernel

FUNCTIONS = (
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "nonlinear_effects",
    "gravity",
    "regressor",
    "jacobian",
    "kinetic_energy",
    "potential_energy",
    "momentum",
    "com_jacobian",
    "centre_of_mass",
    "centroidal_momentum_matrix",
    "mass_matrix_inverse",
)
COUNTED = FUNCTIONS[:3]
"""All that is asked of the larger quadruped."""

ROBOTS = [("anymal_b", True), ("solo12", True), ("allegro", False)]
"""Of two quadrupeds the larger one is slow: its torques, accelerations and operations."""
WHOLE = ROBOTS[1:]


@cache
def derived(name: str, floating: bool) -> tuple[PinocchioRobot, DynamicsModel]:
    robot = robot_at_hand(name, floating)
    return robot, derive_model(robot.mechanism, expand=False)


@cache
def lowered(name: str, floating: bool) -> dict[str, Kernel]:
    functions = FUNCTIONS if (name, floating) in WHOLE else COUNTED
    return lowered_once(derived(name, floating)[1], "factored", functions, theta_variants=False)
