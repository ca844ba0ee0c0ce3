"""A check that a generated function adds no unlike quantities, such as a mass and a length.

The function is traced (recorded on symbols) once more, with symbols that have dimensions (program/dimensioned.py). Each
length, mass and so on of the robot is then an input with its dimension, not a constant. Otherwise constants of
different dimensions could be combined to one number. The search uses traces without dimensions, so the check does not
slow it down.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.frames import Follows, Frame
from psdmc.dynamics.scalar import Scalar, Vector
from psdmc.dynamics.spatial import Body
from psdmc.errors import InputError
from psdmc.lower.factored import RobotConstants, stored_entries
from psdmc.lower.reframe import Reframed, placed_loops
from psdmc.lower.units import STANDARD, dimensions_of_traced, own_axes
from psdmc.program.dimensioned import DimensionedTracer, UnlikeArguments
from psdmc.program.dimensions import (
    ACCELERATION,
    INERTIA,
    LENGTH,
    MASS,
    MOMENT,
    Dimension,
    dimension_of,
    in_words,
    times,
)
from psdmc.program.program import Slot
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
        follows = frame.follows
        if follows is not None:
            own, shares = Dimension(0, frame.joint.length_order), []
            for leader, ratio in follows.shares:
                other = Dimension(0, self.reframed.frames[leader].joint.length_order)
                shares.append((leader, ratio if own == other else self.value(times(own, other, -1))))
            follows = Follows(tuple(shares), follows.offset and self.value(own))
        return replace(frame, translation=self.vector(frame.translation, LENGTH), follows=follows)

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
