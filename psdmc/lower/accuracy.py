"""The torque errors of generated code with certain link frames, nonzero link parameters and recursion options, relative
to the model's torques. These choices together are called an arrangement.

On robots of many scales, some choices lose digits. An example is a robot on which parameters of 100 kg also represent a
mass of 1 g at 1 um from a joint axis. The torque of this mass is below the last digit of the large parameters.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from psdmc.functions import inverse_dynamics
from psdmc.lower.factored import Arrangement, RobotConstants, trace_dynamics
from psdmc.model import evaluate
from psdmc.model.random_states import states_of
from psdmc.program.interpret import interpret
from psdmc.program.program import Program
from psdmc.recipes.recipe import Polynomials, Recipe
from psdmc.robot.mechanism import Array

STATES, SEED = 32, 20_260_417

LIMIT = 5e-13
"""Error of an arrangement, or of an expanded PROGRAM, that may be taken: half of 1e-12, as these states are few. Robots of
one scale have 1e-16 to 1e-13."""

LEAST_INERTIA = 1e-20
"""Share of the mass matrix's largest entry below which a row is rounding of a joint that moves nothing."""

WRONG = 1e-8
"""Error that no rounding makes: an arrangement of another robot. The largest seen of robots that are admitted is 1e-10."""


class Accuracy:
    """Computes the errors that rounding causes in the code of one model, as relative errors of joint torques.

    The code is given as a PROGRAM (list of operations), or as an arrangement: a choice of link frames, nonzero link
    parameters and options of the recursion. For most arrangements, the error is that of the code for inverse dynamics,
    because other functions contain the same operations.

    robot    the model, with the base parameters if the code contains them as numbers
    theta_b  (l,) values of the base parameters, for which the errors are computed
    """

    def __init__(self, robot: RobotConstants, theta_b: Array) -> None:
        self.robot, self.theta_b = robot, theta_b
        vectors = states_of(robot.chain, np.random.default_rng(SEED), STATES)
        self._states = dict(zip(("q", "qd", "qdd"), vectors, strict=True))

    def error(self, arrangement: Arrangement, recipe: Recipe = inverse_dynamics.RECIPE) -> float:
        """Return the error of a function's code, as `error_of` does. The code follows from an arrangement: a choice of link
        frames, nonzero link parameters and options of the recursion.

        For the mass matrix, the error of the matrix is returned, because its entries may be small compared with gravity
        torques. For all other functions, the error of inverse dynamics in this arrangement is returned.
        """
        if recipe.polynomials is not Polynomials.MASS:
            recipe = inverse_dynamics.RECIPE
        return self.error_of(recipe, trace_dynamics(recipe, arrangement, self.robot))

    def error_of(self, recipe: Recipe, program: Program) -> float:
        """Return the largest difference between a PROGRAM's outputs and reference values at random states. The
        reference is the Newton-Euler or composite-body algorithm in the link frames of the robot file.

        The difference is one of torques, relative to the joint's largest torque. Differences of accelerations are
        multiplied by the mass matrix first. For the mass matrix, the difference is relative to the row's largest entry.
        If the largest torque or entry is zero, the difference is absolute.
        """
        signature, part = recipe.signature, recipe.polynomials
        given = self._states | {"tau": self._torques, "theta_b": self.theta_b}
        with np.errstate(all="ignore"):  # accelerations of a mass matrix that has no inverse
            found = interpret(program, given, signature.sizes(self.robot.sizes))[signature.outputs[0].name]
        count, nv = self._torques.shape
        if part is Polynomials.MASS:
            least = LEAST_INERTIA * float(self._mass.max(initial=0.0))
            return _relative(found.reshape(count, nv, nv) - self._mass, self._mass, least)
        if part is Polynomials.SOLVED:
            lacking = np.einsum("sij,sj->si", self._mass, found - self._states["qdd"])
        elif part is Polynomials.REGRESSOR:
            lacking = found.reshape(count, nv, -1) @ self.theta_b - self._torques
        else:
            lacking = found - self._part(part)
        return _relative(lacking, self._torques)

    def _part(self, part: Polynomials | None) -> Array:
        """The torques without what a function leaves out."""
        q, qd, qdd = self._states.values()
        if part is Polynomials.BIAS:
            return self._newton_euler(q, qd, 0.0 * qdd)
        return self._newton_euler(q, 0.0 * qd, 0.0 * qdd) if part is Polynomials.GRAVITY else self._torques

    def _newton_euler(self, *states: Array) -> Array:
        return evaluate.torques(self.robot.chain, self._parameters, list(states))

    @cached_property
    def _parameters(self) -> Array:
        return np.asarray(self.robot.representative @ self.theta_b)

    @cached_property
    def _torques(self) -> Array:
        return self._newton_euler(*self._states.values())

    @cached_property
    def _mass(self) -> Array:
        return evaluate.mass_matrix(self.robot.chain, self._parameters, self._states["q"])


def _relative(difference: Array, whole: Array, least: float = 0.0) -> float:
    """Largest difference of a joint's or a row's entries, relative to the largest of them, or to `least` where they are
    smaller; absolute where both are zero."""
    others = tuple(axis for axis in range(whole.ndim) if axis != 1)
    largest = np.maximum(np.abs(whole).max(axis=others), least)
    return float(np.max(np.abs(difference).max(axis=others) / np.where(largest > 0, largest, 1.0)))
