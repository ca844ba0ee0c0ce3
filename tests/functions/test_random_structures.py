"""PROGRAMs of all functions for robots of random structure: mimic joints anywhere, joints of several coordinates, and equal
limbs. The NumPy side gives the expected values; other tests compare it with Pinocchio and CasADi."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest
from random_trees import BASE, RandomTree
from slow_cases import slow_but_for

from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.program.interpret import interpret
from psdmc.program.limb_program import unpacked
from psdmc.program.signature import Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.mechanism import NamedFrame

SHAPES = (
    (BASE, BASE, 1),
    (BASE, 0, 0),
    (BASE, 0, 1, 1),
    (BASE, BASE, 0, 1),
    (BASE, 0, BASE, 2),
    (BASE, 0, 1, 0, 3),
    (BASE, BASE, 1, 2, 0),
    (BASE, 0, 0, 1, 2),
    (BASE, BASE, BASE),
)
"""Parents."""
OTHERS = ("loop_", "assemble", "neutral")
"""How functions begin that need loops, or that have no NumPy side."""
FUNCTIONS = [name for name in RECIPES if not name.startswith(OTHERS) and not name.endswith("_packed")]
COUNT, EXACT, NOTHING = 3, 1e-8, 1e-12
"""States; error relative to the largest entry; the largest entry of an output that is zero but for rounding."""


def structure(seed: int) -> tuple[RandomTree, tuple[Coordinate, ...]]:
    """Equal limbs in a third of the trees, of which some have a mimic joint each. In most other trees a joint mimics one or
    two others, which may be on another branch."""
    rng = random.Random(seed)
    parents = rng.choice(SHAPES)
    kinds = rng.choices("RRRRPPFSLT", k=len(parents))
    if seed % 3 == 0:
        parents, kinds = limbs(rng)
    coordinates = [Coordinate(i) for i in range(len(parents))]
    own = [i for i, kind in enumerate(kinds) if kind in "RP"]
    if seed % 6 == 0:
        ends = [i for i, parent in enumerate(parents) if parent in own]
        for i in ends:
            coordinates[i] = Coordinate(parents[i], 0.7, 0.3)
    elif len(own) > 1 and rng.random() < 0.8:
        mimic, leader, *further = rng.sample(own, min(3, len(own)))
        others = tuple((k, -0.5) for k in further if rng.random() < 0.3)
        coordinates[mimic] = Coordinate(leader, rng.choice((-1.5, 0.7, 1.0)), 0.3, others)
    return RandomTree(seed, parents, "".join(kinds), rng.choice((0.0, 0.6, 1.0))), tuple(coordinates)


def limbs(rng: random.Random) -> tuple[tuple[int, ...], list[str]]:
    """Two to four equal limbs of one or two joints, on the base or on a floating base."""
    limb, floats = rng.choices("RRRP", k=rng.choice((1, 2, 2))), rng.random() < 0.6
    parents, kinds = [BASE] * floats, ["F"] * floats
    for _ in range(rng.choice((2, 2, 3, 4))):
        parents += [BASE + floats, *range(len(parents), len(parents) + len(limb) - 1)]
        kinds += limb
    return tuple(parents), kinds


def errors_of(model: DynamicsModel, arrays: RobotOnArrays, function: str) -> dict[str, float]:
    """Relative to each output's largest entry: of the PROGRAMs for one state, for lanes, and for limbs in lanes."""
    recipe, sizes = RECIPES[function], Sizes.of(model.mechanism, model.l)
    rng = np.random.default_rng(9)
    read = {q.name: q for name in ("inverse_dynamics", function) for q in RECIPES[name].signature.inputs}
    given = {q.name: q.drawn(rng.uniform(-1.0, 1.0, (COUNT, *sizes.shape(q.axes)))) for q in read.values()}
    given["q"] = on_joints(model.mechanism, given["q"])
    given["tau"] = arrays.torques(given["q"], given["qd"], given["qdd"], arrays.base_acceleration)
    expected = recipe.reference(arrays, given)
    kernel = lower(model, "auto", [function], theta_variants=False)[function]
    flat = {q.name: given[q.name].reshape(COUNT, -1) for q in recipe.signature.inputs}
    found = {}
    for program in (kernel.single, kernel.batch, *([unpacked(kernel.limbs)] if kernel.limbs else [])):
        values = interpret(program, flat, recipe.signature.sizes(sizes))
        for output in recipe.signature.outputs:
            wanted = expected[output.name].reshape(COUNT, -1)
            largest = float(np.abs(wanted).max(initial=0.0))
            error = float(np.abs(values[output.name].reshape(COUNT, -1) - wanted).max(initial=0.0))
            error /= largest if largest > NOTHING else 1.0
            found[output.name] = max(error, found.get(output.name, 0.0))
    return found


@pytest.mark.parametrize("seed", slow_but_for([23], range(32)))
def test_programs_are_the_numpy_side(seed: int) -> None:
    tree, coordinates = structure(seed)
    contacts = tuple(NamedFrame(f"on {k}", k, tree.places[k]) for k in {0, tree.n - 1})
    robot = replace(tree.mechanism(), coordinates=coordinates, frames=contacts)
    model = derive_model(robot, expand=False)
    arrays = RobotOnArrays.of(model, model.theta_b)
    for function in FUNCTIONS:
        for output, error in errors_of(model, arrays, function).items():
            assert error < EXACT, (function, output)
