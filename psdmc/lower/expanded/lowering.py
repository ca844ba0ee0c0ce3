"""The expanded lowering: a method that makes code from E, P and theta_b, as nested Horner forms of the torques'
polynomials (PSDM-2021, section 4.1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, solve
from psdmc.lower.expanded.diagram import Diagram, nested_horner, operations, with_constants
from psdmc.lower.expanded.orders import Joints, base_first, candidates, tip_first
from psdmc.lower.expanded.terms import (
    COEFFICIENT_NOISE,
    Terms,
    baked_torque_terms,
    gravity_terms,
    joined,
    known_parameters,
    mass_matrix_terms,
    nonlinear_terms,
    regressor_terms,
    torque_terms,
    with_gravity,
)
from psdmc.lower.expanded.values import polynomial_values, row_symbols
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.expansion import BLOCKS
from psdmc.program.cost import cost
from psdmc.program.pipeline import optimize
from psdmc.program.program import Program, Slot
from psdmc.program.signature import Sizes
from psdmc.program.trace import Number, Symbol, Tracer
from psdmc.recipes.recipe import Polynomials, Recipe
from psdmc.target.costs import Costs
from psdmc.target.native import COSTS

Outputs = list[tuple[Slot, Symbol | Number]]


TRACED = 3
"""How many diagrams, the cheapest by count, are traced and optimized to find the cheapest PROGRAM."""


def lower_expanded(
    model: DynamicsModel,
    recipe: Recipe,
    theta: bool,
    costs: Costs = COSTS,
    noise: float = COEFFICIENT_NOISE,
) -> Program:
    """Return the PROGRAM (list of operations) of one function, made from the torques' polynomials.

    Orders of variables are compared by cost, and the result is the same on every machine. With known theta_b, equal
    parts are found before or after theta_b is inserted, whichever is cheaper.

    theta  True: theta_b is an input of the PROGRAM; False: its values are constants
    noise  uncertainty of the coefficients

    Raises InputError if the model has no E and P, or if its base parameters are needed and unknown. Raises
    SingularMatrix if the mass matrix cannot be inverted for any q.
    """
    if recipe.polynomials is None or (theta and not recipe.signature.theta):
        raise ValueError(f"the expanded lowering does not make {recipe.name}{'_theta' * theta}")
    diagrams = sorted(_diagrams(model, recipe.polynomials, theta, noise), key=lambda d: sum(operations(d)))
    programs = (_traced(model, recipe, theta, diagram, costs) for diagram in diagrams[:TRACED])
    return min(programs, key=lambda program: cost(program).total)


def _diagrams(model: DynamicsModel, part: Polynomials, theta: bool, noise: float) -> Iterator[Diagram]:
    """Candidate diagrams. Baked parameters enter in one of two ways: as rows that become constants afterwards (equal
    parts are then found whatever the parameters' values are, and constants stand innermost), or in the coefficients
    at once."""
    n = model.n
    if part is Polynomials.REGRESSOR:
        yield from _in_all_orders(with_gravity(regressor_terms(model, noise), model.mechanism), tip_first(n))
        return
    symbolic = _part(part, with_gravity(torque_terms(model, noise), model.mechanism), n)
    if theta:
        yield from _in_all_orders(symbolic, base_first(n))
        return
    values = dict(enumerate(known_parameters(model).tolist(), start=BLOCKS * n))
    present = _without_zero_rows(symbolic, values)
    yield from (with_constants(diagram, values) for diagram in _in_all_orders(present, base_first(n)))
    baked = _part(part, with_gravity(baked_torque_terms(model, noise), model.mechanism), n)
    yield from _in_all_orders(baked, base_first(n))


def _in_all_orders(terms: Terms, joints: Joints) -> Iterator[Diagram]:
    return (nested_horner(terms, order) for order in candidates(joints, len(terms.exponents)))


def _without_zero_rows(terms: Terms, values: Mapping[int, float]) -> Terms:
    """The terms whose parameter is not zero."""
    zero = [row for row, value in values.items() if value == 0.0]
    return terms.where(np.asarray(~terms.exponents[zero].any(axis=0)))


def _part(part: Polynomials, torque: Terms, n: int) -> Terms:
    """The terms of one function's polynomials, taken from those of all torques."""
    match part:
        case Polynomials.MASS:
            return mass_matrix_terms(torque, n)
        case Polynomials.BIAS:
            return nonlinear_terms(torque, n)
        case Polynomials.GRAVITY:
            return gravity_terms(torque, n)
        case Polynomials.SOLVED:
            return joined(mass_matrix_terms(torque, n), nonlinear_terms(torque, n), n * n)
    return torque


def _traced(model: DynamicsModel, recipe: Recipe, theta: bool, diagram: Diagram, costs: Costs) -> Program:
    tracer = Tracer()
    values = polynomial_values(diagram, row_symbols(tracer, model, theta))
    return optimize(tracer.finish(_outputs(tracer, model, recipe, values)), costs)


def _outputs(tracer: Tracer, model: DynamicsModel, recipe: Recipe, values: dict[int, Scalar]) -> Outputs:
    n, signature = model.n, recipe.signature
    output = signature.outputs[0]
    if recipe.polynomials is Polynomials.MASS:
        return _vector(output.name, [entry for row in _symmetric(values, n) for entry in row])
    if recipe.polynomials is Polynomials.SOLVED:
        torque = tracer.symbols(signature.inputs[-1].name, n)
        load = [tau - values.get(n * n + i, 0.0) for i, tau in enumerate(torque)]
        factors = factorize(_symmetric(values, n))
        return _vector(output.name, solve(factors, load)) + _vector(signature.stored[-1].name, factors.pivots)
    size = Sizes.of_chain(n, model.l).size(output)
    return _vector(output.name, [values.get(i, 0.0) for i in range(size)])


def _vector(name: str, values: Sequence[Scalar]) -> Outputs:
    return [(Slot(name, i), value) for i, value in enumerate(values)]


def _symmetric(values: dict[int, Scalar], n: int) -> list[list[Scalar]]:
    return [[values.get(min(i, j) * n + max(i, j), 0.0) for j in range(n)] for i in range(n)]
