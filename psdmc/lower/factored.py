"""The factored lowering: a method that makes code from recursive rigid-body algorithms. They are recorded on symbols,
for a robot with new link frames and few nonzero parameters.

There is one PROGRAM (list of operations) per generated function. An Arrangement contains everything that can be chosen
freely, and lower/search.py chooses it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import isqrt
from typing import Any

import numpy as np

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.coordinates import leading
from psdmc.dynamics.frames import Frame, as_vector
from psdmc.dynamics.parameters import bodies_about
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.dynamics.spatial import Body
from psdmc.errors import InternalError
from psdmc.lower.link_parameters import bodies_from_carriers
from psdmc.lower.reframe import Reframed, placed_loops
from psdmc.program.cost import Cost
from psdmc.program.dimensions import INERTIA, LENGTH, MASS, MOMENT, NUMBER, Dimension, dimension_of, times
from psdmc.program.program import Program, Slot, slots_of
from psdmc.program.signature import OF_ROWS, Quantity, Signature, Sizes
from psdmc.program.trace import Number, Symbol, Tracer
from psdmc.program.trace import Outputs as Recorded
from psdmc.recipes.recipe import ByTheta, Ingredients, Outputs, Recipe
from psdmc.robot.mechanism import Array, Loop, Mechanism, NamedFrame, Placement


@dataclass(frozen=True, slots=True, eq=False)
class RobotConstants:
    """The data of a model that are needed to record any function: the robot, its sizes, and its parameters as functions
    of theta_b.

    representative  (11 n, l)  matrix from theta_b to standard parameters about the link frames
    theta_b         (l,)  values; None: theta_b is an input of the PROGRAM
    """

    chain: Mechanism
    representative: Array
    theta_b: Array | None
    sizes: Sizes


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """One possible form of the code of a model: link frames, unit of length, nonzero parameters and options of the
    recursions.

    reframed  joint frames and placements
    unit      m, unit of length inside the code; a multiplication by a length of one unit is left out
    carriers  indices (11 per link) of the link parameters that represent the model; all others are zero
    transfer  (len(carriers), l)  matrix from theta_b to the carriers' values
    choices   options of the recursions
    is_basis  True if no carrier can be left out; else the carriers are all parameters that theta_b contains
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
    """Return the PROGRAM (list of operations) of one function that uses masses and inertias. If theta_b is unknown, it
    is an input."""
    return Recording.of(recipe, arrangement, robot).program()


def cost_of_dynamics(recipe: Recipe, arrangement: Arrangement, robot: RobotConstants) -> Cost:
    """Return the numbers of operations of the PROGRAM that trace_dynamics would return."""
    return Recording.of(recipe, arrangement, robot).cost()


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """The operations of one function in an arrangement (frames, parameters, options), recorded on symbols. They can be
    counted, or become a PROGRAM."""

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
    """Return the PROGRAM (list of operations) of one function that depends on the robot's geometry, but not on masses
    and inertias."""
    tracer = Tracer()
    inputs = _inputs(recipe, robot, tracer)
    return tracer.finish(traced(recipe, robot, reframed, inputs, (), (), PLAIN, 1.0, without_bodies))


def without_bodies() -> ByTheta:
    """Return no bodies, for functions that have none as functions of theta_b."""
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
    """Record the operations of a function on symbols, for the given frames, bodies and inputs. Return every entry of
    the outputs with its slot (output name and index)."""
    is_scaled = unit != 1.0 and are_scaled((*recipe.signature.inputs, *recipe.signature.stored))
    axes = (
        own_axes(reframed.frames, reframed.named, [NUMBER] * robot.sizes.l, reframed.loops)
        if is_scaled
        else {}
    )
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
        loops=reframed.loops,
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
    """Return every entry of a function's recorded outputs with its slot (output name and index), in order of storing.
    Raises InternalError if the outputs do not fit the signature."""
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
    """Return the values of the carriers (the nonzero link parameters): numbers, or symbols if theta_b is unknown."""
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
    """Return frames and placements with all lengths in another unit. A length equal to this unit becomes exactly
    one."""
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
        loops=placed_loops(reframed.loops, lambda end: placed(end.placement)),
    )


def _ratio(value: float, unit: float) -> float:
    ratio = value / unit
    return float(round(ratio)) if abs(abs(ratio) - 1.0) < 1e-13 else ratio


# Units inside a trace
#
# psdmc chooses a unit of length, u metres, so that one length of the robot is exactly one. Energies stay in J, times in
# s. Masses are then in kg/u^2. A quantity of dimension kg^a m^b s^c is its value in SI times u^(2a - b). The robot's data
# in a trace are in these units. The inputs and outputs of a function are in SI, and `traced` converts them. If a
# coordinate of the robot is a length, u is 1. Base parameters stay in SI. Authors of functions need not know these units.


Axes = Mapping[str, Sequence[Dimension]]
"""The dimensions that entries have along an axis, by its word."""

RATE = dimension_of("1/s")

TWIST = (*[LENGTH] * 3, *[NUMBER] * 3)
"""Of three linear axes and three angular ones."""

STANDARD = (MASS, *(MOMENT,) * 3, *(INERTIA,) * 7)
"""Of a link's standard parameters; the drive inertia of a sliding joint has another."""


def own_axes(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    theta_b: Sequence[Dimension],
    loops: Sequence[Loop] = (),
) -> Axes:
    """Return the physical dimensions of the entries along each kind of array axis (such as nq or nv), for a robot with
    these frames."""
    joints = [frame.joint for frame in leading(frames)]
    nq, nv = (
        [Dimension(0, order) for joint in joints for order in getattr(joint, orders)]
        for orders in ("q_orders", "v_orders")
    )
    contacts = [axis for each in named for axis in TWIST[: each.rows]]
    closed = [TWIST[row] for loop in loops for row in loop.rows]
    rates, accelerations = [times(each, RATE) for each in nv], [times(each, RATE, 2) for each in nv]
    return {
        "n": [NUMBER] * len(frames),
        "nq": nq,
        "nv": nv,
        "nx": [*nv, *rates],
        "nxa": [*nv, *rates, *accelerations],
        "nxu": [*nv, *rates, *(times(dimension_of("J"), each, -1) for each in nv)],
        "l": theta_b,
        "frames": [NUMBER] * len(named),
        "contacts": [NUMBER] * len([each for each in named if each.rows]),
        "constraints": [NUMBER] * (len([each for each in named if each.rows]) + len(loops)),
        **dict(zip(OF_ROWS, (contacts, closed, contacts + closed), strict=True)),
        "6": TWIST,
    }


def dimensions_of_traced(signature: Signature, axes: Axes) -> dict[str, list[Dimension]]:
    """Return the physical dimensions of all entries that a trace (recorded function) computes, by output.

    If an output is a matrix product, the trace computes its two factors. The right factor has a row per column of the
    output.
    """
    found = {quantity.name: quantity.dimensions(axes) for quantity in signature.stored}
    for product in signature.products:
        n = isqrt(len(found[product.output]))
        output, left = found[product.output][:n], found[product.left][:n]
        found[product.right] = [times(column, row, -1) for column in output for row in left]
    return found


def multiple(unit: float, dimension: Dimension) -> float:
    """Return the factor that converts a quantity of this dimension from SI to the units inside a trace, whose unit of
    length is `unit` m."""
    order = int(dimension.order)
    size = math.prod([unit] * abs(order))
    return size if order >= 0 else 1.0 / size


def are_scaled(quantities: Iterable[Quantity]) -> bool:
    """Return whether one of these quantities has another value in the units inside a trace than in SI, for robots
    without sliding joints."""
    return any(quantity.dimension.order or {"6", *OF_ROWS} & {*quantity.axes} for quantity in quantities)


def scaled_parameters(x: Array, unit: float) -> Array:
    """Return standard parameters in the units inside a trace, whose unit of length is `unit` m. There are 11 per link,
    along the first axis of x or the last."""
    if unit == 1.0:
        return x
    row = np.array([multiple(unit, each) for each in STANDARD])
    found: Array = x * row if x.shape[-1] == len(row) else x * np.tile(row, len(x) // len(row))[:, None]
    return found
