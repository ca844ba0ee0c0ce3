"""The factored lowering: trace the rigid-body algorithms over a re-framed chain with sparse equivalent parameters.

One PROGRAM per generated function. What can be chosen freely is in an Arrangement; lower/search.py chooses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from psdmc.dynamics.body import Body
from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.frames import as_vector
from psdmc.dynamics.parameters import bodies_about
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.errors import InternalError
from psdmc.lower.link_parameters import bodies_from_carriers
from psdmc.lower.reframe import Reframed
from psdmc.lower.units import are_scaled, dimensions_of_traced, multiple, own_axes, scaled_parameters
from psdmc.program.cost import Cost
from psdmc.program.dimensions import NUMBER, dimension_of
from psdmc.program.program import Program, Slot, slots_of
from psdmc.program.signature import Signature, Sizes
from psdmc.program.trace import Number, Symbol, Tracer
from psdmc.program.trace import Outputs as Recorded
from psdmc.recipes.recipe import ByTheta, Ingredients, Outputs, Recipe
from psdmc.robot.mechanism import Array, Mechanism, Placement


@dataclass(frozen=True, slots=True, eq=False)
class RobotConstants:
    """The parts of a model that every trace needs.

    representative  (11 n, l)  theta_b to standard parameters about the link frames
    theta_b         (l,)       None: an input of the PROGRAM
    """

    chain: Mechanism
    representative: Array
    theta_b: Array | None
    sizes: Sizes


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """One way to lower a model.

    reframed  geometry
    unit      m, unit of length inside the code (units.py); a length equal to it costs no multiplication
    carriers  which link parameters carry the model (indices, 11 per link)
    transfer  (len(carriers), l)  theta_b to their values
    choices   how the recursions are arranged
    is_basis  whether no carrier could be left out; else they are all parameters that theta_b has a part in
    """

    reframed: Reframed
    unit: float
    carriers: tuple[int, ...]
    transfer: Array
    choices: Choices
    is_basis: bool = True

    @property
    def n(self) -> int:
        return len(self.reframed.frames)


def trace_dynamics(recipe: Recipe, arrangement: Arrangement, robot: RobotConstants) -> Program:
    """The PROGRAM of one function that needs bodies. Unknown base parameters become an input."""
    return Recording.of(recipe, arrangement, robot).program()


def cost_of_dynamics(recipe: Recipe, arrangement: Arrangement, robot: RobotConstants) -> Cost:
    """The cost of the PROGRAM that trace_dynamics would return."""
    return Recording.of(recipe, arrangement, robot).cost()


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """What one function does in an arrangement, on a tracer's symbols: to be counted, and to become a PROGRAM."""

    tracer: Tracer
    outputs: Recorded

    @staticmethod
    def of(recipe: Recipe, arrangement: Arrangement, robot: RobotConstants) -> Recording:
        tracer = Tracer()
        return Recording(tracer, _recorded(recipe, arrangement, robot, tracer))

    def cost(self) -> Cost:
        """The cost of the PROGRAM."""
        return self.tracer.cost(self.outputs)

    def program(self) -> Program:
        return self.tracer.finish(self.outputs)


def _recorded(recipe: Recipe, arrangement: Arrangement, robot: RobotConstants, tracer: Tracer) -> Recorded:
    inputs = _inputs(recipe, robot, tracer)
    n, unit = arrangement.n, arrangement.unit
    values = carrier_values(arrangement, robot.theta_b, tracer)
    bodies, drives = bodies_from_carriers(n, arrangement.carriers, values, unit)
    scaled = in_unit(arrangement.reframed, unit)

    def by_theta() -> ByTheta:
        symbols = carrier_values(arrangement, None, tracer)
        return ByTheta(
            tracer.symbols("theta_b", arrangement.transfer.shape[1]),
            *bodies_from_carriers(n, arrangement.carriers, symbols, unit),
        )

    return traced(recipe, robot, scaled, inputs, bodies, drives, arrangement.choices, unit, by_theta)


def trace_geometry(recipe: Recipe, reframed: Reframed, robot: RobotConstants) -> Program:
    """The PROGRAM of one function that needs no theta_b."""
    tracer = Tracer()
    inputs = _inputs(recipe, robot, tracer)
    return tracer.finish(traced(recipe, robot, reframed, inputs, (), (), PLAIN, 1.0, _without_bodies))


def _without_bodies() -> ByTheta:
    return ByTheta([], (), ())


def traced(
    recipe: Recipe,
    robot: RobotConstants,
    reframed: Reframed,
    inputs: Mapping[str, list[Any]],
    bodies: tuple[Body, ...],
    drives: tuple[Scalar, ...],
    choices: Choices,
    unit: float,
    by_theta: Callable[[], ByTheta],
) -> Recorded:
    """Record a recipe on these frames, bodies and symbols: every entry of its outputs with its slot."""
    is_scaled = unit != 1.0 and are_scaled((*recipe.signature.inputs, *recipe.signature.stored))
    axes = own_axes(reframed.frames, reframed.named, [NUMBER] * robot.sizes.l) if is_scaled else {}
    for quantity in recipe.signature.inputs if is_scaled else ():
        own = zip(inputs[quantity.name], quantity.dimensions(axes), strict=True)
        inputs = {**inputs, quantity.name: [symbol * multiple(unit, each) for symbol, each in own]}
    ingredients = Ingredients(
        frames=reframed.frames,
        base_acceleration=reframed.base_acceleration,
        bodies=bodies,
        drives=drives,
        choices=choices,
        base_axes=reframed.base_axes,
        base_origin=reframed.base_origin,
        link_frames=reframed.link_frames,
        named=reframed.named,
        tip=reframed.tip,
        tip_body=reframed.tip_body,
        lift=_lift(robot, unit),
        link_bodies=lambda: bodies_about(
            reframed.link_frames, scaled_parameters(robot.chain.parameters, unit)
        ),
        si=lambda value, word: value * multiple(unit, dimension_of(word)),
        inputs=inputs,
        by_theta=by_theta,
    )
    found = stored_entries(recipe.signature, recipe.trace(ingredients))
    if not is_scaled:
        return found
    dimensions = dimensions_of_traced(recipe.signature, axes)
    return [(slot, value / multiple(unit, dimensions[slot.vector][slot.index])) for slot, value in found]


@lru_cache(maxsize=4)
def _lift(robot: RobotConstants, unit: float) -> Array:
    return scaled_parameters(robot.representative, unit)


def _inputs(recipe: Recipe, robot: RobotConstants, tracer: Tracer) -> dict[str, list[Symbol]]:
    return {q.name: tracer.symbols(q.name, robot.sizes.size(q)) for q in recipe.signature.inputs}


def stored_entries(signature: Signature, outputs: Outputs) -> Recorded:
    """Every entry of a trace's outputs with its slot, in order of storing; InternalError where they do not fit the
    signature."""
    if outputs.keys() != signature.traced:
        raise InternalError(f"{signature.name}: its trace gives {', '.join(outputs)}")
    found: list[tuple[Slot, Symbol | Number]] = []
    for name, values in outputs.items():
        flat = _flat(values)
        found += zip(slots_of(name, len(flat)), flat, strict=True)
    return found


def _flat(values: Any) -> list[Symbol | Number]:
    """Entries of nested sequences, row by row."""
    return [x for value in values for x in _flat(value)] if isinstance(values, list | tuple) else [values]


def carrier_values(arrangement: Arrangement, theta_b: Array | None, tracer: Tracer) -> list[Scalar]:
    """Values of the carriers; of a theta_b that is not known as symbols."""
    transfer = arrangement.transfer
    rows, columns = np.nonzero(transfer)
    factors = transfer[rows, columns]
    if theta_b is not None:
        parts = (factors * theta_b[columns]).tolist()
        ends = np.searchsorted(rows, range(1, len(transfer) + 1)).tolist()
        return [math.fsum(parts[start:end]) for start, end in pairwise([0, *ends])]
    theta = tracer.symbols("theta_b", transfer.shape[1])
    values: list[Scalar] = [0.0] * len(transfer)
    for row, column, factor in zip(rows.tolist(), columns.tolist(), factors.tolist(), strict=True):
        values[row] = values[row] + theta[column] * factor
    return values


@lru_cache(maxsize=64)
def in_unit(reframed: Reframed, unit: float) -> Reframed:
    """The geometry in another unit of length; a length equal to it becomes exactly one."""
    if unit == 1.0:
        return reframed

    def scaled(v: Vector) -> Vector:
        x, y, z = (_ratio(value, unit) for value in v)
        return (x, y, z)

    def placed(place: Placement) -> Placement:
        return Placement(place.rotation, np.array(scaled(as_vector(place.translation.tolist()))))

    return replace(
        reframed,
        frames=tuple(replace(f, translation=scaled(f.translation)) for f in reframed.frames),
        base_acceleration=scaled(reframed.base_acceleration),
        link_frames=tuple(map(placed, reframed.link_frames)),
        tip=placed(reframed.tip),
        base_origin=scaled(reframed.base_origin),
        named=tuple(replace(frame, placement=placed(frame.placement)) for frame in reframed.named),
    )


def _ratio(value: float, unit: float) -> float:
    ratio = value / unit
    return float(round(ratio)) if abs(abs(ratio) - 1.0) < 1e-13 else ratio
