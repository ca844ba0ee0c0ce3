"""What lowering takes from the target: another machine's costs find another arrangement of the same function."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model

from psdmc.lower.kernels import lower
from psdmc.program.cost import cost, for_one_state
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel
from psdmc.target.presets import CORTEX_M4F, COSTS, PRESETS, X86_64_V4


def lowered(name: str) -> Mapping[str, Kernel]:
    return lower(
        bundled_model("kr6"),
        "factored",
        ["inverse_dynamics"],
        theta_variants=False,
        costs=PRESETS[name].costs,
    )


def test_where_each_angle_pays_a_sincos_fewer_are_taken() -> None:
    one, other = (cost(lowered(name)["inverse_dynamics"].single) for name in ("native", "cortex-m4f"))

    assert other.sincos < one.sincos
    assert other.total > one.total


def test_without_vectors_lanes_have_no_body_of_their_own() -> None:
    for name in ("scalar", "cortex-m4f", "cortex-m7"):
        kernel = lowered(name)["inverse_dynamics"]
        assert kernel.batch == kernel.single


def test_one_state_takes_the_lanes_fewer_sines_where_that_costs_it_next_to_nothing() -> None:
    own, shared = (
        lower(
            bundled_model("kr6"),
            "factored",
            ["inverse_dynamics_derivatives"],
            theta_variants=False,
            costs=replace(COSTS, worth_sharing=factor),
        )["inverse_dynamics_derivatives"]
        for factor in (0.0, COSTS.worth_sharing)
    )

    assert cost(shared.single).sincos < cost(own.single).sincos
    assert shared.batch == shared.single
    score = for_one_state(COSTS).score
    assert score(shared.single) <= COSTS.worth_sharing * score(own.single)


def test_equal_costs_are_equal_programs() -> None:
    assert X86_64_V4.costs == COSTS
    assert lowered("x86-64-v4") == lowered("native")
    assert lowered("cortex-m4f") != lowered("native")


@pytest.mark.parametrize("name", ["x86-64-v2", "neon", CORTEX_M4F.name])
def test_every_target_computes_the_same_function(name: str) -> None:
    model, program = bundled_model("kr6"), lowered(name)["inverse_dynamics"].single
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 20, 6))

    found = interpret(program, {"q": q, "qd": qd, "qdd": qdd}, {"tau": 6})["tau"]

    np.testing.assert_allclose(found, model.inverse_dynamics(q, qd, qdd), rtol=1e-9, atol=1e-10)
