"""The expanded lowering against the MODEL that it comes from and against Pinocchio; and what it costs."""

from __future__ import annotations

import dataclasses
import json
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pendulum import pendulum
from random_chains import Oracle, random_chain, relative_error, states
from slow_cases import slow_but_for

from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.lower.expanded.lowering import lower_expanded
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.cost import cost
from psdmc.program.interpret import interpret
from psdmc.program.program import Program
from psdmc.program.signature import Sizes
from psdmc.program.text import show
from psdmc.robot.load import load_robot, load_robot_text

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"
GOLDEN = Path(__file__).parents[1] / "golden"
WHOLE = os.environ.get("PSDMC_ACCURACY") == "whole"
BUNDLED = ("two_link", "two_link_full", "scara", "denso_floor", "denso_wall", "kr6", "lbr7")
WITH_THETA = [
    (name, theta)
    for name, recipe in RECIPES.items()
    for theta in (False, True)
    if recipe.polynomials and (recipe.signature.theta or not theta)
]


@cache
def bundled(robot: str) -> DynamicsModel:
    return derive_model(load_robot(ROBOTS / f"{robot}.toml").chain)


@cache
def lowered(robot: str, name: str, theta: bool = False) -> Program:
    return lower_expanded(bundled(robot), RECIPES[name], theta)


def run(program: Program, model: DynamicsModel, name: str, **inputs: np.ndarray) -> np.ndarray:
    function = RECIPES[name].signature
    sizes = function.sizes(Sizes.of_chain(model.n, model.l))
    return interpret(program, {**inputs, "theta_b": model.theta_b}, sizes)[function.outputs[0].name]


@pytest.mark.parametrize("robot", ["two_link_full", "scara", *(["denso_wall", "kr6"] if WHOLE else [])])
@pytest.mark.parametrize(("name", "theta"), WITH_THETA)
def test_programs_compute_what_the_model_says(robot: str, name: str, theta: bool):
    model = bundled(robot)
    n = model.n
    q, qd, qdd = states(n, 200)
    tau, h = model.inverse_dynamics(q, qd, qdd), model.nonlinear_effects(q, qd)
    expected = {
        "inverse_dynamics": tau,
        "nonlinear_effects": h,
        "gravity": model.gravity(q),
        "mass_matrix": model.mass_matrix(q),
        "regressor": model.regressor(q, qd, qdd),
        "forward_dynamics": qdd,
    }[name]

    found = run(lowered(robot, name, theta), model, name, q=q, qd=qd, qdd=qdd, tau=tau)

    scale = tau if name in ("gravity", "nonlinear_effects") else None
    limit = 1e-9 if name == "forward_dynamics" else 1e-12
    assert relative_error(found.reshape(expected.shape), expected, scale) < limit


@given(seed=st.integers(0, 10**6), kinds=st.text("RP", min_size=1, max_size=4), tidy=st.booleans())
@settings(max_examples=25, deadline=None)
def test_inverse_dynamics_of_any_chain_is_as_good_as_its_model(seed: int, kinds: str, tidy: bool):
    """The model's certificate can be worse than 1e-12 where an oblique link frame makes a pivot small; lowering
    adds nothing to it."""
    chain = random_chain(seed, kinds, tidy=tidy, gravity=(1.0, -2.0, -9.0))
    model = derive_model(chain)
    q, qd, qdd = states(model.n, 100)
    program = lower_expanded(model, RECIPES["inverse_dynamics"], False)

    found = run(program, model, "inverse_dynamics", q=q, qd=qd, qdd=qdd)

    assert relative_error(found, model.inverse_dynamics(q, qd, qdd)) < 1e-12
    assert relative_error(found, Oracle(chain).rnea(q, qd, qdd)) < 1e-12 + 2.0 * model.certificate.max()


def test_pivots_are_positive_where_the_mass_matrix_is_positive_definite():
    chain = random_chain(5, "RRPR")
    model = derive_model(chain)
    q, qd, tau = states(4, 100)

    out = interpret(
        lower_expanded(model, RECIPES["forward_dynamics"], False),
        {"q": q, "qd": qd, "tau": tau},
        {"qdd": 4, "pivot": 4},
    )

    assert np.all(out["pivot"] > 0)
    np.testing.assert_allclose(
        np.prod(out["pivot"], axis=1), np.linalg.det(Oracle(chain).mass_matrix(q)), rtol=1e-9
    )
    np.testing.assert_allclose(out["qdd"], Oracle(chain).aba(q, qd, tau), rtol=1e-8, atol=1e-8)


def test_without_gravity_nothing_is_left_of_gravity_but_zeros():
    model = derive_model(random_chain(5, "RP", gravity=(0.0, 0.0, 0.0)))

    assert show(lower_expanded(model, RECIPES["gravity"], False)).splitlines() == [
        "t0 = const 0.0",
        "out g[0] = t0",
        "out g[1] = t0",
    ]


PENDULUM = pendulum(mass=2.0, x=0.0, yy=0.0, zz=0.1)


def test_a_pendulum_accelerates_as_on_paper():
    """m g l = 9.81 N m and I + m l^2 = 0.6 kg m^2: qdd = (tau - 9.81 cos q) / 0.6."""
    model = derive_model(load_robot_text(PENDULUM, "toml").chain)

    assert show(lower_expanded(model, RECIPES["forward_dynamics"], False)).splitlines() == [
        "t0 = load q[0]",
        "t1 = cos t0",
        "t2 = const 9.81",
        "t3 = mul t1 t2",
        "t4 = load tau[0]",
        "t5 = sub t4 t3",
        "t6 = const 1.6666666666666667",
        "t7 = mul t5 t6",
        "t8 = const 0.6",
        "out qdd[0] = t7",
        "out pivot[0] = t8",
    ]


def test_parameters_that_are_unknown_cannot_be_baked():
    model = dataclasses.replace(bundled("two_link"), theta_b=None)

    with pytest.raises(InputError, match="base parameters are unknown") as caught:
        lower_expanded(model, RECIPES["inverse_dynamics"], False)
    assert "theta_b" in str(caught.value.hint)
    assert cost(lower_expanded(model, RECIPES["inverse_dynamics"], True)).total > 0


def test_a_model_without_functions_cannot_be_expanded():
    model = dataclasses.replace(bundled("two_link"), expansion=None)

    with pytest.raises(InputError, match="needs E and P") as caught:
        lower_expanded(model, RECIPES["gravity"], False)
    assert "--lowering factored" in str(caught.value.hint)


@pytest.mark.parametrize(("name", "theta"), [("jacobian", False), ("regressor", True)])
def test_what_this_lowering_does_not_make_is_refused(name: str, theta: bool):
    with pytest.raises(ValueError, match=name):
        lower_expanded(bundled("two_link"), RECIPES[name], theta)


PUBLISHED = {"two_link": (23, 12), "scara": (126, 84), "kr6": (3200, 2000), "lbr7": (11700, 6800)}
"""Multiplications and additions of inverse dynamics that must not be exceeded (PSDM-2021: the small robots)."""


@pytest.mark.parametrize("robot", PUBLISHED)
def test_inverse_dynamics_takes_no_more_than_the_published_operations(robot: str):
    """By the golden counts, beyond which the next test lets none grow."""
    counted = json.loads((GOLDEN / robot / "cost.json").read_text())["expanded"]["inverse_dynamics"]

    multiplications, additions = PUBLISHED[robot]
    assert counted["mul"] <= multiplications
    assert counted["add"] <= additions


@pytest.mark.parametrize("robot", slow_but_for([robot for robot in BUNDLED if robot != "lbr7"], BUNDLED))
def test_operations_have_not_grown(robot: str):
    """tests/golden/<robot>/cost.json holds the counts; PSDMC_REWRITE_GOLDEN=1 rewrites it."""
    counts = {}
    for name in ("inverse_dynamics", "mass_matrix", "regressor"):
        counted = cost(lowered(robot, name))
        counts[name] = {"mul": counted.mul, "add": counted.add, "div": counted.div, "sincos": counted.sincos}
    file = GOLDEN / robot / "cost.json"
    known = json.loads(file.read_text()) if file.exists() else {}
    if os.environ.get("PSDMC_REWRITE_GOLDEN"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps({**known, "expanded": counts}, indent=2, sort_keys=True) + "\n")
        known = json.loads(file.read_text())

    grown = {
        f"{name} {operation}": f"{known['expanded'][name][operation]} -> {count}"
        for name, operations in counts.items()
        for operation, count in operations.items()
        if count > known["expanded"][name][operation]
    }

    assert not grown
