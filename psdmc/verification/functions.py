"""Compares generated functions with Pinocchio. It covers those functions that are not written as torque polynomials;
check.py compares the others. The functions are computed by their NumPy references."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import lack_of_standard_parameters
from psdmc.model.random_states import near_closed, on_joints
from psdmc.program.signature import Q_GUESS, TAU, Q, Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.packed import VALUES, unpacked
from psdmc.recipes.recipe import Needs, Recipe
from psdmc.reproducible import in_any_order
from psdmc.robot.mechanism import Array
from psdmc.robot.reference import OnCoordinates

STATES = 100
SEED = 14_631

FEW, SLOW = (
    8,
    (
        "second_derivatives",
        "rk4_step_derivatives",
        "with_wrenches_",
        "constrained_forward_dynamics_",
        "impulse_",
    ),
)
"""States of functions with such words in their names: second derivatives, whose expected values are differences of
Pinocchio's derivatives; derivatives of Runge-Kutta steps, which call those of forward dynamics four times; and derivatives
under wrenches and with contacts, which share the recursion of those without."""

MOST_RATES = 24
"""Joint rates up to which second derivatives are compared: each rate takes 2 to 8 calls of Pinocchio's derivatives."""

NOTHING = 1e-9
"""Values below this share of the largest torque (N m, N) and of one (m, J, kg m/s) are compared on that scale: a robot
on which gravity acts along no joint has a potential energy of rounding alone."""

ROUNDING = 1e-12
"""An output below this share of its function's largest one is rounding, such as the change of a single joint's
acceleration with its rate."""
ROUNDED = 1e-4
"""Share of that largest output, on whose scale such an output is compared: 1e-10 of it is 1e-14 of the largest."""


class _Remembering(RobotOnArrays):
    """A robot that computes mass matrices and derivatives of torques once for the same states, as most functions need
    them."""

    @cached_property
    def _known(self) -> dict[tuple[bytes, ...], Any]:
        return {}

    def torque_derivatives(
        self, q: Array, qd: Array, qdd: Array, external: Mapping[int, Wrench] = NO_WRENCHES
    ) -> tuple[Array, Array, Array]:
        loads = (np.append(link, np.ravel(wrench)) for link, wrench in sorted(external.items()))
        key = tuple(array.tobytes() for array in (q, qd, qdd, *loads))
        if key not in self._known:
            self._known[key] = super().torque_derivatives(q, qd, qdd, external)
        found: tuple[Array, Array, Array] = self._known[key]
        return found

    def mass_matrix(self, q: Array) -> Array:
        key = (q.tobytes(),)
        if key not in self._known:
            self._known[key] = super().mass_matrix(q)
        found: Array = self._known[key]
        return found


def function_errors(
    model: DynamicsModel, theta: Array, robot: OnCoordinates, solvable: bool
) -> Iterator[tuple[Recipe, float, str]]:
    """Yield the results of the comparison of each function that is not written as torque polynomials. A result is the
    function's recipe, the largest error, and the reason if the function was not compared.

    The error is relative to the largest value of each output.

    solvable  whether the mass matrix can be inverted
    """
    arrays = _Remembering.of(model, theta)
    # States and all else that functions read, (STATES, ...) each.
    rng = np.random.default_rng(SEED)
    chain = model.mechanism
    sizes = Sizes(
        model.n,
        model.nq,
        model.nv,
        model.l,
        len(chain.frames),
        rows_of_contacts=chain.rows_of_contacts,
        rows_of_loops=chain.rows_of_loops,
    )
    read = {q.name: q for recipe in RECIPES.values() for q in recipe.signature.inputs if q != Q_GUESS}
    given = {q.name: q.drawn(rng.uniform(-1.0, 1.0, (STATES, *sizes.shape(q.axes)))) for q in read.values()}
    given |= {q.name: on_joints(model.mechanism, given[q.name]) for q in read.values() if q.axes == Q.axes}
    if chain.passive_rates:
        given[Q_GUESS.name] = near_closed(chain, np.random.default_rng(SEED), STATES)
    given[TAU.name] = robot.inverse_dynamics(given["q"], given["qd"], given["qdd"])
    few = {name: values[:FEW] for name, values in given.items()}
    least = NOTHING * max(1.0, float(np.abs(given[TAU.name]).max(initial=0.0)))
    for recipe in RECIPES.values():
        if recipe.polynomials is not None or recipe.lack_of_loops(chain):
            continue
        lack = _lacking(model, recipe, robot, solvable)
        states = few if any(word in recipe.signature.name for word in SLOW) else given
        yield (
            recipe,
            np.nan if lack else _error(recipe, arrays, robot, states, theta, least),
            lack or "",
        )


def _lacking(model: DynamicsModel, recipe: Recipe, robot: OnCoordinates, solvable: bool) -> str | None:
    """Why the model has no such function, or Pinocchio none of this robot; None where both have."""
    if recipe.needs is Needs.STANDARD:
        return lack_of_standard_parameters(model)
    if recipe.needs is Needs.POSITIVE_MASS and not solvable:
        return "the mass matrix is singular"
    if "second_derivatives" in recipe.signature.name and model.nv > MOST_RATES:
        return f"differences of Pinocchio's derivatives take long with more than {MOST_RATES} joint rates"
    # From positions to positions, or to the way between them.
    places = not recipe.signature.theta and all(
        q.axes in (("nq",), ("nv",), ("nv", "nq")) for q in recipe.signature.outputs
    )
    if robot.follows and places:
        return "Pinocchio's positions are of every joint, followers included"
    if recipe.needs is Needs.POSITIVE_MASS and robot.follows:
        return "Pinocchio solves no robots with mimic joints"
    return None


def _error(
    recipe: Recipe,
    arrays: RobotOnArrays,
    robot: OnCoordinates,
    given: Mapping[str, Array],
    theta: Array,
    least: float,
) -> float:
    with in_any_order():
        found = recipe.reference(arrays, given)
    if recipe.packs is not None:
        packing, recipe = recipe.packs, RECIPES[recipe.packs.function]
        found = unpacked(packing, recipe, arrays, found[VALUES.name])
    with in_any_order():
        expected = _expected(recipe, robot, given)
    if recipe.times_theta:
        found = {name: values @ theta for name, values in found.items()}
    if recipe.gradient is not None:
        found |= {recipe.gradient: found[recipe.gradient] @ theta}
    largest = {name: float(np.abs(values).max(initial=0.0)) for name, values in expected.items()}
    most = max(*largest.values(), _most_beside(recipe, robot, given))
    return max(
        float(np.abs(found[name] - values).max(initial=0.0)) / max(_scale(largest[name], most), least)
        for name, values in expected.items()
    )


def _expected(recipe: Recipe, robot: OnCoordinates, given: Mapping[str, Array]) -> Mapping[str, Array]:
    """Pinocchio's values; of a robot whose joints follow others from every joint's own, summed along the axes of rates."""
    if not robot.follows:
        return recipe.pinocchio(robot.free, given)
    joints = dict(given)
    for quantity in recipe.signature.inputs:
        if quantity.axes in (("nq",), ("nv",)):
            move = robot.following.positions if quantity.name == Q.name else robot.following.rates
            joints[quantity.name] = move(given[quantity.name])
    axes = {quantity.name: quantity.axes for quantity in recipe.signature.outputs}
    if recipe.times_theta:
        axes = dict.fromkeys(axes, ("nv",))
    return {
        name: _summed(robot, values, axes.get(name, ()))
        for name, values in recipe.pinocchio(robot.free, joints).items()
    }


def _summed(robot: OnCoordinates, values: Array, axes: Sequence[str]) -> Array:
    for k, axis in enumerate(axes):
        if axis in ("nq", "nv"):
            values = robot.following.summed(values, k - len(axes))
        elif axis == "nxa":
            parts = np.split(values, 3, axis=k - len(axes))
            values = np.concatenate([robot.following.summed(x, k - len(axes)) for x in parts], k - len(axes))
    return values


def _most_beside(recipe: Recipe, robot: OnCoordinates, given: Mapping[str, Array]) -> float:
    """The largest value of the function that this one's values are differences of; zero where there is none."""
    if recipe.beside is None:
        return 0.0
    values = _expected(RECIPES[recipe.beside], robot, given).values()
    return max(float(np.abs(value).max(initial=0.0)) for value in values)


def _scale(largest: float, most: float) -> float:
    """The scale for comparing an output with this largest value; `most` is the function's, relative to which small
    outputs are rounding."""
    return largest if largest > ROUNDING * most else ROUNDED * most
