"""Evaluates every generated function of a model in NumPy, without compiled code. Torques and similar functions use E, P
and theta_b; others use the function's reference in NumPy. A compiled robot is faster.

Broadcasting, results, errors and NaN are as for compiled robots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.functions import RECIPES, SIGNATURES
from psdmc.lower.admitted import require
from psdmc.model import evaluate
from psdmc.model.answers import Provider
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.expansion import Expansion
from psdmc.program.signature import PIVOTS, QD, QDD, TAU, Q, Signature, Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Needs, Recipe
from psdmc.robot.coordinates import units_of
from psdmc.robot.mechanism import BASE_FRAME, Array, Mechanism, contact_names
from psdmc.toolchain.call_arguments import (
    THETA_B,
    RobotAxes,
    bound_arguments,
    checked_outputs,
    common_lead,
    finite_states,
    has_rows,
    indefinite,
    parameters,
    signature_of,
    states,
    with_rows,
)
from psdmc.toolchain.compiled_functions import results
from psdmc.toolchain.labelled_arrays import foreign, is_foreign, refuse_out
from psdmc.toolchain.stubs import documentation

_ADMITTED: WeakKeyDictionary[DynamicsModel, set[str]] = WeakKeyDictionary()
"""Functions that each living model is known to have: the mass matrix is looked at in hundreds of states to find out."""


def provider() -> Provider:
    """Return the object from which models get the generated functions, computed in NumPy."""
    return Provider(lambda: SIGNATURES, function_of)


def function_of(model: DynamicsModel, name: str) -> Callable[..., Any]:
    """Return the function of the model with this name and the arguments of the compiled robot's method."""
    recipe = RECIPES[name]

    def function(*given: Any, **named: Any) -> Any:
        return evaluated(model, recipe, *bound_arguments(recipe.signature, given, named))

    meaning = documentation(recipe.signature).replace(BASE_FRAME, model.mechanism.base_frame)
    function.__name__, function.__doc__ = name, meaning
    method = signature_of(recipe.signature)
    without_self = method.replace(parameters=list(method.parameters.values())[1:])
    function.__signature__ = without_self  # type: ignore[attr-defined]
    function.__qualname__ = f"{type(model).__name__}.{name}"
    return function


def evaluated(
    model: DynamicsModel,
    recipe: Recipe,
    inputs: tuple[ArrayLike, ...],
    theta_b: ArrayLike | None = None,
    out: Any = None,
) -> Any:
    """Compute a generated function (such as forward dynamics) at the given states in NumPy. Return its output, or a
    named tuple if it has several outputs.

    inputs   arrays of states, with leading axes that broadcast
    theta_b  base parameters that replace the model's; optional
    out      arrays into which the results are written; optional
    """
    signature = recipe.signature
    axes = _axes(model, recipe)
    tails = [axes.sizes.shape(output.axes) for output in signature.outputs]
    by_rows = has_rows(signature, theta_b)
    if by_rows:
        signature, inputs = with_rows(signature), (*inputs, theta_b)  # type: ignore[arg-type]
    if any(map(is_foreign, inputs)):
        refuse_out(signature, out)
        return _tuple(
            signature, foreign(_on_arrays(model, recipe, theta_b), axes, signature, inputs, tails, np.float64)
        )
    arrays = states(signature, axes, inputs, np.float64)
    lead = common_lead(signature, arrays)
    given = {
        quantity.name: np.broadcast_to(array, (*lead, *(tail := axes.sizes.shape(quantity.axes)))).reshape(
            -1, *tail
        )
        for quantity, array in zip(signature.inputs, arrays, strict=True)
    }
    if recipe.lack_of_loops(model.mechanism) or (recipe.needs is not None and theta_b is None):
        _admit(model, recipe.name)
    # A singular state gives an error or NaN, and no warnings of NumPy beside it.
    with np.errstate(divide="ignore", invalid="ignore"):
        if by_rows:
            found = _values_by_rows(model, recipe, given, axes.sizes)
        else:
            found = _values(model, recipe, _parameters(model, signature, theta_b), given, axes.sizes)
    if signature.raises:
        _refuse_indefinite(signature, axes, lead, found[PIVOTS], given)
    outputs = [found[o.name].reshape(lead + tail) for o, tail in zip(signature.outputs, tails, strict=True)]
    if out is not None:
        kept = checked_outputs(signature, out, [lead + tail for tail in tails], np.dtype(np.float64))
        for array, values in zip(kept, outputs, strict=True):
            array[...] = values
        outputs = list(kept)
    return _tuple(signature, outputs)


def _refuse_indefinite(
    signature: Signature, axes: RobotAxes, lead: tuple[int, ...], pivots: Array, given: Mapping[str, Array]
) -> None:
    """InputError for the first state, of finite inputs, in which a matrix is not positive definite that has an error."""
    arrays = [given[quantity.name] for quantity in signature.inputs]
    lost = ~(pivots > 0.0) & finite_states(signature, arrays)[:, None]
    arrays = [array.reshape((*lead, *array.shape[1:])) for array in arrays]
    for row in np.flatnonzero(lost.any(axis=1)).tolist():
        state = tuple(int(k) for k in np.unravel_index(row, lead)) if lead else ()
        error = indefinite(signature, axes, int(np.argmax(lost[row])), arrays, state)
        if error:
            raise error


def _tuple(signature: Signature, outputs: Sequence[Any]) -> Any:
    return outputs[0] if len(outputs) == 1 else results(signature)(*outputs)


def _on_arrays(model: DynamicsModel, recipe: Recipe, theta_b: ArrayLike | None) -> Callable[..., Any]:
    count = len(recipe.signature.inputs)
    return lambda *arrays: evaluated(model, recipe, arrays[:count], *(arrays[count:] or [theta_b]))


def _admit(model: DynamicsModel, name: str) -> None:
    """InputError where the model cannot have a function."""
    admitted = _ADMITTED.setdefault(model, set())
    if name not in admitted:
        require(model, [name])
        admitted.add(name)


def _axes(model: DynamicsModel, recipe: Recipe) -> RobotAxes:
    robot = model.mechanism
    own = robot.own_joints
    kept = len(recipe.packs.places(robot, model.representative)) if recipe.packs else 0
    frames = tuple(frame.name for frame in robot.frames)
    return RobotAxes(
        Sizes.of(robot, model.l, kept),
        {
            "n": tuple(robot.joints[i].name for i in own),
            "nq": robot.q_names,
            "nv": robot.v_names,
            "frames": frames,
            **contact_names(
                ((frame.name, frame.rows) for frame in robot.contacts),
                ((loop.name, loop.rows) for loop in robot.loops),
            ),
        },
        units_of(robot.joints[i].type for i in own),
    )


def _parameters(model: DynamicsModel, signature: Signature, theta_b: ArrayLike | None) -> Array:
    """theta_b, (l,): the one given, or the model's own, which functions without theta_b do without."""
    if theta_b is not None:
        return parameters(signature, model.l, theta_b, np.float64)
    return model.known_theta_b() if signature.theta or model.theta_b is not None else np.zeros(model.l)


def _values(
    model: DynamicsModel, recipe: Recipe, theta: Array, given: Mapping[str, Array], sizes: Sizes
) -> Mapping[str, Array]:
    """All outputs, (k, ...); NaN in states whose mass matrix is not positive definite, where the function solves it."""
    count = len(next(iter(given.values()), (None,)))
    zeros = {quantity.name: np.zeros((count, *sizes.shape(quantity.axes))) for quantity in (Q, QD, QDD)}
    whole = zeros | dict(given)  # references take shapes from any of the three
    if model.expansion is not None and recipe.name in _FROM_MONOMIALS:
        motion = [whole[quantity.name] for quantity in (Q, QD, QDD)]
        (output,) = recipe.signature.outputs
        return {output.name: _FROM_MONOMIALS[recipe.name](model.expansion, model.mechanism, theta, motion)}
    robot = RobotOnArrays.of(model, theta)
    if not recipe.signature.factorises:
        return recipe.reference(robot, whole)
    is_solved = recipe.needs is Needs.POSITIVE_MASS
    solvable = _solvable(robot, given[Q.name]) if is_solved else np.ones(count, np.bool_)
    chosen = {name: values[solvable] for name, values in given.items()}
    if TAU.name in chosen and QDD.name not in chosen:
        chosen[QDD.name] = robot.accelerations(chosen["q"], chosen["qd"], chosen[TAU.name])
    found = recipe.reference(robot, chosen)
    filled = {}
    for name, values in found.items():
        filled[name] = np.full((len(solvable), *values.shape[1:]), np.nan)
        filled[name][solvable] = values
    if PIVOTS in filled:
        failed = ~(filled[PIVOTS] > 0.0).all(axis=1)
        for output in recipe.signature.outputs:
            filled[output.name][failed] = np.nan
    return filled


def _values_by_rows(
    model: DynamicsModel, recipe: Recipe, given: Mapping[str, Array], sizes: Sizes
) -> Mapping[str, Array]:
    """Compute `_values` with a theta_b for each state, which is one of the quantities given."""
    inputs = {name: array for name, array in given.items() if name != THETA_B.name}
    rows = [
        _values(model, recipe, theta, {name: array[k : k + 1] for name, array in inputs.items()}, sizes)
        for k, theta in enumerate(given[THETA_B.name])
    ]
    if not rows:
        return _values(model, recipe, np.zeros(model.l), inputs, sizes)
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


_FROM_MONOMIALS: Mapping[str, Callable[[Expansion, Mechanism, Array, list[Array]], Array]] = {
    **dict.fromkeys(("inverse_dynamics", "nonlinear_effects", "gravity"), evaluate.expanded_torques),
    "mass_matrix": lambda expansion, chain, theta, states: evaluate.expanded_mass_matrix(
        expansion, chain, theta, states[0]
    ),
    "regressor": lambda expansion, chain, theta, states: evaluate.expanded_regressor(
        expansion, chain, states
    ),
}
"""Functions that E, P and theta_b give directly, from q, qd and qdd."""


def _solvable(robot: RobotOnArrays, q: Array) -> NDArray[np.bool_]:
    """(k,) whether the mass matrix is positive definite, and its entries are numbers."""
    mass = robot.mass_matrix(q)
    finite = np.atleast_1d(np.isfinite(mass).all(axis=(1, 2)))
    mass[~finite] = np.eye(robot.nv)
    positive: NDArray[np.bool_] = np.linalg.eigvalsh(mass)[:, 0] > 0.0
    return np.logical_and(finite, positive)
