"""A check that a generated function adds no unlike quantities, such as a mass and a length.

The function is traced (recorded on symbols) once more, with symbols that have dimensions. Each length, mass and so
on of the robot is then an input with its dimension, not a constant. Otherwise constants of different dimensions could
be combined to one number. The search uses traces without dimensions, so the check does not slow it down.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.frames import Frame, Mimic
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.dynamics.spatial import Body
from psdmc.errors import InputError
from psdmc.lower.factored import STANDARD, RobotConstants, dimensions_of_traced, own_axes, stored_entries
from psdmc.lower.reframe import Reframed, placed_loops
from psdmc.program.dimensions import (
    ACCELERATION,
    INERTIA,
    LENGTH,
    MASS,
    MOMENT,
    NUMBER,
    Dimension,
    Known,
    Unlike,
    dimension_of,
    in_words,
    raised,
    times,
)
from psdmc.program.program import Op, Slot
from psdmc.program.trace import Constant, Step, Symbol, Tracer, arguments_of
from psdmc.recipes.recipe import ByTheta, Ingredients, Outputs, Recipe
from psdmc.robot.mechanism import DRIVE, PARAMETERS_PER_LINK, Array, Placement

HINT = (
    "g's lengths, masses and inputs have units: write a constant that has one as g.si(0.3, 'm'), and give each input and "
    "output of the signature its unit"
)


def check_dimensions(
    recipe: Recipe, reframed: Reframed, robot: RobotConstants, choices: Choices = PLAIN
) -> None:
    """Raise InputError if the function adds, compares or chooses between unlike quantities. Raise InputError also if
    exp or a similar function has an argument with a unit, or if an output has another unit than its signature says.

    Robots with a joint type that contains a length, such as the pitch of a screw, are not checked, because the check
    sees this length as a number without a unit.
    """
    if any(frame.joint.has_length for frame in reframed.frames):
        return
    signature = recipe.signature
    for quantity in (*signature.inputs, *signature.stored):
        if not quantity.unit:
            raise InputError(
                f"{recipe.name}: {quantity.name} has no unit",
                f"give it one in the signature: Quantity({quantity.name!r}, ..., unit='m')",
            )
    measured = _Measured(reframed, robot)
    try:
        outputs = recipe.trace(measured.ingredients(recipe, choices))
    except UnlikeArguments as unlike:
        raise InputError(f"{recipe.name}: {unlike}{_line(recipe, unlike)}", HINT) from unlike
    measured.compare(recipe, outputs)


def _line(recipe: Recipe, error: Exception) -> str:
    """Where in the function's file an error is from."""
    path = recipe.trace.__code__.co_filename
    lines = [each for each in traceback.extract_tb(error.__traceback__) if each.filename == path]
    return f" ({Path(path).name}, line {lines[-1].lineno}: {lines[-1].line})" if lines else ""


class _Placed(Placement):
    """A placement whose lengths are symbols."""

    __slots__ = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "translation", np.array(self.translation, dtype=object))


class _Measured:
    """One robot's ingredients as inputs with dimensions."""

    def __init__(self, reframed: Reframed, robot: RobotConstants) -> None:
        self.reframed, self.robot = reframed, robot
        self.tracer = DimensionedTracer()
        self._numbers = count()
        self.theta_b, self.standard = _theta_dimensions(robot.representative, reframed.frames)
        self.axes = own_axes(reframed.frames, reframed.named, self.theta_b, reframed.loops)

    def value(self, dimension: Dimension) -> Scalar:
        return self.tracer.measured(Slot("ingredient", next(self._numbers)), dimension)

    def vector(self, v: Sequence[float], dimension: Dimension) -> Vector:
        x, y, z = (self.value(dimension) if each else 0.0 for each in v)
        return (x, y, z)

    def placed(self, place: Placement) -> Placement:
        return _Placed(place.rotation, self.vector(place.translation.tolist(), LENGTH))  # type: ignore[arg-type]

    def frame(self, frame: Frame) -> Frame:
        mimic = frame.mimic
        if mimic is not None:
            own, shares = Dimension(0, frame.joint.length_order), []
            for leader, ratio in mimic.shares:
                other = Dimension(0, self.reframed.frames[leader].joint.length_order)
                shares.append((leader, ratio if own == other else self.value(times(own, other, -1))))
            mimic = Mimic(tuple(shares), mimic.offset and self.value(own))
        return replace(frame, translation=self.vector(frame.translation, LENGTH), mimic=mimic)

    def bodies(self, of: Callable[[Dimension], Scalar]) -> tuple[tuple[Body, ...], tuple[Scalar, ...]]:
        """Return all bodies and drive inertias as symbols: `of` makes the symbol for each entry, from the entry's
        dimension."""
        bodies = []
        for _ in self.reframed.frames:
            mass, *entries = (of(each) for each in (MASS, *(MOMENT,) * 3, *(INERTIA,) * 6))
            bodies.append(Body(mass, tuple(entries[:3]), tuple(entries[3:])))
        return tuple(bodies), tuple(of(each) for each in self.standard[DRIVE::PARAMETERS_PER_LINK])

    def by_theta(self) -> ByTheta:
        """Return all bodies and drive inertias as functions of theta_b, for the check of dimensions. Each entry is
        proportional to one base parameter; the base parameters are used in turn."""
        theta_b = [
            self.tracer.measured(Slot("theta_b", k), dimension) for k, dimension in enumerate(self.theta_b)
        ]
        turns = count()

        def of(dimension: Dimension) -> Scalar:
            k = next(turns) % len(theta_b)
            return theta_b[k] * self.value(times(dimension, self.theta_b[k], -1))

        return ByTheta(theta_b, *self.bodies(of))

    def lift(self) -> Array:
        found = self.robot.representative.astype(object)
        for row, column in np.argwhere(self.robot.representative).tolist():
            found[row, column] = self.value(times(self.standard[row], self.theta_b[column], -1))
        return found

    def ingredients(self, recipe: Recipe, choices: Choices) -> Ingredients:
        own, signature = self.reframed, recipe.signature
        bodies, drives = self.bodies(self.value) if signature.theta else ((), ())
        has_parameters = any("l" in quantity.axes for quantity in signature.stored)
        return Ingredients(
            frames=tuple(map(self.frame, own.frames)),
            base_acceleration=self.vector(own.base_acceleration, ACCELERATION),
            bodies=bodies,
            drives=drives,
            choices=choices,
            base_axes=own.base_axes,
            base_origin=self.vector(own.base_origin, LENGTH),
            link_frames=tuple(map(self.placed, own.link_frames)),
            named=tuple(replace(each, placement=self.placed(each.placement)) for each in own.named),
            loops=placed_loops(own.loops, lambda end: self.placed(end.placement)),
            tip=self.placed(own.tip),
            tip_body=own.tip_body,
            lift=self.lift() if has_parameters else self.robot.representative,
            link_bodies=lambda: self.bodies(self.value)[0],
            si=lambda value, unit: self.value(dimension_of(unit)) if value else 0.0,
            inputs={
                quantity.name: [
                    self.tracer.measured(Slot(quantity.name, i), dimension)
                    for i, dimension in enumerate(quantity.dimensions(self.axes))
                ]
                for quantity in signature.inputs
            },
            by_theta=self.by_theta,
        )

    def compare(self, recipe: Recipe, outputs: Outputs) -> None:
        wanted = dimensions_of_traced(recipe.signature, self.axes)
        for slot, value in stored_entries(recipe.signature, outputs):
            found, unit = self.tracer.dimension(value), wanted[slot.vector][slot.index]
            if found is not None and found != unit:
                raise InputError(
                    f"{recipe.name}: {slot} is {in_words(found)}, its unit in the signature {in_words(unit)}",
                    HINT,
                )


def _theta_dimensions(lift: Array, frames: Sequence[Frame]) -> tuple[list[Dimension], list[Dimension]]:
    """Return the dimensions of base and of standard parameters. A base parameter has that of its first standard
    parameter."""
    standard = [
        Dimension(1, frame.joint.drive_order) if name == DRIVE else each
        for frame in frames
        for name, each in enumerate(STANDARD)
    ]
    return [standard[row] for row in (lift != 0).argmax(axis=0).tolist()], standard


# The tracer whose values have dimensions


_WORDS = {Op.ADD: "sum", Op.SUB: "difference", Op.MIN: "minimum", Op.MAX: "maximum", Op.SELECT: "choice"}

_append = list.append


class UnlikeArguments(Exception):
    """This error says that an operation has arguments of unlike dimensions. The message has the operation and the units
    of the arguments."""


class DimensionedTracer(Tracer):
    """A tracer (recorder of operations on symbols) that checks the physical dimensions of each operation. Symbols
    append each operation to the list `steps`, and this list makes the check."""

    __slots__ = ("_own",)

    def __init__(self) -> None:
        super().__init__()
        self.steps = self._own = _Steps(self.constants)

    def measured(self, slot: Slot, dimension: Known) -> Symbol:
        """One input of this dimension."""
        self._own.given[slot] = dimension
        return self.symbol(slot)

    def dimension(self, value: Symbol | Constant) -> Known:
        """The dimension of a value."""
        if isinstance(value, Symbol):
            return self._own.dimension(value.index)
        return None if value == 0 else NUMBER

    def stand_ins(self, vector: str, values: Sequence[Symbol | Constant]) -> list[Symbol]:
        return [self.measured(Slot(vector, i), self.dimension(value)) for i, value in enumerate(values)]


class _Steps(list[Step]):
    """Steps, and beside them the dimensions of their values.

    kinds    by step, the number of its dimension in
    seen     all dimensions that there are, and their numbers in
    number   the opposite way
    results  by an operation and the numbers of its two arguments that of its value: most steps are found here
    """

    __slots__ = ("constants", "given", "kinds", "number", "results", "seen")

    def __init__(self, constants: Mapping[int, Constant]) -> None:
        super().__init__()
        self.constants = constants
        self.given: dict[Slot, Known] = {}
        self.kinds: list[int] = []
        self.seen: list[Known] = []
        self.number: dict[Known, int] = {}
        self.results: dict[tuple[Op, int, int], int] = {}

    def dimension(self, index: int) -> Known:
        return self.seen[self.kinds[index]]

    def append(self, step: Step) -> None:
        op, a, b = step
        kinds = self.kinds
        kind = None if b is None else self.results.get((op, kinds[a], kinds[b]))
        kinds.append(self._kind(step) if kind is None else kind)
        _append(self, step)

    def _kind(self, step: Step) -> int:
        op, a, b = step
        dimension = self._dimension(step)
        kind = self.number.setdefault(dimension, len(self.seen))
        if kind == len(self.seen):
            self.seen.append(dimension)
        if b is not None and op is not Op.POW:
            self.results[op, self.kinds[a], self.kinds[b]] = kind
        return kind

    def _dimension(self, step: Step) -> Known:
        op, a, b = step
        if op is Op.LOAD:
            return self.given[a]
        if op is Op.CONST:
            return NUMBER if a else None
        own = [self.dimension(argument) for argument in arguments_of(step)]
        try:
            return raised(own[0], own[1], self._value(b)) if op is Op.POW else op.operation.dimension(*own)
        except Unlike as unlike:
            raise UnlikeArguments(f"{_WORDS.get(op, op.value)} of {unlike}") from None

    def _value(self, exponent: int) -> float | None:
        value = self.constants.get(exponent)
        return value if isinstance(value, float) else None
