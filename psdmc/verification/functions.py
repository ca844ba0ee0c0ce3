"""Compares generated functions with Pinocchio. It covers those functions that are not written as torque polynomials;
check.py compares the others. The functions are computed by their NumPy references."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import lack_of_standard_parameters
from psdmc.model.random_states import near_closed, on_joints
from psdmc.program.signature import Q_GUESS, TAU, Q, Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import VALUES, Needs, Recipe, unpacked
from psdmc.reproducible import in_any_order
from psdmc.robot.mechanism import Array
from psdmc.robot.reference import OnCoordinates

STATES = 100
SEED = 14_631

TORQUE_LIMIT = 1e-10
"""Largest relative error that passes: a hundred times what rounding leaves, a million times less than any mistake."""

CONDITION_LIMIT = 1e-12
"""Forward dynamics passes within this times the mass matrix's condition number, and always within TORQUE_LIMIT."""

SINGULAR = 1e15
"""Condition number from which a mass matrix cannot be inverted: that of a last link without inertia, for example."""

LAST, DRAWS, TIMES = 2.0**-52, 8, 10.0
"""An error beyond its limit passes within TIMES the change of Pinocchio's values if LAST, the last digit, of the joints'
placements changes, the largest of DRAWS random changes. The rotations of doubles are orthonormal to the last digit only.
Pinocchio computes along the base's axes, so this changes its values by as many digits as they cancel: ten, at a mimic
joint of ratio 1,500 that turns a link of 0.1 m about its centre at 4,500 rad/s."""

LARGEST_LIMIT = 1e-6
"""If that change allows larger errors, a function is not compared: the limit would come near to the size of mistakes."""

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


class Compared(NamedTuple):
    """The result of the comparison of a function with Pinocchio.

    error   largest error, relative to the largest value of each output; NaN if the function was not compared
    limit   largest error that passes; None if the function was not compared
    remark  why the function was not compared, or what the limit allows for
    """

    recipe: Recipe
    error: float
    limit: float | None
    remark: str = ""


def solved_limit(condition: float) -> float:
    """Return the limit for functions that divide by the mass matrix, which lose digits with its condition number."""
    return max(TORQUE_LIMIT, CONDITION_LIMIT * condition)


def function_errors(
    model: DynamicsModel, theta: Array, robot: OnCoordinates, condition: float
) -> Iterator[Compared]:
    """Yield the results of the comparison of each function that is not written as torque polynomials.

    condition  largest condition number of the mass matrix
    """
    arrays = _Remembering.of(model, theta)
    # States and all else that functions read, (STATES, ...) each.
    rng = np.random.default_rng(SEED)
    chain = model.mechanism
    sizes = Sizes.of(chain, model.l)
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
        lack = _lacking(model, recipe, robot, condition < SINGULAR)
        if lack:
            yield Compared(recipe, np.nan, None, f"not compared: {lack}")
            continue
        states = few if any(word in recipe.signature.name for word in SLOW) else given
        errors, scales = _errors(recipe, arrays, robot, states, theta, least)
        limit = solved_limit(condition) if recipe.needs is Needs.POSITIVE_MASS else TORQUE_LIMIT
        shares = np.array([*errors.values()])
        if np.all(shares <= limit):
            yield Compared(recipe, float(shares.max()), limit)
            continue
        rounding = _rounding(recipe, robot, states)
        limits = np.array([max(limit, TIMES * rounding[name] / scales[name]) for name in errors])
        if np.all(shares <= limits) and limits.max() > max(limit, LARGEST_LIMIT):
            yield Compared(recipe, np.nan, None, "not compared: rounding changes Pinocchio's values too much")
            continue
        worst = int(np.argmax(shares / limits))  # the first NaN if there is one
        own = float(limits[worst])
        why = f"the limit is {TIMES:g} times the rounding error of Pinocchio's values" if own > limit else ""
        yield Compared(recipe, float(shares[worst]), own, why)


def _lacking(model: DynamicsModel, recipe: Recipe, robot: OnCoordinates, solvable: bool) -> str | None:
    """Why the model has no such function, or Pinocchio none of this robot; None where both have."""
    if recipe.needs is Needs.STANDARD:
        return lack_of_standard_parameters(model)
    if recipe.needs is Needs.POSITIVE_MASS and not solvable:
        return "the mass matrix is singular"
    if "second_derivatives" in recipe.signature.name and model.nv > MOST_RATES:
        return f"differences of Pinocchio's derivatives take long with more than {MOST_RATES} joint rates"
    # From positions to positions, or to the step between them.
    places = not recipe.signature.theta and all(
        q.axes in (("nq",), ("nv",), ("nv", "nq")) for q in recipe.signature.outputs
    )
    if robot.has_mimic_joints and places:
        return "Pinocchio's positions are of every joint, mimic joints included"
    if recipe.needs is Needs.POSITIVE_MASS and robot.has_mimic_joints:
        return "Pinocchio solves no robots with mimic joints"
    return None


def _errors(
    recipe: Recipe,
    arrays: RobotOnArrays,
    robot: OnCoordinates,
    given: Mapping[str, Array],
    theta: Array,
    least: float,
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the largest error of each output, and the scale that it is relative to."""
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
    scales = {name: max(_scale(size, most), least) for name, size in largest.items()}
    errors = {
        name: float(np.abs(found[name] - values).max(initial=0.0)) / scales[name]
        for name, values in expected.items()
    }
    return errors, scales


def _rounding(recipe: Recipe, robot: OnCoordinates, given: Mapping[str, Array]) -> dict[str, float]:
    """The largest change of each of Pinocchio's values if the last digits of the joints' placements change."""
    if recipe.packs is not None:
        recipe = RECIPES[recipe.packs.function]
    expected, rng = _expected(recipe, robot, given), np.random.default_rng(SEED)
    changes = dict.fromkeys(expected, 0.0)
    for _ in range(DRAWS):
        model = robot.free.model.copy()
        for joint in range(1, model.njoints):
            place = model.jointPlacements[joint]
            for numbers in (place.rotation, place.translation):
                numbers *= 1.0 + LAST * rng.choice([-1.0, 1.0], numbers.shape)
        changed = _expected(recipe, replace(robot, free=replace(robot.free, model=model)), given)
        for name, values in changed.items():
            change = float(np.abs(values - expected[name]).max(initial=0.0))
            changes[name] = max(changes[name], change)
    return changes


def _expected(recipe: Recipe, robot: OnCoordinates, given: Mapping[str, Array]) -> Mapping[str, Array]:
    """Pinocchio's values. For a robot with mimic joints, they are those of all joints, summed along the axes of rates."""
    if not robot.has_mimic_joints:
        return recipe.pinocchio(robot.free, given)
    joints = dict(given)
    for quantity in recipe.signature.inputs:
        if quantity.axes in (("nq",), ("nv",)):
            move = robot.mimic_map.positions if quantity.name == Q.name else robot.mimic_map.rates
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
            values = robot.mimic_map.summed(values, k - len(axes))
        elif axis == "nxa":
            parts = np.split(values, 3, axis=k - len(axes))
            values = np.concatenate([robot.mimic_map.summed(x, k - len(axes)) for x in parts], k - len(axes))
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
