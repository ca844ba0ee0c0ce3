"""Gravity as an input: C, PROGRAMs and NumPy against Pinocchio, whose model has another gravity for each state."""

from __future__ import annotations

import pickle
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model, robot_path
from command_line import status
from limbed import shape
from slow_cases import slow_but_for
from unoptimised import without_optimisation
from urdf_text import inertial, joint, link, urdf

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import DEFAULT, OF_TREES, RECIPES
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import under_general_gravity
from psdmc.model.random_states import on_joints
from psdmc.program.interpret import interpret
from psdmc.program.kernel import GRAVITY
from psdmc.program.signature import QDD, TAU, Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.torques_and_accelerations import with_gravity_input
from psdmc.robot.load import load_robot
from psdmc.robot.reference import Reference, reference
from psdmc.toolchain.build_package import build_package

Array = np.ndarray
EXACT = 1e-10
COUNT = 6
HEAVY = tuple(name for name in OF_TREES if RECIPES[name].signature.depends_on_gravity)

THICK = "0.11 0.12 0.09 0.01 0.02 -0.01"
TURNED = "0.2 0.1 -0.3"
WALKER = urdf(
    link("trunk", inertial(5.0, "0.02 0.01 0.05", "0 0 0", THICK)),
    *(link(f"leg{k}", inertial(2.0 - 0.4 * k, "0.1 0.03 0.05", "0 0 0", THICK)) for k in range(3)),
    joint("hip", "trunk", "leg0", xyz="0.2 0 0", rpy=TURNED, axis="0 1 0"),
    joint("slide", "leg0", "leg1", kind="prismatic", xyz="0.3 0.1 0", rpy=TURNED),
    joint("foot", "leg1", "leg2", xyz="0.3 0 0.1", rpy=TURNED, axis="0 1 0"),
    name="walker",
)
"""A floating base with nine rates, one of them of a sliding joint."""


class Case:
    """A robot as psdmc and as Pinocchio see it, and states with a gravity each."""

    def __init__(self, model: DynamicsModel, plain: Reference) -> None:
        rng = np.random.default_rng(8)
        self.model, self.plain = model, plain
        chain = model.mechanism
        self.sizes = Sizes.of(model.mechanism, model.l)
        read = {q.name: q for name in OF_TREES for q in RECIPES[name].signature.inputs}
        self.given = {
            q.name: q.drawn(rng.uniform(-1.0, 1.0, (COUNT, *self.sizes.shape(q.axes)))) for q in read.values()
        }
        for quantity in read.values():
            if quantity.axes == ("nq",):
                self.given[quantity.name] = on_joints(chain, self.given[quantity.name])
        self.given[GRAVITY.name] = rng.uniform(-10.0, 10.0, (COUNT, 3))
        states = [self.given[name] for name in ("q", "qd", "qdd")]
        self.given["tau"] = self.each(lambda robot, k: robot.inverse_dynamics(*(x[k] for x in states)))

    def each(self, called: Callable[[Reference, slice], Array]) -> Array:
        """A function of the robot under the gravity of each state."""
        found = []
        for k, gravity in enumerate(self.given[GRAVITY.name]):
            turned = self.plain.model.copy()
            turned.gravity.linear = gravity
            found.append(called(replace(self.plain, model=turned), slice(k, k + 1)))
        return np.concatenate(found)

    def expected(self, name: str) -> dict[str, Array]:
        """Pinocchio's results."""
        recipe = RECIPES[name]
        own = {q.name: self.given[q.name] for q in (*recipe.signature.inputs, QDD, TAU)}

        def one(output: str) -> Array:
            return self.each(
                lambda robot, k: recipe.pinocchio(robot, {key: x[k] for key, x in own.items()})[output]
            )

        turned = recipe.pinocchio(self.plain, {key: x[:1] for key, x in own.items()})
        return {output: one(output) for output in turned if output != recipe.gradient}


@cache
def case(name: str) -> Case:
    path = robot_path(name)
    return Case(psdmc.derive(path, gravity_input=True), reference(load_robot(path)))


@pytest.fixture(scope="session")
def walker(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path = tmp_path_factory.mktemp("walker") / "walker.urdf"
    path.write_text(WALKER, encoding="utf-8")
    return Case(psdmc.derive(path, floating=True), reference(load_robot(path, floating=True)))


def chosen(name: str, request: pytest.FixtureRequest) -> Case:
    found: Case = request.getfixturevalue("walker") if name == "walker" else case(name)
    return found


def compared(own: Case, name: str, expected: dict[str, Array], found: dict[str, Array]) -> None:
    """Torques of a regressor are compared, not its columns."""
    largest = max(float(np.abs(values).max()) for values in expected.values())
    for output, values in expected.items():
        given = np.asarray(found[output])
        if RECIPES[name].times_theta:
            given = np.reshape(given, (*values.shape, -1)) @ own.model.theta_b
        size = max(float(np.abs(values).max()), 1e-6 * largest)
        error = np.abs(np.reshape(given, values.shape) - values).max() / size
        assert error < EXACT, f"{name}: {output}: {error:.1e}"


PLAIN = tuple(name for name in HEAVY if not RECIPES[name].packs)
QUICK = tuple(
    name for name in PLAIN if name in DEFAULT or name in ("potential_energy", "gravity_derivatives")
)


@pytest.mark.parametrize(
    ("robot", "name"),
    slow_but_for(
        [("scara", name) for name in QUICK] + [("walker", name) for name in ("forward_dynamics", "gravity")],
        [(robot, name) for robot in ("scara", "kr6", "walker") for name in PLAIN],
        spread=True,
    ),
)
def test_every_function_is_pinocchios(robot: str, name: str, request: pytest.FixtureRequest) -> None:
    """PROGRAMs without and with theta_b, and the NumPy reference of the self-test."""
    own = chosen(robot, request)
    recipe, expected = with_gravity_input(RECIPES[name], RECIPES), own.expected(name)
    theta_b = np.asarray(own.model.theta_b)
    found = recipe.reference(RobotOnArrays.of(own.model, theta_b), own.given)
    compared(own, name, expected, found)
    given = {key: np.reshape(value, (COUNT, -1)) for key, value in own.given.items()} | {"theta_b": theta_b}
    for kernel in lower(own.model, "auto", [name], gravity_input=True).values():
        if kernel.function.name == name:
            assert kernel.function == recipe.signature
            for program in (kernel.single, kernel.batch):
                compared(own, name, expected, interpret(program, given, recipe.signature.sizes(own.sizes)))


FREE = ("impulse_derivatives", "coriolis_matrix")
"""Functions without gravity, whose C for many rates may be loops that call functions with gravity."""

LOOPS = ("forward_dynamics_second_derivatives", "rk4_step_derivatives", "constrained_semi_implicit_euler")
"""Functions whose C for many rates is loops and calls of others, which get gravity, too."""


@pytest.mark.parametrize(
    ("robot", "names"),
    slow_but_for(
        [("scara", DEFAULT), ("walker", LOOPS + FREE)],
        [("scara", DEFAULT), ("scara", PLAIN), ("walker", LOOPS + FREE), ("walker", PLAIN)],
        spread=True,
    ),
)
def test_c_is_pinocchios(robot: str, names: tuple[str, ...], request: pytest.FixtureRequest) -> None:
    """One state, many states in lanes, and one theta_b per state."""
    own = chosen(robot, request)
    with without_optimisation():
        compiled = psdmc.compile(own.model, functions=names, gravity_input=True)
    gravity, theta_b = own.given[GRAVITY.name], np.asarray(own.model.theta_b)
    for name in names:
        recipe, expected = RECIPES[name], own.expected(name)
        signature = recipe.signature
        inputs = [own.given[quantity.name] for quantity in signature.inputs]
        given = {"gravity": gravity} if signature.depends_on_gravity else {}
        found = [compiled.call(signature, inputs, **given)]
        if signature.theta:
            found.append(getattr(compiled, name)(*inputs, theta_b=theta_b, **given))
        for results in found:
            values = [results] if len(signature.outputs) == 1 else results
            named = dict(zip((each.name for each in signature.outputs), values, strict=True))
            compared(own, name, expected, named)
        one = compiled.call(
            signature, [array[3] for array in inputs], **{key: x[3] for key, x in given.items()}
        )
        values = [one] if len(signature.outputs) == 1 else one
        named = dict(zip((each.name for each in signature.outputs), values, strict=True))
        compared(own, name, {key: x[3] for key, x in expected.items()}, named)


def test_the_gravity_of_the_file_is_the_default() -> None:
    own = case("scara")
    with without_optimisation():
        names = ("inverse_dynamics", "inverse_dynamics_theta_rows")
        robot = psdmc.compile(own.model, functions=names, gravity_input=True)
    states = [own.given[name] for name in ("q", "qd", "qdd")]
    expected = own.plain.inverse_dynamics(*states)
    assert np.allclose(robot.inverse_dynamics(*states), expected, rtol=1e-12, atol=1e-12)
    thetas = np.outer(1.0 + np.arange(COUNT), np.asarray(own.model.theta_b))
    found = robot.inverse_dynamics(*states, thetas, gravity=own.given[GRAVITY.name])
    scaled = (1.0 + np.arange(COUNT))[:, None] * own.given["tau"]
    assert np.allclose(found, scaled, rtol=1e-12, atol=1e-12)
    again = pickle.loads(pickle.dumps(robot))
    assert again is robot


def test_limbs_stay_in_lanes() -> None:
    """The functions whose limbs run in lanes without the input have them there with it."""
    names = ("inverse_dynamics", "forward_dynamics", "regressor", "inverse_dynamics_derivatives")
    tree, model = shape("four legs of a floating body")
    general = derive_model(tree.mechanism(), gravity_input=True)
    assert general.l == model.l
    plain = lower(model, "factored", names, theta_variants=False)
    weighed = lower(general, "factored", names, theta_variants=False, gravity_input=True)
    assert (
        {name for name, each in weighed.items() if each.limbs}
        == {name for name, each in plain.items() if each.limbs}
        != set()
    )
    with without_optimisation():
        robot = psdmc.compile(general, functions=names, gravity_input=True)
    q, qd, qdd = tree.motion(COUNT)
    for k, gravity in enumerate(np.random.default_rng(3).uniform(-10.0, 10.0, (COUNT, 3))):
        turned = tree.model.copy()
        turned.gravity.linear = gravity
        states = [tree.theirs_at(q[k]), tree.theirs(qd[k]), tree.theirs(qdd[k])]
        tau = pin.rnea(turned, turned.createData(), *states)[tree.order]
        found = robot.inverse_dynamics(q[k], qd[k], qdd[k], gravity=gravity)
        assert np.allclose(found, tau, rtol=1e-11, atol=1e-11)
        assert np.allclose(robot.forward_dynamics(q[k], qd[k], tau, gravity=gravity), qdd[k], atol=1e-9)
        assert np.allclose(robot.regressor(q[k], qd[k], qdd[k], gravity=gravity) @ general.theta_b, tau)


def test_functions_that_depend_on_gravity_are_found(walker: Case) -> None:
    """By their values under two gravities."""
    given, robots = {name: x[:1] for name, x in walker.given.items()}, []
    for gravity in ((1.0, 2.0, -9.0), (-5.0, 3.0, 4.0)):
        turned = walker.plain.model.copy()
        turned.gravity.linear = np.array(gravity)
        robots.append(replace(walker.plain, model=turned))
    for name in (name for name in OF_TREES if RECIPES[name].signature.inputs):
        one, other = (RECIPES[name].pinocchio(robot, given) for robot in robots)
        depends = any(
            np.abs(one[key] - other[key]).max() > 1e-5 * (1e-3 + np.abs(one[key]).max()) for key in one
        )
        assert depends == RECIPES[name].signature.depends_on_gravity, name


def test_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The package's own self-test has another gravity for each state; a package under the file's gravity has none."""
    model, package = tmp_path / "arm.npz", tmp_path / "c"
    assert not status("derive", robot_path("scara"), "-o", model, "--gravity-input")
    assert not status("check", model)
    names = "gravity,inverse_dynamics,inverse_dynamics_theta_rows,mass_matrix,regressor_packed,rk4_step_derivatives"
    words = ("emit-c", model, "-o", package, "--gravity-input", "--functions", names)
    assert not status(*words)
    header = (package / "include" / "scara" / "scara.h").read_text(encoding="utf-8")
    assert "const double *qdd, const double *gravity, double *tau);" in header
    assert "const double *gravity, const double *theta_b, double *tau);" in header
    assert "read it from the input gravity[3], m/s^2 in this frame" in header
    build_package(package)
    if shutil.which("c++"):  # a method has the name of its argument
        command = ["c++", "-std=c++17", "-fsyntax-only", "-x", "c++", f"-I{package / 'include'}"]
        subprocess.run([*command, package / "include" / "scara" / "scara.hpp"], check=True)
    capsys.readouterr()
    assert not status("emit-c", model, "-o", package, "--check")
    assert "up to date" in capsys.readouterr().out
    assert not status("emit-c", model, "-o", package, "--check", "--gravity-input")
    plain = tmp_path / "plain"
    assert not status("emit-c", model, "-o", plain, "--functions", "gravity")
    header = (plain / "include" / "scara" / "scara.h").read_text(encoding="utf-8")
    assert "double *gravity" not in header
    assert status("emit-c", model, "-o", plain, "--check", "--gravity-input")
    assert "psdmc emitted the package without it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--estimator", "mass"), "an estimator cannot have gravity as an input"),
    ],
)
def test_wrong_options_are_refused(
    words: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case("scara").model.save(tmp_path / "arm.npz")
    assert status("emit-c", tmp_path / "arm.npz", "-o", tmp_path / "c", "--gravity-input", *words)
    assert said in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_wrong_input_is_refused() -> None:
    own = case("scara")
    with pytest.raises(InputError, match="under the gravity of its file only"):
        psdmc.compile(bundled_model("scara"), gravity_input=True)
    with pytest.raises(InputError, match="E and P contain one direction of gravity"):
        psdmc.derive(robot_path("scara"), gravity_input=True, expand=True)
    with pytest.raises(InputError, match="expected True or False"):
        psdmc.compile(own.model, gravity_input="yes")  # type: ignore[arg-type]
    with without_optimisation():
        robot = psdmc.compile(own.model, functions=("gravity", "mass_matrix"), gravity_input=True)
        plain = psdmc.compile(own.model, functions=("gravity",))
    q = own.given["q"]
    with pytest.raises(InputError, match=r"gravity: gravity has shape \(4,\), expected \(..., 3\)"):
        robot.gravity(q, gravity=[0.0, 0.0, 0.0, -9.81])
    with pytest.raises(InputError, match="gravity"):
        robot.gravity(q, gravity="down")
    with pytest.raises(InputError, match="shapes do not broadcast"):
        robot.gravity(q, gravity=np.zeros((COUNT + 1, 3)))
    with pytest.raises(InputError, match="compile with gravity_input=True"):
        plain.gravity(q, gravity=[0.0, 0.0, -9.81])
    with pytest.raises(TypeError, match="gravity"):
        robot.mass_matrix(q, gravity=[0.0, 0.0, -9.81])  # type: ignore[call-arg]
    assert np.isnan(robot.gravity(q, gravity=[np.nan] * 3)[:, 2]).all()


def test_more_base_parameters() -> None:
    """Published counts of arms on the floor are for gravity along the first axis."""
    assert [case(name).model.l for name in ("scara", "kr6")] == [10, 38]
    assert [bundled_model(name).l for name in ("scara", "kr6")] == [8, 36]
    chain = case("kr6").model.mechanism
    assert np.array_equal(chain.gravity, bundled_model("kr6").mechanism.gravity)
    assert not np.array_equal(under_general_gravity(chain).gravity, chain.gravity)
