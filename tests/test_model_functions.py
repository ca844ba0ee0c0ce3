"""A model answers what a compiled robot answers: the same names, shapes, named tuples, refusals and NaN; Pinocchio's
values."""

from __future__ import annotations

import ast
import copy
import gc
import inspect
import weakref
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from unoptimised import without_optimisation

import psdmc
from psdmc.errors import InputError
from psdmc.functions import OF_TREES, RECIPES, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.program.signature import Sizes
from psdmc.recipes.recipe import VALUES, Recipe
from psdmc.robot.reference import reference

RANDOM = np.random.default_rng(9)
LIMIT = 1e-9
"""Relative to each output's largest value: forward dynamics lose digits with the mass matrix's condition."""


def states(name: str, *lead: int, robot: str = "scara") -> dict[str, np.ndarray]:
    model = bundled_model(robot)
    sizes = Sizes.of(model.mechanism, model.l)
    given = {
        q.name: q.drawn(RANDOM.uniform(-1.0, 1.0, (*lead, *sizes.shape(q.axes))))
        for q in SIGNATURES[name].inputs
    }
    for q in SIGNATURES[name].inputs:
        if q.axes == ("nq",):
            rows = on_joints(model.mechanism, given[q.name].reshape(-1, model.nq))
            given[q.name] = rows.reshape(*lead, model.nq)
    return given


def tuples(found: object) -> tuple[np.ndarray, ...]:
    return found if isinstance(found, tuple) else (found,)


def entries(dense: dict[str, np.ndarray], recipe: Recipe, model: DynamicsModel) -> dict[str, np.ndarray]:
    """Those of the one matrix that a function packs."""
    rows, columns = np.array(recipe.packs.places(model.mechanism, model.representative)).T
    (matrix,) = dense.values()
    return {VALUES.name: matrix[:, rows, columns]}


@pytest.mark.parametrize("name", OF_TREES)
def test_every_function_has_pinocchios_values(name: str) -> None:
    """Of the robot's file, read by Pinocchio itself."""
    model, recipe = bundled_model("scara"), RECIPES[name]
    given = states(name, 6)
    if recipe.gradient or recipe.times_theta:
        pytest.skip("Pinocchio has no such base parameters: compared times theta_b by psdmc check")
    pinocchio = reference(bundled_robot("scara"))
    if "tau" in given:
        given["qdd"] = pinocchio.forward_dynamics(given["q"], given["qd"], given["tau"])
    elif "qdd" in given:
        given["tau"] = pinocchio.inverse_dynamics(given["q"], given["qd"], given["qdd"])
    expected = recipe.pinocchio(pinocchio, {"q": np.zeros((1, model.nq))} | given)
    if recipe.packs is not None:
        expected = entries(expected, recipe, model)

    found = getattr(model, name)(*(given[q.name] for q in recipe.signature.inputs))

    for output, values in zip(recipe.signature.outputs, tuples(found), strict=True):
        scale = max(1e-3, float(np.abs(expected[output.name]).max()))
        assert np.abs(values - expected[output.name].reshape(values.shape)).max() < 1e-6 * scale, output.name


COMPILED = [
    "forward_dynamics",
    "coriolis_matrix",
    "jacobian",
    "forward_kinematics",
    "regressor_slotine_li",
    "mass_matrix_inverse",
]


@pytest.fixture(scope="module")
def robot():
    with without_optimisation():
        return psdmc.compile(bundled_model("scara"), functions=COMPILED)


@pytest.mark.parametrize("name", COMPILED)
@pytest.mark.parametrize("lead", [(), (5,), (2, 3), (0,)], ids=str)
def test_results_are_those_of_the_compiled_robot(robot, name: str, lead: tuple[int, ...]) -> None:
    given = states(name, *lead).values()
    found, expected = getattr(bundled_model("scara"), name)(*given), getattr(robot, name)(*given)
    assert type(found) is type(expected)
    for one, other in zip(tuples(found), tuples(expected), strict=True):
        assert (one.shape, one.dtype) == (other.shape, other.dtype)
        assert np.abs(one - other).max(initial=0.0) <= LIMIT * max(1.0, np.abs(other).max(initial=0.0))


def test_states_broadcast_and_names_are_taken(robot) -> None:
    model = bundled_model("scara")
    q, qd, tau = RANDOM.normal(size=(3, 1, 4)), RANDOM.normal(size=(5, 4)), np.zeros(4)
    assert model.forward_dynamics(q, qd, tau).shape == (3, 5, 4)
    found = model.forward_dynamics(tau=tau, q=q, qd=qd)
    assert np.allclose(found, robot.forward_dynamics(q, qd, tau), rtol=LIMIT, atol=LIMIT)


def test_parameters_may_be_given(robot) -> None:
    model = bundled_model("scara")
    q, qd = RANDOM.normal(size=(2, 3, 4))
    twice = 2.0 * model.theta_b
    found = model.coriolis_matrix(q, qd, theta_b=twice)
    assert np.allclose(found, robot.coriolis_matrix(q, qd, twice), rtol=LIMIT, atol=LIMIT)


OWN = ["inverse_dynamics", "mass_matrix", "nonlinear_effects", "gravity"]
"""Methods of the model's class; the others are found by name."""


@pytest.mark.parametrize("expanded", [True, False])
@pytest.mark.parametrize("name", OWN)
def test_the_models_own_methods_take_theta_b_and_out(name: str, expanded: bool) -> None:
    """Torques are linear in theta_b."""
    model = bundled_model("scara") if expanded else replace(bundled_model("scara"), expansion=None)
    given, call = list(states(name, 3).values()), getattr(model, name)
    kept = np.empty_like(call(*given))
    assert call(*given, 2.0 * model.theta_b, out=kept) is kept
    assert np.allclose(kept, 2.0 * call(*given), rtol=1e-12, atol=1e-12)
    unknown = replace(model, theta_b=None)
    assert np.array_equal(getattr(unknown, name)(*given, theta_b=model.theta_b), call(*given))
    with pytest.raises(InputError, match=f"{name}: theta_b has shape"):
        call(*given, theta_b=[1.0])


def shown(signature: inspect.Signature) -> list[tuple[str, object, object]]:
    """Names, kinds and defaults; not annotations."""
    return [(p.name, p.kind, p.default) for p in signature.parameters.values()]


@pytest.mark.parametrize("name", SIGNATURES)
def test_a_function_has_one_signature_in_models_robots_and_stubs(robot, name: str) -> None:
    """The stubs of compiled robots have one more argument, `gravity`, where results depend on it."""
    whole = shown(inspect.signature(getattr(robot, name)))
    expected = [argument for argument in whole if argument[0] != "gravity"]
    assert shown(inspect.signature(getattr(bundled_model("scara"), name))) == expected
    assert written("toolchain/call.pyi", "CompiledRobot")[name] == [argument for argument, *_ in whole]
    own = written("model/dynamics_model.py", "DynamicsModel")
    of_models = own[name] if name in own else written("model/answers.pyi", "Answers")[name]
    assert of_models == [argument for argument, *_ in expected]


def written(path: str, of: str) -> dict[str, list[str]]:
    """Arguments of the methods of a class, by the methods' names, without self."""
    tree = ast.parse((Path(psdmc.__file__).parent / path).read_text(encoding="utf-8"))
    (found,) = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and node.name == of)
    methods = (node for node in found.body if isinstance(node, ast.FunctionDef))
    return {m.name: [a.arg for a in (*m.args.args, *m.args.kwonlyargs)][1:] for m in methods}


def test_states_without_solution_are_nan_and_leave_others_alone(robot) -> None:
    """Parameters whose mass matrix is positive definite in some states alone."""
    model, random = bundled_model("scara"), np.random.default_rng(0)
    q, qd, tau = random.uniform(-2.0, 2.0, (3, 200, 4))
    theta = model.theta_b * random.uniform(0.2, 1.8, (200, model.l))
    for parameters in theta:
        found, expected = (r.forward_dynamics(q, qd, tau, parameters) for r in (model, robot))
        bad = np.isnan(expected).all(axis=1)
        if 0 < bad.sum() < len(bad):
            break
    assert 0 < bad.sum() < len(bad), "the test wants both kinds of states"
    assert np.array_equal(np.isnan(found).all(axis=1), bad)
    with np.errstate(invalid="ignore"):
        assert np.isfinite(found[~bad]).all()
    broken = q.copy()
    broken[3, 0] = np.nan
    assert np.isnan(model.forward_dynamics(broken, qd, tau)[3]).all()
    assert np.isfinite(np.delete(model.forward_dynamics(broken, qd, tau), 3, 0)).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.forward_dynamics(np.zeros(3), np.zeros(4), np.zeros(4)), r"forward_dynamics: q has shape \(3,\)"),
        (lambda m: m.jacobian(1.0), r"jacobian: q has shape \(\)"),
        (lambda m: m.jacobian(np.zeros(4, complex)), "jacobian: q has dtype complex128"),
        (lambda m: m.coriolis_matrix(np.zeros((3, 4)), np.zeros((2, 4))), r"do not broadcast: q \(3, 4\), qd \(2, 4\)"),
        (lambda m: m.coriolis_matrix(np.zeros(4), np.zeros(4), [1.0]), r"theta_b has shape \(1,\), expected \(8,\)"),
        (lambda m: m.jacobian(np.zeros(4), out=np.zeros((6, 3))), r"out for J has shape \(6, 3\), expected \(6, 4\)"),
    ],
)  # fmt: skip
def test_wrong_input_is_refused_as_by_compiled_robots(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call(bundled_model("scara"))


def test_what_a_model_cannot_have_is_refused_with_the_reason() -> None:
    unknown = replace(bundled_model("scara"), theta_b=None)
    with pytest.raises(InputError, match="base parameters of 'scara' are unknown"):
        unknown.forward_dynamics(*np.zeros((3, 4)))
    assert unknown.jacobian(np.zeros(4)).shape == (6, 4)
    upside_down = replace(bundled_model("scara"), theta_b=-bundled_model("scara").theta_b)
    with pytest.raises(InputError, match=r"no forward_dynamics: .*not positive definite"):
        upside_down.forward_dynamics(*np.zeros((3, 4)))


def test_models_that_are_used_no_more_are_let_go() -> None:
    """A loop over loads makes a model each; none stays because it was asked."""
    model = bundled_model("scara")
    alive = []
    for mass in range(1, 13):
        loaded = model.with_payload(0.1 * mass, (0.0, 0.0, 0.1))
        loaded.forward_dynamics(*np.zeros((3, 4)))
        loaded.gravity(np.zeros(4))
        alive.append(weakref.ref(loaded))
    del loaded
    gc.collect()
    assert [found() for found in alive] == [None] * 12


def test_what_a_model_can_have_is_found_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr("psdmc.model_functions.require", lambda model, names: asked.extend(names))
    model = replace(bundled_model("scara"))
    for _ in range(3):
        model.forward_dynamics(*np.zeros((3, 4)))
    assert asked == ["forward_dynamics"]


def test_a_misspelt_name_is_an_attribute_error() -> None:
    model = bundled_model("scara")
    with pytest.raises(AttributeError, match="'DynamicsModel' object has no attribute 'jacobean'"):
        model.jacobean  # noqa: B018
    assert not hasattr(model, "_repr_png_")
    assert copy.copy(model).content_hash == model.content_hash


def test_editors_see_them() -> None:
    model = bundled_model("scara")
    assert set(SIGNATURES) <= set(dir(model))
    assert str(inspect.signature(model.forward_dynamics)) == "(q, qd, tau, theta_b=None, *, out=None)"
    assert "qdd  (..., nv) joint accelerations" in model.forward_dynamics.__doc__
