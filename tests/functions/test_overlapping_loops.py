"""One state of functions of loops and calls: an output may be the array of an input."""

from __future__ import annotations

import numpy as np
import pytest
from contact_trees import ContactTree, contact_tree
from direct import Direct
from loop_trees import LoopTree, loop_tree
from unoptimised import compiled

from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.functions import RECIPES
from psdmc.lower.admitted import wanted
from psdmc.lower.kernels import lower
from psdmc.model.random_states import near_closed
from psdmc.program.signature import Sizes

IN_LOOPS = [name for name, recipe in RECIPES.items() if recipe.regions]


@pytest.mark.slow
@pytest.mark.parametrize("name", IN_LOOPS)
def test_an_output_may_be_the_array_of_an_input(name: str) -> None:
    """Every pair of equal length, with and without theta_b."""
    own: ContactTree | LoopTree = contact_tree(0, True)
    states = own.given
    if RECIPES[name].lack_of_loops(own.model.mechanism):
        own = loop_tree(0, True)
        states = own.given | {"q_guess": near_closed(own.model.mechanism, np.random.default_rng(3), 6)}
    model, mechanism = own.model, own.model.mechanism
    assert mechanism.nv > RECIPES[name].straight
    kernels = lower(model, functions=wanted([name], mechanism))
    assert kernels[name].regions is not None
    package = package_view(package_info(model, "tree"), kernels, EmitOptions())
    call, signature = Direct(package, compiled(package, False)), RECIPES[name].signature
    sizes = Sizes.of(mechanism, model.l, len(kernels[name].places))
    random = np.random.default_rng(0)
    given = {
        each.name: np.ravel(states[each.name][5])
        if each.name in states
        else np.atleast_1d(each.drawn(random.uniform(-1.0, 1.0, sizes.size(each))))
        for each in signature.inputs
    }

    def results(variant: str, output: str = "", over: str = "") -> dict[str, np.ndarray]:
        inputs = {key: values.copy() for key, values in given.items()}
        if variant:
            inputs["theta_b"] = np.array(model.theta_b)
        outputs = {key: np.empty(size) for key, size in signature.sizes(sizes).items() if key != "pivot"}
        if over:
            outputs[output] = inputs[over]
        call(name + variant, *inputs.values(), *outputs.values())
        return outputs

    for variant in ("", "_theta") if signature.theta else ("",):
        alone = results(variant)
        assert all(np.isfinite(values).all() for values in alone.values())
        for output, values in alone.items():
            for over in (key for key, array in given.items() if array.size == values.size):
                found = results(variant, output, over)
                assert all(np.array_equal(found[key], alone[key]) for key in alone), (variant, output, over)
