"""Every generated function of a model in NumPy, by its recipe's reference: slow, and with nothing lowered or compiled.

Broadcasting, results, refusals and NaN are those of compiled robots.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError
from psdmc.functions import RECIPES, SIGNATURES
from psdmc.lower.admitted import require
from psdmc.model.answers import Provider
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.signature import QD, QDD, TAU, Q, Signature, Sizes
from psdmc.real_arrays import real_array
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Recipe
from psdmc.robot.mechanism import Array
from psdmc.robot.unit_lengths import refuse_other_lengths, units_of
from psdmc.toolchain.call_arguments import bound_arguments, signature_of
from psdmc.toolchain.compiled_functions import results
from psdmc.toolchain.stubs import documentation

_ADMITTED: WeakKeyDictionary[DynamicsModel, set[str]] = WeakKeyDictionary()
"""Functions that each living model is known to have: the mass matrix is looked at in hundreds of states to find out."""


def provider() -> Provider:
    """The answers of models."""
    return Provider(lambda: SIGNATURES, function_of)


def function_of(model: DynamicsModel, name: str) -> Callable[..., Any]:
    """A function of the model by name, as a compiled robot has it."""
    recipe = RECIPES[name]

    def function(*given: Any, **named: Any) -> Any:
        inputs, theta_b, out = bound_arguments(recipe.signature, given, named)
        if out is not None:
            raise InputError(f"{name}: out is for compiled robots", "leave it out, or psdmc.compile(model)")
        return evaluated(model, recipe, inputs, theta_b)

    function.__name__, function.__doc__ = name, documentation(recipe.signature)
    function.__signature__ = _without_self(signature_of(recipe.signature))  # type: ignore[attr-defined]
    function.__qualname__ = f"{type(model).__name__}.{name}"
    return function


def _without_self(signature: inspect.Signature) -> inspect.Signature:
    return signature.replace(parameters=list(signature.parameters.values())[1:])


def evaluated(
    model: DynamicsModel, recipe: Recipe, inputs: tuple[ArrayLike, ...], theta_b: ArrayLike | None = None
) -> Any:
    """The output, or a named tuple of the outputs, of a function at these states."""
    signature = recipe.signature
    sizes = _sizes(model, recipe)
    lead, given = _states(signature, sizes, inputs)
    _refuse_other_lengths(model, signature, given)
    if theta_b is None:
        _admit(model, recipe.name)
    theta = _parameters(model, signature, theta_b)
    robot = RobotOnArrays.of(model, theta)
    found = _values(recipe, robot, given, sizes)
    outputs = tuple(found[o.name].reshape(lead + sizes.shape(o.axes)) for o in signature.outputs)
    return outputs[0] if len(outputs) == 1 else results(signature)(*outputs)


def _admit(model: DynamicsModel, name: str) -> None:
    """InputError where the model cannot have a function."""
    admitted = _ADMITTED.setdefault(model, set())
    if name not in admitted:
        require(model, [name])
        admitted.add(name)


def _refuse_other_lengths(model: DynamicsModel, signature: Signature, given: Mapping[str, Array]) -> None:
    """InputError where a quaternion, or a cosine with its sine, is not of length one."""
    robot = model.mechanism
    units = units_of(robot.joints[i].type for i in robot.own_joints)
    for quantity in signature.inputs:
        if quantity.axes == Q.axes and not signature.normalizes:
            refuse_other_lengths(f"{signature.name}: {quantity.name}", given[quantity.name], units)


def _sizes(model: DynamicsModel, recipe: Recipe) -> Sizes:
    own = len(model.mechanism.own_joints)
    kept = len(recipe.packs.places(model.mechanism, model.representative)) if recipe.packs else 0
    return Sizes(own, model.nq, model.nv, model.l, len(model.mechanism.frames), kept)


def _parameters(model: DynamicsModel, signature: Signature, theta_b: ArrayLike | None) -> Array:
    """theta_b, (l,): the one given, or the model's own, which functions without theta_b do without."""
    if theta_b is None:
        return model.known_theta_b() if signature.theta or model.theta_b is not None else np.zeros(model.l)
    array = real_array(f"{signature.name}: theta_b", theta_b)
    if array.shape != (model.l,):
        raise InputError(
            f"{signature.name}: theta_b has shape {array.shape}, expected ({model.l},)",
            "give one value per base parameter",
        )
    return array


def _states(
    signature: Signature, sizes: Sizes, inputs: tuple[ArrayLike, ...]
) -> tuple[tuple[int, ...], dict[str, Array]]:
    """The common leading shape, and each input as (states, ...) under its name."""
    arrays = {}
    for quantity, values in zip(signature.inputs, inputs, strict=True):
        array, tail = real_array(f"{signature.name}: {quantity.name}", values), sizes.shape(quantity.axes)
        if array.ndim < len(tail) or array.shape[array.ndim - len(tail) :] != tail:
            expected = ", ".join(("...", *map(str, tail)))
            raise InputError(
                f"{signature.name}: {quantity.name} has shape {array.shape}, expected ({expected})",
                "the last axes are those of one state",
            )
        arrays[quantity.name] = (array, tail)
    try:
        lead = np.broadcast_shapes(*(a.shape[: a.ndim - len(tail)] for a, tail in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, (array, _) in arrays.items())
        raise InputError(
            f"{signature.name}: shapes do not broadcast: {shapes}",
            "give arrays of one shape, or shapes that NumPy broadcasts",
        ) from None
    return lead, {
        name: np.broadcast_to(array, lead + tail).reshape(-1, *tail) for name, (array, tail) in arrays.items()
    }


def _values(
    recipe: Recipe, robot: RobotOnArrays, given: Mapping[str, Array], sizes: Sizes
) -> Mapping[str, Array]:
    """All outputs, (k, ...); NaN in states whose mass matrix is not positive definite, where the function solves it."""
    count = len(next(iter(given.values()), (None,)))
    zeros = {quantity.name: np.zeros((count, *sizes.shape(quantity.axes))) for quantity in (Q, QD, QDD)}
    if recipe.signature.positive is None:
        return recipe.reference(robot, zeros | dict(given))  # references take shapes from any of the three
    solvable = _solvable(robot, given[Q.name])
    chosen = {name: values[solvable] for name, values in given.items()}
    if TAU.name in chosen and QDD.name not in chosen:
        chosen[QDD.name] = robot.accelerations(chosen["q"], chosen["qd"], chosen[TAU.name])
    found = recipe.reference(robot, chosen)
    whole = {}
    for output in recipe.signature.outputs:
        whole[output.name] = np.full((len(solvable), *sizes.shape(output.axes)), np.nan)
        whole[output.name][solvable] = found[output.name]
    return whole


def _solvable(robot: RobotOnArrays, q: Array) -> NDArray[np.bool_]:
    """(k,) whether the mass matrix is positive definite, and its entries are numbers."""
    mass = robot.mass_matrix(q)
    finite = np.atleast_1d(np.isfinite(mass).all(axis=(1, 2)))
    mass[~finite] = np.eye(robot.nv)
    positive: NDArray[np.bool_] = np.linalg.eigvalsh(mass)[:, 0] > 0.0
    return np.logical_and(finite, positive)
