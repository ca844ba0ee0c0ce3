"""Packing leaves entries out and changes none: bit for bit, also where limbs run in lanes."""

from __future__ import annotations

import numpy as np
import pytest
from limbed import forced, shape

from psdmc.dynamics.structure import Places
from psdmc.functions import SIGNATURES
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.program.cost import cost
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel, packed
from psdmc.program.kernel_json import kernels_from_json, kernels_to_json
from psdmc.program.limb_program import unpacked
from psdmc.program.program import Program
from psdmc.robot.mechanism import Mechanism

LEGS = ["four legs of a floating body", "three fingers on a wrist", "arms on a trunk, legs on its root"]


def values(program: Program, kernel: Kernel, model: DynamicsModel) -> np.ndarray:
    names = [quantity.name for quantity in kernel.function.inputs]
    given = dict(zip(names, states_of(model.mechanism, np.random.default_rng(1), 20), strict=False))
    (output,) = kernel.function.outputs
    size = len(kernel.places) or model.nv * (model.l if output.name == "Y" else model.nv)
    return interpret(program, given, {output.name: size})[output.name]


def on_one_path(robot: Mechanism) -> Places:
    """The lower triangle's entries of rates one of whose joints carries the other: of limbs that are alike the same ones."""
    paths = [set(robot.path_to(joint)) for joint in robot.rate_joints]
    return tuple((i, j) for i, own in enumerate(paths) for j in range(i + 1) if paths[j] <= own)


def triangle(model: DynamicsModel, dense: Kernel, places: Places) -> tuple[Kernel, list[int]]:
    made = packed(dense, SIGNATURES["mass_matrix_packed"], model.nv, places)
    return made, [row * model.nv + column for row, column in places]


@pytest.mark.parametrize("name", LEGS)
def test_a_packed_mass_matrix_has_the_dense_ones_entries(name: str) -> None:
    model, dense = shape(name)[1], forced(name, "mass_matrix")
    made, kept = triangle(model, dense, on_one_path(model.mechanism))
    assert dense.limbs is not None
    assert made.limbs is not None

    for whole, part in ((dense.single, made.single), (unpacked(dense.limbs), unpacked(made.limbs))):
        assert np.array_equal(values(part, made, model), values(whole, dense, model)[:, kept])


def test_limbs_of_which_one_keeps_less_are_left_to_the_straight_line() -> None:
    model, dense = shape(LEGS[0])[1], forced(LEGS[0], "mass_matrix")
    first_leg = tuple((row, column) for row, column in on_one_path(model.mechanism) if row < 9)

    made, kept = triangle(model, dense, first_leg)

    assert made.limbs is None
    assert np.array_equal(values(made.single, made, model), values(dense.single, dense, model)[:, kept])
    assert cost(made.single).total < cost(dense.single).total


def test_both_come_from_one_lowering_and_are_kept_as_text() -> None:
    model = shape("three fingers on a wrist")[1]
    kernels = lower(model, "factored", ["regressor", "regressor_packed"])
    dense, made = kernels["regressor"], kernels["regressor_packed"]
    kept = [row * model.l + column for row, column in made.places]

    assert len(made.places) == len(kept) < model.nv * model.l
    assert np.array_equal(values(made.single, made, model), values(dense.single, dense, model)[:, kept])
    assert np.array_equal(values(made.batch, made, model), values(dense.batch, dense, model)[:, kept])
    assert kernels_from_json(kernels_to_json(kernels), SIGNATURES) == kernels
