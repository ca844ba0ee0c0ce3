"""Functions of geometry and of the links' own bodies, written once: on symbols for a trace, on arrays for its reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.kinematics import AT_BASE
from psdmc.dynamics.scalar import Matrix, Scalar, Vector, scale, transform
from psdmc.dynamics.spatial import Body
from psdmc.program.signature import Quantity
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs
from psdmc.robot.mechanism import NamedFrame

Rows = Sequence[Sequence[Scalar]]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedRobot:
    """The constants of a robot whose first joint frame is placed in the base frame at `root`.

    solids  gives the links' own bodies about the joint frames
    """

    frames: Sequence[Frame]
    named: Sequence[NamedFrame]
    root: tuple[Matrix, Vector]
    solids: Callable[[], Sequence[Body]]

    @property
    def mass(self) -> Scalar:
        """Return the mass of all links, kg."""
        return sum(body.mass for body in self.solids())

    def in_base(self, v: Vector) -> Vector:
        """Convert a vector from the axes that the first joint frame turns from to the base's axes."""
        return transform(self.root[0], v)

    def rows_in_base(self, rows: Rows, factor: Scalar = 1.0) -> list[list[Scalar]]:
        """Convert the columns of a matrix likewise, three rows after three, and multiply them by a factor."""
        columns = [
            [x for k in range(0, len(column), 3) for x in scale(self.in_base(column[k : k + 3]), factor)]
            for column in zip(*rows, strict=True)
        ]
        return [list(row) for row in zip(*columns, strict=True)]


def on_both(
    values: Callable[..., Outputs], inputs: Sequence[Quantity]
) -> tuple[Callable[[Ingredients], Outputs], Callable[[RobotOnArrays, Given], Arrays]]:
    """Return the trace and the reference of a function with these inputs. `values` computes its outputs from a PlacedRobot
    and each input as a list."""

    def trace(g: Ingredients) -> Outputs:
        return values(
            PlacedRobot(g.frames, g.named, g.root, g.link_bodies), *(g.inputs[q.name] for q in inputs)
        )

    def reference(robot: RobotOnArrays, given: Given) -> Arrays:
        placed = PlacedRobot(robot.frames, robot.chain.frames, AT_BASE, lambda: robot.solids)
        found = values(placed, *(list(given[quantity.name].T) for quantity in inputs))
        return {name: entries(value, len(given["q"])) for name, value in found.items()}

    return trace, reference
