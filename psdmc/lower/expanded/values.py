"""Evaluation of nested Horner forms (diagram.py). The values of the variables are numbers, or symbols that record the
operations as a PROGRAM."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.scalar import Scalar
from psdmc.lower.expanded.diagram import NOTHING, ONE, Diagram, Level
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.trace import Tracer


def row_symbols(tracer: Tracer, model: DynamicsModel, theta: bool) -> list[Scalar]:
    """Return a symbol for each variable of the polynomials: q, sin q, cos q, qd, qdd of all joints, then theta_b if
    `theta`. The symbols record operations."""
    n = model.n
    q = tracer.symbols("q", n)
    sincos = [
        value.sincos() if joint.basis.has_sincos else (0.0, 0.0)
        for value, joint in zip(q, model.mechanism.types, strict=True)
    ]
    rates = [*tracer.symbols("qd", n), *tracer.symbols("qdd", n)]
    parameters = tracer.symbols("theta_b", model.l) if theta else []
    return [*q, *(s for s, _ in sincos), *(c for _, c in sincos), *rates, *parameters]


def polynomial_values(diagram: Diagram, rows: Sequence[Scalar]) -> dict[int, Scalar]:
    """Return the value of each polynomial of the diagram by its number, from the values of the variables (rows)."""
    nodes: dict[int, Scalar] = {NOTHING: 0.0, ONE: 1.0}
    for level in diagram.levels:
        _compute_level(nodes, level, rows[level.row])
    return {
        output: nodes[root] * factor
        for output, root, factor in zip(
            diagram.output.tolist(), diagram.root.tolist(), diagram.factor.tolist(), strict=True
        )
    }


def _compute_level(nodes: dict[int, Scalar], level: Level, row: Scalar) -> None:
    parts = zip(level.child.tolist(), level.ratio.tolist(), strict=True)
    for number, (child, ratio) in enumerate(parts, start=level.first):
        scaled = [None if c == NOTHING else nodes[c] * r for c, r in zip(child, ratio, strict=True)]
        nodes[number] = _horner(scaled, row)


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
