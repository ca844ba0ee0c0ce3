"""The expanded lowering: nested Horner forms straight from E, P and theta_b (PSDM-2021, section 4.1)."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.scalar import Scalar
from psdmc.lower.expanded_diagram import NOTHING, ONE, Diagram, Level
from psdmc.lower.expanded_orders import cheapest
from psdmc.lower.expanded_terms import (
    Terms,
    gravity_terms,
    joined,
    mass_matrix_terms,
    nonlinear_terms,
    regressor_terms,
    torque_terms,
    with_gravity,
)
from psdmc.lower.solve import solve_symmetric
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.functions import BY_NAME
from psdmc.program.pipeline import optimize
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Number, Symbol, Tracer

SUPPORTED = (
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "nonlinear_effects",
    "gravity",
    "regressor",
)
"""Functions of psdmc/program/functions.py that this lowering makes."""

Outputs = list[tuple[Slot, Symbol | Number]]


def lower_expanded(model: DynamicsModel, function_name: str, theta: bool) -> Program:
    """The PROGRAM of one function in SUPPORTED; with `theta`, theta_b is an input instead of constants.

    Operations and their order are a choice among a few row orders, by cost, the same on every machine.
    InputError where the model has no E and P, or its base parameters are needed and unknown.
    """
    if function_name not in SUPPORTED or (theta and not BY_NAME[function_name].theta):
        raise ValueError(f"the expanded lowering does not make {function_name}{'_theta' * theta}")
    terms = _terms(model, function_name, theta)
    diagram = cheapest(terms, model.n)
    tracer = Tracer()
    values = polynomial_values(diagram, row_symbols(tracer, model, theta))
    return optimize(tracer.finish(_outputs(tracer, model, function_name, values)))


def _terms(model: DynamicsModel, function_name: str, theta: bool) -> Terms:
    n = model.n
    if function_name == "regressor":
        return with_gravity(regressor_terms(model), model.chain)
    torque = with_gravity(torque_terms(model, theta), model.chain)
    match function_name:
        case "mass_matrix":
            return mass_matrix_terms(torque, n)
        case "nonlinear_effects":
            return nonlinear_terms(torque, n)
        case "gravity":
            return gravity_terms(torque, n)
        case "forward_dynamics":
            return joined(mass_matrix_terms(torque, n), nonlinear_terms(torque, n), n * n)
    return torque


def _outputs(tracer: Tracer, model: DynamicsModel, function_name: str, values: dict[int, Scalar]) -> Outputs:
    n, function = model.n, BY_NAME[function_name]
    if function_name == "mass_matrix":
        return _vector("M", [entry for row in _symmetric(values, n) for entry in row])
    if function_name == "forward_dynamics":
        torque = tracer.symbols("tau", n)
        load = [tau - values.get(n * n + i, 0.0) for i, tau in enumerate(torque)]
        acceleration, pivots = solve_symmetric(_symmetric(values, n), load)
        return _vector("qdd", acceleration) + _vector("pivot", pivots)
    return _vector(function.output, [values.get(i, 0.0) for i in range(function.size(n, model.l))])


def _vector(name: str, values: Sequence[Scalar]) -> Outputs:
    return [(Slot(name, i), value) for i, value in enumerate(values)]


def _symmetric(values: dict[int, Scalar], n: int) -> list[list[Scalar]]:
    return [[values.get(min(i, j) * n + max(i, j), 0.0) for j in range(n)] for i in range(n)]


def row_symbols(tracer: Tracer, model: DynamicsModel, theta: bool) -> list[Scalar]:
    """A value per row of the terms' exponents: q, sin q, cos q, qd, qdd, then theta_b if that is an input."""
    n = model.n
    q = tracer.symbols("q", n)
    sincos = [
        angle.sincos() if revolute else (0.0, 0.0)
        for angle, revolute in zip(q, model.chain.is_revolute, strict=True)
    ]
    rates = [*tracer.symbols("qd", n), *tracer.symbols("qdd", n)]
    parameters = tracer.symbols("theta_b", model.l) if theta else []
    return [*q, *(s for s, _ in sincos), *(c for _, c in sincos), *rates, *parameters]


def polynomial_values(diagram: Diagram, rows: Sequence[Scalar]) -> dict[int, Scalar]:
    """The diagram's polynomials by output number, computed on the rows' values."""
    nodes: list[Scalar] = [0.0] * (ONE + 1)
    nodes[ONE] = 1.0
    for level in diagram.levels:
        _append_nodes(nodes, level, rows[level.row])
    return {
        output: nodes[root] * factor
        for output, root, factor in zip(
            diagram.output.tolist(), diagram.root.tolist(), diagram.factor.tolist(), strict=True
        )
    }


def _append_nodes(nodes: list[Scalar], level: Level, row: Scalar) -> None:
    for child, ratio in zip(level.child.tolist(), level.ratio.tolist(), strict=True):
        parts = [None if c == NOTHING else nodes[c] * r for c, r in zip(child, ratio, strict=True)]
        nodes.append(_horner(parts, row))


def _horner(parts: Sequence[Scalar | None], row: Scalar) -> Scalar:
    """parts[0] + row * (parts[1] + row * parts[2]), where None is nothing."""
    constant, linear, square = parts
    if square is None:
        value = linear * row
    elif linear is None:
        value = square * (row * row)
    else:
        value = (linear + row * square) * row
    return value if constant is None else constant + value
