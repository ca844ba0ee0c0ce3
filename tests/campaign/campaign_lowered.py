"""A model's PROGRAMs interpreted and its C compiled, against Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import TypeVar
from unittest import mock

import numpy as np
from campaign_reference import Reference
from unoptimised import without_optimisation

from psdmc.compiler import compile
from psdmc.functions import RECIPES
from psdmc.lower import kernels, search
from psdmc.lower.kernels import Lowering, lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.interpret import interpret
from psdmc.program.signature import Signature, Sizes
from psdmc.target.target import Costs

Array = np.ndarray
Made = TypeVar("Made")

_LOWERED = kernels._Lowered

BUDGET = 6
"""Programs that the search for cheap arrangements may trace: whichever it takes must be right."""

OPTIMISED_EVERY = 10
"""Robots of which one is built as users build it; the others, whose C is in question and not the compiler, without
optimisation, which takes a fifth of the time."""

INVERSE = "inverse_dynamics"
FUNCTIONS = (INVERSE, "forward_dynamics", "mass_matrix", "nonlinear_effects", "gravity", "regressor")

ALWAYS = ("auto", "float64", "inline")
IN_TURN = (
    ("auto", "float64", "libm"),
    ("factored", "float64", "freestanding"),
    ("auto", "float32", "inline"),
    ("expanded", "float64", "inline"),
    ("auto", "float32", "libm"),
)
"""Lowering, precision and sine of the builds: the first for every robot, of the others one each, of SOLVED alone."""

SOLVED = (INVERSE, "forward_dynamics")
"""Between them they run the arithmetic of all others but the regressor."""


def lowered_errors(model: DynamicsModel, reference: Reference, turn: int) -> Iterator[tuple[str, float]]:
    """Errors of the PROGRAMs of every function in both forms, and of two builds; `turn` chooses the second."""
    second = IN_TURN[turn % len(IN_TURN)]
    if second[0] == "expanded" and not _is_small(model):
        second = (*ALWAYS[:2], "freestanding")
    built = nullcontext() if turn // len(IN_TURN) % OPTIMISED_EVERY == 0 else without_optimisation()
    with mock.patch.object(kernels, "Search", partial(search.Search, budget=BUDGET)), _lowered_once(), built:
        yield from _interpreted(model, reference)
        yield from _compiled(model, reference, ALWAYS, FUNCTIONS)
        yield from _compiled(model, reference, second, SOLVED)


@contextmanager
def _lowered_once() -> Iterator[None]:
    """Lowerings inside share what they find of a model: searches, traces, and what passes made of them. Each by itself would
    do it anew, three times a robot."""
    first: dict[int, kernels._Lowered] = {}

    def lowered(model: DynamicsModel, lowering: Lowering, costs: Costs, *others: object) -> kernels._Lowered:
        one = _LOWERED(model, lowering, costs, *others)
        known = first.setdefault(id(model), one)
        if known.costs == costs:
            for part in ("geometry", "_searches", "_arrangements", "_traced"):
                setattr(one, part, getattr(known, part))
        return one

    with (
        mock.patch.object(kernels, "_Lowered", lowered),
        mock.patch.object(kernels, "lower_expanded", _once(kernels.lower_expanded)),
        mock.patch.object(kernels, "shortened", _once(kernels.shortened)),
        mock.patch.object(kernels, "ordered", _once(kernels.ordered)),
    ):
        yield


def _once(function: Callable[..., Made]) -> Callable[..., Made]:
    """The function, called once with the same objects."""
    made: dict[tuple[int, ...], tuple[tuple[object, ...], Made]] = {}

    def remembered(*arguments: object) -> Made:
        key = tuple(map(id, arguments))
        if key not in made:
            made[key] = arguments, function(*arguments)
        return made[key][1]

    return remembered


def _is_small(model: DynamicsModel) -> bool:
    return model.p is not None and model.p <= kernels.EXPANDED_LIMIT


def _interpreted(model: DynamicsModel, reference: Reference) -> Iterator[tuple[str, float]]:
    """By both lowerings, with the parameters inside and as an argument, one state and lanes."""
    for lowering in ("factored", "expanded") if _is_small(model) else ("factored",):
        for name, kernel in lower(model, lowering, FUNCTIONS).items():
            function = kernel.function
            given = _arguments(function, reference) | {"theta_b": model.theta_b}
            sizes = function.sizes(_sizes(model))
            (output,) = function.outputs
            for form in ("single", "batch"):
                found = interpret(getattr(kernel, form), given, sizes)[output.name]
                yield f"PROGRAM {lowering} {name} {form}", _error(function, found, reference, model)


def _sizes(model: DynamicsModel) -> Sizes:
    return Sizes.of(model.mechanism, model.l)


def _compiled(
    model: DynamicsModel, reference: Reference, build: Sequence[str], functions: Sequence[str]
) -> Iterator[tuple[str, float]]:
    lowering, real, trig = build
    robot = compile(model, lowering, functions, real, trig)
    for function in (RECIPES[name].signature for name in functions):
        arguments = _arguments(function, reference).values()
        for label, theta in (("", {}), (" theta", {"theta_b": model.theta_b}))[: 1 + function.theta]:
            found = np.asarray(getattr(robot, function.name)(*arguments, **theta), dtype=np.float64)
            if function.name == "forward_dynamics":
                found = _answered(found, reference, real)
            error = _error(function, found, reference, model)
            yield f"C {lowering} {real} {trig} {function.name}{label}", error


def _answered(found: Array, reference: Reference, real: str) -> Array:
    """The accelerations, and the right ones where there are none (NaN) because the mass matrix is not positive definite
    in this precision: robots of many scales in float32."""
    refused = np.isnan(found).all(axis=1) & reference.is_singular_in(real)
    return np.where(refused[:, None], reference.few[2], found)


def _arguments(function: Signature, reference: Reference) -> dict[str, Array]:
    """By name and in order. Forward dynamics gets the torques of known accelerations."""
    states = reference.states if function.name == INVERSE else reference.few
    given = dict(zip(("q", "qd", "qdd"), states, strict=True)) | {"tau": reference.tau[: len(states[0])]}
    return {quantity.name: given[quantity.name] for quantity in function.inputs}


def _error(function: Signature, found: Array, reference: Reference, model: DynamicsModel) -> float:
    count, n = len(found), model.nv
    if function.name == "forward_dynamics":
        return reference.acceleration_error(found)
    if function.name == "mass_matrix":
        return reference.mass_error(found.reshape(count, n, n))
    if function.name == "regressor":
        found = found.reshape(count, n, model.l) @ model.theta_b
    expected = {"nonlinear_effects": reference.nonlinear, "gravity": reference.gravity}
    return reference.torque_error(found, expected.get(function.name, reference.tau[:count]))
