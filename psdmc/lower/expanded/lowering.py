"""The expanded lowering: a method that makes code from E, P and theta_b, as nested Horner forms of the torques'
polynomials (PSDM-2021, section 4.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, solve
from psdmc.lower.expanded.diagram import (
    NOTHING,
    ONE,
    Diagram,
    nested_horner,
    operations,
    with_constants,
)
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
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.expansion import BLOCKS
from psdmc.program.cost import cost
from psdmc.program.pipeline import optimize
from psdmc.program.program import Program, Slot
from psdmc.program.signature import Sizes
from psdmc.program.trace import Number, Symbol, Tracer
from psdmc.recipes.recipe import Polynomials, Recipe
from psdmc.target.presets import COSTS
from psdmc.target.target import Costs

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
    n = model.nv
    if part is Polynomials.REGRESSOR:
        yield from _in_all_orders(with_gravity(regressor_terms(model, noise), model.mechanism), tip_first(n))
        return
    symbolic = _part(part, with_gravity(torque_terms(model, noise), model.mechanism), n)
    if theta:
        yield from _in_all_orders(symbolic, base_first(n))
        return
    values = dict(enumerate(known_parameters(model).tolist(), start=BLOCKS * n))
    zero = [row for row, value in values.items() if value == 0.0]
    present = symbolic.where(np.asarray(~symbolic.exponents[zero].any(axis=0)))
    yield from (with_constants(diagram, values) for diagram in _in_all_orders(present, base_first(n)))
    baked = _part(part, with_gravity(baked_torque_terms(model, noise), model.mechanism), n)
    yield from _in_all_orders(baked, base_first(n))


def _in_all_orders(terms: Terms, joints: Joints) -> Iterator[Diagram]:
    return (nested_horner(terms, order) for order in candidates(joints, len(terms.exponents)))


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
    n, signature = model.nv, recipe.signature
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


Order = tuple[int, ...]
Joints = tuple[int, ...]

TRIGONOMETRY = ((0, 2, 1), (0, 1, 2))
"""Row blocks of one joint's position, outermost first: q, cos, sin and q, sin, cos."""


def base_first(n: int) -> Joints:
    """Return the order of joints for torques, from the base outward. The inner parts of the nested forms then depend on
    the outer links only, and recur often."""
    return tuple(range(n))


def tip_first(n: int) -> Joints:
    """Return the order of joints for regressors, from the tip inward. A regressor column belongs to one link, and
    joints after this link do not occur in it."""
    return tuple(reversed(range(n)))


def candidates(joints: Joints, rows: int) -> Iterator[Order]:
    """Return orders of all variables (rows of the exponents), outermost first. Joint positions are in the given order
    of joints.

    In most orders, joint rates and accelerations are outermost, so that the torques of two joints share polynomials of
    position. In the other orders, all variables of a joint stand together. Base parameters, the rows from 5 n on, are
    always innermost.

    rows  number of rows
    """
    n = len(joints)
    parameters = tuple(range(BLOCKS * n, rows))
    for blocks in TRIGONOMETRY:
        position = _by_joint(joints, blocks, n)
        for rates in (joints[::-1], joints):
            motion = tuple(block * n + joint for block in (4, 3) for joint in rates)
            yield motion + position + parameters
        yield _by_joint(joints, (4, 3, *blocks), n) + parameters


def _by_joint(joints: Sequence[int], blocks: Sequence[int], n: int) -> Order:
    return tuple(block * n + joint for joint in joints for block in blocks)


def row_symbols(tracer: Tracer, model: DynamicsModel, theta: bool) -> list[Scalar]:
    """Return a symbol for each variable of the polynomials: q, sin q, cos q, qd, qdd of all joints, then theta_b if
    `theta`. The symbols record operations."""
    n = model.nv
    q = tracer.symbols("q", n)
    sincos = [
        value.sincos() if joint.basis.has_sincos else (0.0, 0.0)
        for value, joint in zip(q, model.mechanism.own_types, strict=True)
    ]
    rates = [*tracer.symbols("qd", n), *tracer.symbols("qdd", n)]
    parameters = tracer.symbols("theta_b", model.l) if theta else []
    return [*q, *(s for s, _ in sincos), *(c for _, c in sincos), *rates, *parameters]


def polynomial_values(diagram: Diagram, rows: Sequence[Scalar]) -> dict[int, Scalar]:
    """Return the value of each polynomial of the diagram by its number, from the values of the variables (rows)."""
    nodes: dict[int, Scalar] = {NOTHING: 0.0, ONE: 1.0}
    for level in diagram.levels:
        row, parts = rows[level.row], zip(level.child.tolist(), level.ratio.tolist(), strict=True)
        for number, (child, ratio) in enumerate(parts, start=level.first):
            scaled = [None if c == NOTHING else nodes[c] * r for c, r in zip(child, ratio, strict=True)]
            nodes[number] = _horner(scaled, row)
    return {
        output: nodes[root] * factor
        for output, root, factor in zip(
            diagram.output.tolist(), diagram.root.tolist(), diagram.factor.tolist(), strict=True
        )
    }


def _horner(parts: Sequence[Scalar | None], row: Scalar) -> Scalar:
    """parts[0] + row * (parts[1] + row * parts[2]), where None is nothing."""
    constant, linear, square = parts
    value: Scalar = 0.0
    if square is not None and linear is not None:
        value = (linear + row * square) * row
    elif square is not None:
        value = square * (row * row)
    elif linear is not None:
        value = linear * row
    return value if constant is None else constant + value
