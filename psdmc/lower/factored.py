"""The factored lowering: trace the rigid-body algorithms over a re-framed chain with sparse equivalent parameters.

One PROGRAM per generated function. What can be chosen freely is in an Arrangement; lower/search.py chooses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from psdmc.dynamics.body import Body
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.kinematics import jacobian
from psdmc.dynamics.motion import Choices
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, dot
from psdmc.lower.carriers import bodies_from_carriers
from psdmc.lower.reframe import Reframed
from psdmc.lower.solve import factorize, solve
from psdmc.program.cost import Cost
from psdmc.program.functions import BY_NAME
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Number, Outputs, Symbol, Tracer
from psdmc.robot.chain import Array


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """One way to lower a model.

    reframed  geometry
    unit      m, unit of length inside the code; a length equal to it costs no multiplication
    carriers  which link parameters carry the model (indices, 11 per link)
    transfer  (len(carriers), l)  theta_b to their values
    choices   how the recursions are arranged
    """

    reframed: Reframed
    unit: float
    carriers: tuple[int, ...]
    transfer: Array
    choices: Choices

    @property
    def n(self) -> int:
        return len(self.reframed.frames)


@dataclass(frozen=True, slots=True)
class Ingredients:
    """What the recursions run on, in the arrangement's unit of length."""

    reframed: Reframed
    base: Vector
    bodies: tuple[Body, ...]
    drives: tuple[Scalar, ...]
    choices: Choices
    inputs: dict[str, list[Symbol]]


Values = Sequence[Scalar]


def trace_dynamics(name: str, arrangement: Arrangement, theta_b: Array | None) -> Program:
    """The PROGRAM of one function that needs bodies; theta_b None makes it an input."""
    tracer = Tracer()
    return drop_unused(tracer.finish(_recorded(name, arrangement, theta_b, tracer)))


def cost_of_dynamics(name: str, arrangement: Arrangement, theta_b: Array | None) -> Cost:
    """What that PROGRAM costs."""
    tracer = Tracer()
    return tracer.cost(_recorded(name, arrangement, theta_b, tracer))


def _recorded(name: str, arrangement: Arrangement, theta_b: Array | None, tracer: Tracer) -> Outputs:
    function = BY_NAME[name]
    n = arrangement.n
    inputs = {vector: tracer.symbols(vector, n) for vector in function.inputs}
    values = _carrier_values(arrangement, theta_b, tracer)
    scaled = in_unit(arrangement.reframed, arrangement.unit)
    bodies, drives = bodies_from_carriers(n, arrangement.carriers, values, arrangement.unit)
    ingredients = Ingredients(scaled, scaled.base, bodies, drives, arrangement.choices, inputs)
    return _TRACES[name](ingredients)


def _carrier_values(arrangement: Arrangement, theta_b: Array | None, tracer: Tracer) -> list[Scalar]:
    if theta_b is not None:
        return [math.fsum(row * theta_b) for row in arrangement.transfer]
    theta = tracer.symbols("theta_b", arrangement.transfer.shape[1])
    values: list[Scalar] = []
    for row in arrangement.transfer.tolist():
        total: Scalar = 0.0
        for factor, symbol in zip(row, theta, strict=True):
            total = total + symbol * factor
        values.append(total)
    return values


def in_unit(reframed: Reframed, unit: float) -> Reframed:
    """Lengths and accelerations in another unit of length; a length equal to it becomes exactly one."""
    if unit == 1.0:
        return reframed

    def scaled(v: Vector) -> Vector:
        x, y, z = (_ratio(value, unit) for value in v)
        return (x, y, z)

    frames = tuple(replace(f, translation=scaled(f.translation)) for f in reframed.frames)
    return replace(reframed, frames=frames, base=scaled(reframed.base))


def _ratio(value: float, unit: float) -> float:
    ratio = value / unit
    return float(round(ratio)) if abs(abs(ratio) - 1.0) < 1e-13 else ratio


def _vector(name: str, values: Sequence[Scalar]) -> list[tuple[Slot, Symbol | Number]]:
    return [(Slot(name, i), value) for i, value in enumerate(values)]


def _matrix(name: str, rows: Sequence[Sequence[Scalar]]) -> list[tuple[Slot, Symbol | Number]]:
    return _vector(name, [value for row in rows for value in row])


def _torques(
    g: Ingredients, qd: Values, qdd: Values, base: Vector, qd_r: Values | None = None
) -> tuple[Scalar, ...]:
    frames = g.reframed.frames
    return inverse_dynamics(frames, g.bodies, g.drives, g.inputs["q"], qd, qdd, base, g.choices, qd_r)


def _still(g: Ingredients) -> list[Scalar]:
    return [0.0] * len(g.bodies)


def _inverse_dynamics(g: Ingredients) -> list[tuple[Slot, Symbol | Number]]:
    return _vector("tau", _torques(g, g.inputs["qd"], g.inputs["qdd"], g.base))


def _nonlinear_effects(g: Ingredients) -> list[tuple[Slot, Symbol | Number]]:
    return _vector("h", _torques(g, g.inputs["qd"], _still(g), g.base))


def _gravity(g: Ingredients) -> list[tuple[Slot, Symbol | Number]]:
    still = _still(g)
    return _vector("g", _torques(g, still, still, g.base))


def _mass_matrix(g: Ingredients) -> list[tuple[Slot, Symbol | Number]]:
    return _matrix("M", mass_matrix(g.reframed.frames, g.bodies, g.drives, g.inputs["q"], g.choices))


def _coriolis_matrix(g: Ingredients) -> list[tuple[Slot, Symbol | Number]]:
    """Column j is the Slotine-Li torque of a unit reference rate of joint j, without gravity."""
    n = len(g.bodies)
    columns = []
    for j in range(n):
        unit: list[Scalar] = [1.0 if i == j else 0.0 for i in range(n)]
        columns.append(_torques(g, g.inputs["qd"], _still(g), ZERO, unit))
    return _matrix("C", list(zip(*columns, strict=True)))


def _forward_dynamics(g: Ingredients) -> list[tuple[Slot, Symbol | Number]]:
    """The mass matrix is factorized before the bias is found: its divisions wait for each other, the recursion fills
    the time."""
    factors = factorize(mass_matrix(g.reframed.frames, g.bodies, g.drives, g.inputs["q"], g.choices))
    bias = _torques(g, g.inputs["qd"], _still(g), g.base)
    load = [tau - h for tau, h in zip(g.inputs["tau"], bias, strict=True)]
    return _vector("qdd", solve(factors, load)) + _vector("pivot", factors.pivots)


_TRACES: dict[str, Callable[[Ingredients], list[tuple[Slot, Symbol | Number]]]] = {
    "inverse_dynamics": _inverse_dynamics,
    "forward_dynamics": _forward_dynamics,
    "mass_matrix": _mass_matrix,
    "nonlinear_effects": _nonlinear_effects,
    "coriolis_matrix": _coriolis_matrix,
    "gravity": _gravity,
}


def trace_regressor(name: str, reframed: Reframed, representative: Array) -> Program:
    """The PROGRAM of the regressor (name "regressor" or "regressor_slotine_li") with columns in theta_b's order.

    representative  (11 n, l)  theta_b to standard parameters about the link frames
    """
    tracer, function = Tracer(), BY_NAME[name]
    n, l = len(reframed.frames), representative.shape[1]
    inputs = {vector: tracer.symbols(vector, n) for vector in function.inputs}
    needed = [j for j in range(11 * n) if representative[j].any()]
    accelerations = inputs["qdd_r"] if "qdd_r" in inputs else inputs["qdd"]
    rows = regressor(
        reframed.frames,
        reframed.link_frames,
        set(needed),
        inputs["q"],
        inputs["qd"],
        accelerations,
        reframed.base,
        inputs.get("qd_r"),
    )
    outputs: list[tuple[Slot, Symbol | Number]] = []
    for i, row in enumerate(rows):
        for column in range(l):
            total: Scalar = 0.0
            for j in needed:
                if representative[j, column] and j in row:
                    total = total + row[j] * float(representative[j, column])
            outputs.append((Slot("Y", l * i + column), total))
    return drop_unused(tracer.finish(outputs))


def trace_jacobian(reframed: Reframed) -> Program:
    """The PROGRAM of the tip's geometric Jacobian in the chain's base frame."""
    tracer = Tracer()
    q = tracer.symbols("q", len(reframed.frames))
    rows = jacobian(reframed.frames, reframed.tip_body, reframed.tip, q)
    turned = [
        [dot(axes, (rows[k][j], rows[k + 1][j], rows[k + 2][j])) for j in range(len(q))]
        for k in (0, 3)
        for axes in reframed.base_axes
    ]
    return drop_unused(tracer.finish(_matrix("J", turned)))
