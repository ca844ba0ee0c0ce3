"""How exactly an arrangement gives a model's torques. On robots of many scales, frames on other feet and other carriers
lose digits: a gram at a micrometre is moved by what a hundred kilograms leave beyond the last one."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from psdmc.functions import inverse_dynamics
from psdmc.lower.factored import Arrangement, RobotConstants, trace_dynamics
from psdmc.model import recursive
from psdmc.model.random_states import states_of
from psdmc.program.interpret import interpret
from psdmc.robot.mechanism import Array

STATES, SEED = 32, 20_260_417

LIMIT = 2e-12
"""Error of an arrangement that may be taken: a fifth of what is promised, as these states are few. Robots of one scale
have 1e-16 to 1e-13."""

WRONG = 1e-8
"""Error that no rounding makes: an arrangement of another robot. The largest seen of robots that are admitted is 1e-10."""


class Accuracy:
    """Errors of a model's arrangements, by inverse dynamics: it runs the arithmetic of all other functions.

    robot    constants of the traces, with theta_b or with theta_b as an input
    theta_b  (l,)
    """

    def __init__(self, robot: RobotConstants, theta_b: Array) -> None:
        self.robot, self.theta_b = robot, theta_b
        vectors = states_of(robot.chain, np.random.default_rng(SEED), STATES)
        self._states = dict(zip(("q", "qd", "qdd"), vectors, strict=True))

    def error(self, arrangement: Arrangement) -> float:
        """Largest difference from Newton-Euler about the file's link frames, relative to the joint's largest torque;
        absolute, in N m or N, where that is zero."""
        recipe = inverse_dynamics.RECIPE
        program = trace_dynamics(recipe, arrangement, self.robot)
        sizes = recipe.signature.sizes(self.robot.sizes)
        found = interpret(program, self._states | {"theta_b": self.theta_b}, sizes)["tau"]
        largest = np.abs(self._torques).max(axis=0)
        return float(np.max(np.abs(found - self._torques) / np.where(largest > 0, largest, 1.0)))

    @cached_property
    def _torques(self) -> Array:
        parameters = self.robot.representative @ self.theta_b
        return recursive.torques(self.robot.chain, parameters, list(self._states.values()))
