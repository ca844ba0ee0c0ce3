"""Gradients, and derivatives along directions, of motions and contact forces: code, NumPy reference and comparison.

The motion x and the contact forces f solve M x - J^T f = r and J x + mu f = w. The residuals M x - J^T f - r and J x - w
are traced with x and f as inputs, and differentiated by the robot's inputs. The matrix of the equations is symmetric, so
gradients and derivatives along directions solve the same equations again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import islice
from typing import Any

import numpy as np

from psdmc.dynamics.constraints import Constrained, solved_again
from psdmc.dynamics.manifold import coordinate_rates, pulled_back
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import Factors
from psdmc.program.dimensions import dimension_of, times
from psdmc.program.interpret import substituted
from psdmc.program.signature import PIVOTS, Quantity, Signature
from psdmc.program.slopes import gradients, slopes
from psdmc.recipes.contacts import Held, Solved
from psdmc.recipes.directions import along, along_direction, direction_of, gradient_by, weighted
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe


@dataclass(frozen=True, slots=True)
class ContactFunction:
    """A function that computes a motion and contact forces, and its derivatives.

    values       the function
    derivatives  the function that computes all Jacobians
    by           inputs by which there are derivatives; q is the first
    solved       solves the equations in a trace
    residuals    returns the nv residuals of the motion, then one per row of the contacts, at a given motion and forces
    """

    values: Recipe
    derivatives: Recipe
    by: tuple[Quantity, ...]
    solved: Callable[[Ingredients], Solved]
    residuals: Callable[[Ingredients, Sequence[Scalar], Sequence[Scalar]], list[Scalar]]

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """The motion and the contact forces."""
        return self.derivatives.signature.outputs[:2]

    @property
    def weights(self) -> tuple[Quantity, ...]:
        """The weights of a sum of the outputs. The sum has the unit of energy here."""
        return tuple(
            Quantity(
                f"cotangent_{each.name}",
                each.axes,
                means=f"weights of the sum: cotangent_{each.name}[i] multiplies {each.name}[i]",
                unit=str(times(dimension_of("J"), each.dimension, -1)),
                powers=tuple(-power for power in each.powers),
            )
            for each in self.outputs
        )

    @property
    def directions(self) -> tuple[Quantity, ...]:
        """Changes of the inputs."""
        return tuple(map(direction_of, self.by))

    def gradient(self, order: int, meaning: str, summary: str) -> Recipe:
        """Return the recipe of the gradient of a weighted sum of the outputs by the inputs."""
        found = tuple(map(gradient_by, self.by))
        return self._recipe("vjp", order, meaning, summary, self.weights, found, "gradient")

    def along(self, order: int, meaning: str, summary: str) -> Recipe:
        """Return the recipe of the derivatives of the outputs along a direction."""
        found = tuple(map(along_direction, self.outputs))
        return self._recipe("jvp", order, meaning, summary, self.directions, found, "along a direction")

    def _recipe(
        self,
        ending: str,
        order: int,
        meaning: str,
        summary: str,
        inputs: tuple[Quantity, ...],
        outputs: tuple[Quantity, ...],
        title: str,
    ) -> Recipe:
        signature = self.values.signature
        required, optional = (
            [i for i in signature.inputs if (i.default is None) is own] for own in (True, False)
        )
        blocks = self._weighted if ending == "vjp" else self._moved
        return Recipe(
            Signature(
                f"{signature.name}_{ending}",
                order,
                meaning,
                (*required, *inputs, *optional),
                (*self.outputs, *outputs),
                theta=True,
                summary=summary,
                factorises=signature.factorises,
            ),
            f"{self.values.title}, {title}",
            (lambda g: self.gradient_and_adjoint(g)[0]) if ending == "vjp" else self._along_trace,
            lambda robot, given: blocks(self.derivatives.reference(robot, dict(given)), given),
            self.derivatives.against,
            lambda robot, given: blocks(self.derivatives.pinocchio(robot, given), given),
            shares="inverse_dynamics",
            matters=self.values.matters,
            closes=True,
        )

    def gradient_and_adjoint(self, g: Ingredients) -> tuple[Outputs, list[Scalar]]:
        """Return the gradient function's outputs, and the adjoint of the motion. The adjoint has the nv derivatives of the
        weighted sum by r, the right-hand side of M x - J^T f = r."""
        found, signs, factors, _ = self.solved(g)
        motion, forces = (g.inputs[each.name] for each in self.weights)
        load, push = solved_again(factors, found, motion, [-each for each in forces], Held.of(g).rows[0])
        inputs = [g.inputs[each.name] for each in self.by]
        free, values = self._free(g, found)
        parts = gradients(values, [*(-each for each in load), *push], inputs)
        rest = iter(substituted([x for part in parts for x in part], free, [*found.motion, *found.forces]))
        blocks = [list(islice(rest, len(part))) for part in inputs]
        blocks[0] = pulled_back(g.frames, inputs[0], blocks[0])
        return self._named(g, found, signs, factors, map(gradient_by, self.by), blocks), load

    def _along_trace(self, g: Ingredients) -> Outputs:
        found, signs, factors, _ = self.solved(g)
        inputs = [x for each in self.by for x in g.inputs[each.name]]
        first, *others = (g.inputs[each.name] for each in self.directions)
        direction = [
            *coordinate_rates(g.frames, g.inputs["q"], first),
            *(x for other in others for x in other),
        ]
        free, values = self._free(g, found)
        changes = substituted(slopes(values, inputs, direction), free, [*found.motion, *found.forces])
        nv = len(found.motion)
        load, wanted = [-x for x in changes[:nv]], [-x for x in changes[nv:]]
        blocks = solved_again(factors, found, load, wanted, Held.of(g).rows[0])
        names = (replace(each, name=f"d{each.name}") for each in self.outputs)
        return self._named(g, found, signs, factors, names, blocks)

    def _named(
        self,
        g: Ingredients,
        found: Constrained,
        signs: Sequence[Scalar],
        factors: Factors,
        names: Any,
        blocks: Sequence[Sequence[Scalar]],
    ) -> Outputs:
        motion, forces = (each.name for each in self.outputs)
        values = {motion: found.motion, forces: found.forces}
        values |= {quantity.name: block for quantity, block in zip(names, blocks, strict=True)}
        return {**values, PIVOTS: [*factors.pivots, *signs]}

    def _free(self, g: Ingredients, found: Constrained) -> tuple[list[Scalar], list[Scalar]]:
        """Inputs in the place of the motion and the forces, and the residuals with them."""
        known = [*found.motion, *found.forces]
        free: list[Scalar] = g.inputs["q"][0].tracer.stand_ins("free_solution", known)
        nv = len(found.motion)
        return free, self.residuals(g, free[:nv], free[nv:])

    def _weighted(self, found: Arrays, given: Given) -> Arrays:
        """The outputs, and the gradients of their weighted sum, from the Jacobians."""
        values = self._plain(found)
        for by in self.by:
            parts = (
                weighted(given[weight.name], found[f"d{output.name}_d{by.name}"])
                for output, weight in zip(self.outputs, self.weights, strict=True)
            )
            values[gradient_by(by).name] = reduce(np.add, parts)
        return values

    def _moved(self, found: Arrays, given: Given) -> Arrays:
        values = self._plain(found)
        for output in self.outputs:
            parts = (
                along(found[f"d{output.name}_d{by.name}"], given[direction.name])
                for by, direction in zip(self.by, self.directions, strict=True)
            )
            values[f"d{output.name}"] = reduce(np.add, parts)
        return values

    def _plain(self, found: Arrays) -> Arrays:
        """Return the arrays that are no derivatives."""
        names = {*(output.name for output in self.outputs), PIVOTS}
        return {name: values for name, values in found.items() if name in names}
