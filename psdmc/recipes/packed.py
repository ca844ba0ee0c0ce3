"""Functions that return only those entries of a matrix that can differ from zero, as a vector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from psdmc.program.signature import Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Packing, Recipe, RobotOnArrays
from psdmc.robot.mechanism import Array

VALUES = Quantity(
    "values",
    ("nonzeros",),
    means="entries of the matrix; `CompiledRobot.pattern` returns their rows and columns",
)


def packed(dense: Recipe, order: int, meaning: str, summary: str, packing: Packing) -> Recipe:
    """Return the recipe of a function that returns the nonzero entries of a matrix as a vector. The function `dense`
    computes the whole matrix."""
    function, (matrix,) = dense.signature, dense.signature.outputs

    def reference(robot: RobotOnArrays, given: Given) -> Arrays:
        rows, columns = _indices(packing, robot)
        return {VALUES.name: dense.reference(robot, given)[matrix.name][:, rows, columns]}

    return replace(
        dense,
        signature=Signature(
            f"{dense.name}_packed",
            order,
            meaning,
            function.inputs,
            (VALUES,),
            theta=function.theta,
            factorises=function.factorises,
            calls=function.calls,
            summary=summary,
            weighs=function.weighs,
        ),
        title=f"{dense.title}, packed",
        reference=reference,
        starts=None,
        polynomials=None,
        in_limbs=False,
        default=False,
        benched=False,
        packs=packing,
    )


def unpacked(packing: Packing, dense: Recipe, robot: RobotOnArrays, values: Array) -> Arrays:
    """Return the whole matrices that `dense` would return, from the vectors (k, nonzeros) of their nonzero entries, for
    k states."""
    (matrix,) = dense.signature.outputs
    lengths = {"nv": robot.nv, "nxa": 3 * robot.nv, "nxu": 3 * robot.nv, "l": robot.lift.shape[1]}
    found = np.zeros((len(values), *(lengths[axis] for axis in matrix.axes)))
    rows, columns = _indices(packing, robot)
    found[:, rows, columns] = values
    if packing.is_triangle:
        found[:, columns, rows] = values
    return {matrix.name: found}


def _indices(packing: Packing, robot: RobotOnArrays) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    rows, columns = np.array(packing.places(robot.chain, robot.lift), dtype=np.intp).reshape(-1, 2).T
    return rows, columns
