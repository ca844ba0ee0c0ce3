"""One theta_b per state: every layout against Pinocchio with the bodies of each row, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from direct import Direct
from loop_trees import four_bar_legs
from lowered import lowered
from random_chains import _body
from random_trees import TREES, RandomTree
from unoptimised import compiled, without_optimisation

import psdmc
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.compiler import emit
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import BY_ROWS, OF_TREES, RECIPES, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.program.kernel import THETA_ROWS
from psdmc.program.signature import OF_ROWS, Signature
from psdmc.recipes.recipe import VALUES
from psdmc.robot.reference import Reference, reference
from psdmc.toolchain.build_package import build_package, checks_of
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.interface import interface_of

Array = np.ndarray

COUNT = 37
"""Rows: several blocks of lanes, and a part of one."""

LIMIT = {"float64": 1e-12, "float32": 2e-4}
"""Of each output's largest entry."""

LIMIT_OF_LOOPS = 1e-10
"""The same for loops, whose equations have larger condition numbers."""

QUICK = (
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "inverse_dynamics_vjp_parameters",
    "semi_implicit_euler",
)
EVERY = tuple(name for name in OF_TREES if SIGNATURES[name].theta and not SIGNATURES[name].calls)
"""Functions of robots without loops whose C is a straight line; those that call others have a test of their own."""

OF_LOOPS = tuple(
    name
    for name, each in SIGNATURES.items()
    if each.theta and not each.calls and {*OF_ROWS} & {axis for q in each.outputs for axis in q.axes}
)
"""Functions that close loops."""

ROBOTS = {"fixed": ((-1, 0, 1), "RPR"), "floating": (TREES["a wrist with two fingers"], "FRSL")}


@dataclass(frozen=True, eq=False)
class Robots:
    """A robot's model, and COUNT robots of its geometry with other bodies: theta_b of each, and Pinocchio's models."""

    model: DynamicsModel
    thetas: Array
    pinocchio: tuple[Reference, ...]

    @cached_property
    def given(self) -> dict[str, Array]:
        """Every quantity that functions read, (COUNT, ...)."""
        rng, sizes = np.random.default_rng(5), package_info(self.model).sizes
        read = {q.name: q for recipe in RECIPES.values() for q in recipe.signature.inputs}
        found = {
            q.name: q.drawn(rng.uniform(-1.0, 1.0, (COUNT, *sizes.shape(q.axes)))) for q in read.values()
        }
        for q in read.values():
            if q.axes == ("nq",):
                found[q.name] = on_joints(self.model.mechanism, found[q.name])
        tau = [
            one.inverse_dynamics(*(found[name][k : k + 1] for name in ("q", "qd", "qdd")))
            for k, one in enumerate(self.pinocchio)
        ]
        return found | {"tau": np.concatenate(tau)}

    def expected(self, function: str) -> dict[str, Array]:
        rows = [
            RECIPES[function].pinocchio(one, {name: array[k : k + 1] for name, array in self.given.items()})
            for k, one in enumerate(self.pinocchio)
        ]
        found = {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}
        packs = RECIPES[function].packs
        if packs is None:
            return found
        places = np.array(packs.places(self.model.mechanism, self.model.representative)).T
        (matrix,) = found.values()
        return {VALUES.name: matrix[:, places[0], places[1]]}


@cache
def robots(name: str) -> Robots:
    parents, kinds = ROBOTS[name]
    tree = RandomTree(4, parents, kinds)
    model = derive_model(tree.mechanism(), expand=False)
    rng, thetas, references = np.random.default_rng(6), [], []
    for _ in range(COUNT):
        tree.parameters = np.array([_body(rng) for _ in parents])
        thetas.append(model.B @ tree.mechanism().parameters.reshape(-1))
        other, joints = tree._pinocchio()
        for frame in model.mechanism.frames:
            place = pin.SE3(frame.placement.rotation.copy(), frame.placement.translation.copy())
            other.addFrame(pin.Frame(frame.name, joints[frame.joint], 0, place, pin.FrameType.OP_FRAME))
        references.append(Reference(other, "tip"))
    return Robots(model, np.array(thetas), tuple(references))


@cache
def robots_with_loops() -> Robots:
    """Contacts and closed loops with passive joints on a floating base."""
    own, rng, thetas, references = four_bar_legs(), np.random.default_rng(6), [], []
    for _ in range(COUNT):
        bodies = np.array([[*_body(rng), 0.0] for _ in own.loaded.mechanism.joints])
        thetas.append(own.model.B @ bodies.reshape(-1))
        references.append(reference(own.loaded, parameters=bodies))
    return Robots(own.model, np.array(thetas), tuple(references))


@cache
def package(model: DynamicsModel, real: str, functions: tuple[str, ...]) -> tuple[PackageView, CompiledRobot]:
    kernels = lowered(model, "factored", [f"{each}{THETA_ROWS}" for each in functions])
    made = package_view(package_info(model, "robot"), kernels, EmitOptions(real=real))  # type: ignore[arg-type]
    return made, CompiledRobot(interface_of(made), compiled(made, False))


def named(function: Signature, found: object) -> dict[str, Array]:
    values = [found] if len(function.outputs) == 1 else list(found)  # type: ignore[call-overload]
    return {output.name: np.asarray(value) for output, value in zip(function.outputs, values, strict=True)}


def compare(
    function: str, expected: dict[str, Array], found: dict[str, Array], own: Robots, limit: float
) -> None:
    gradient = RECIPES[function].gradient
    for name, values in expected.items():
        whole = (found[name] * own.thetas).sum(axis=-1) if name == gradient else found[name]
        scale = max(
            float(np.abs(values).max()), 1e-9 * max(float(np.abs(v).max()) for v in expected.values())
        )
        assert np.abs(whole.reshape(values.shape) - values).max() < limit * scale, name


def by_lane(made: PackageView, library: Direct, function: str, inputs: list[Array]) -> dict[str, Array]:
    lanes, blocks, laid = made.lanes, -(-COUNT // made.lanes), []
    for array in inputs:
        padded = np.ones((blocks * lanes, array[0].size), made.options.real)
        padded[:COUNT] = array.reshape(COUNT, -1)
        laid.append(np.ascontiguousarray(padded.reshape(blocks, lanes, -1).transpose(0, 2, 1)))
    kernel = next(kernel for kernel in made.kernels if kernel.name == f"{function}{THETA_ROWS}")
    found = {out.name: np.zeros((blocks, out.size, lanes), made.options.real) for out in kernel.outputs}
    library(f"{kernel.name}_batch_soa", COUNT, *laid, *found.values())
    return {
        name: array.transpose(0, 2, 1).reshape(blocks * lanes, -1)[:COUNT] for name, array in found.items()
    }


def by_state(made: PackageView, library: Direct, function: str, inputs: list[Array]) -> dict[str, Array]:
    kernel = next(kernel for kernel in made.kernels if kernel.name == f"{function}{THETA_ROWS}")
    found = {out.name: np.zeros((COUNT, out.size), made.options.real) for out in kernel.outputs}
    for k in range(COUNT):
        given = [np.ascontiguousarray(array[k].reshape(-1), made.options.real) for array in inputs]
        library(kernel.name, *given, *(array[k] for array in found.values()))
    return found


CASES = [(robot, real) for robot in ROBOTS for real in LIMIT]


@pytest.mark.parametrize(
    ("robot", "real", "functions"),
    [
        *(
            pytest.param(robot, real, QUICK, marks=[pytest.mark.slow] if (robot, real) == CASES[-1] else [])
            for robot, real in CASES
        ),
        *(pytest.param(robot, real, EVERY, marks=pytest.mark.slow) for robot, real in CASES),
    ],
    ids=lambda value: value if isinstance(value, str) else f"{len(value)} functions",
)
def test_each_row_is_pinocchios_with_its_own_bodies(
    robot: str, real: str, functions: tuple[str, ...]
) -> None:
    every_layout_matches(robots(robot), real, functions, LIMIT[real])


@pytest.mark.slow
@pytest.mark.parametrize("function", OF_LOOPS)
def test_each_row_closes_its_loops_with_its_own_bodies(function: str) -> None:
    every_layout_matches(robots_with_loops(), "float64", (function,), LIMIT_OF_LOOPS)


def every_layout_matches(own: Robots, real: str, functions: tuple[str, ...], limit: float) -> None:
    made, called = package(own.model, real, functions)
    library = Direct(made, called.library)
    for function in functions:
        signature = SIGNATURES[function]
        inputs = [own.given[q.name] for q in signature.inputs]
        expected = own.expected(function)
        compare(function, expected, named(signature, called.call(signature, inputs, own.thetas)), own, limit)
        whole = [*inputs, own.thetas]
        compare(function, expected, by_lane(made, library, function, whole), own, limit)
        compare(function, expected, by_state(made, library, function, whole), own, limit)


SCARA = "examples/robots/scara.toml"


@pytest.fixture(scope="module")
def arm() -> tuple[DynamicsModel, CompiledRobot]:
    model = psdmc.derive(Path(__file__).parents[2] / SCARA)
    with without_optimisation():
        robot = psdmc.compile(model)
        robot.inverse_dynamics(*np.zeros((3, 1, 4)), theta_b=np.ones((1, model.l)))
    return model, robot


def drawn_rows(model: DynamicsModel, *lead: int) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng(8)
    q, qd, qdd = rng.uniform(-1.0, 1.0, (3, *lead, 4))
    return q, qd, qdd, model.known_theta_b() * rng.uniform(0.8, 1.2, (*lead, model.l))


def test_a_compiled_robot_and_its_model_take_rows_and_broadcast_them(
    arm: tuple[DynamicsModel, CompiledRobot],
) -> None:
    model, robot = arm
    q, qd, qdd, thetas = drawn_rows(model, 6)
    given = q[:2, None], qd[:2, None], qdd[:2, None]
    expected = np.array(
        [[model.regressor(*(x[k] for x in (q, qd, qdd))) @ theta for theta in thetas] for k in range(2)]
    )
    for each in (robot, model):
        found = each.inverse_dynamics(*given, theta_b=thetas)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
        out = np.empty((2, 6, 4))
        assert each.inverse_dynamics(*given, theta_b=thetas.tolist(), out=out) is out
        assert np.array_equal(out, found)
        assert each.inverse_dynamics(*(x[:0] for x in (q, qd, qdd)), theta_b=thetas[:0]).shape == (0, 4)


def test_chunks_of_dask_take_their_rows(arm: tuple[DynamicsModel, CompiledRobot]) -> None:
    array = pytest.importorskip("dask.array")
    model, robot = arm
    q, qd, qdd, thetas = drawn_rows(model, 10)
    chunks = array.from_array(q, chunks=(4, 4))
    for each in (robot, model):
        found = each.inverse_dynamics(chunks, qd, qdd, theta_b=thetas)
        assert np.array_equal(found.compute(), each.inverse_dynamics(q, qd, qdd, theta_b=thetas))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda thetas: thetas[:, :3], r"inverse_dynamics: theta_b has shape \(6, 3\), expected \(..., 8\)"),
        (lambda thetas: thetas[:4], r"inverse_dynamics: shapes do not broadcast: .* theta_b \(4, 8\)"),
        (
            lambda thetas: np.where(np.arange(8) == 5, np.nan, thetas),
            r"inverse_dynamics: theta_b\[0, 5\] is nan",
        ),
        (lambda thetas: [[1.0, 2.0], [3.0]], "inverse_dynamics: theta_b is no array of numbers"),
    ],
)
def test_other_rows_are_refused(arm: tuple[DynamicsModel, CompiledRobot], spoil, message: str) -> None:
    model, robot = arm
    q, qd, qdd, thetas = drawn_rows(model, 6)
    for each in (robot, model):
        with pytest.raises(InputError, match=message):
            each.inverse_dynamics(q, qd, qdd, theta_b=spoil(thetas))


def test_a_mass_matrix_that_is_not_positive_spoils_its_own_row(
    arm: tuple[DynamicsModel, CompiledRobot],
) -> None:
    model, robot = arm
    q, qd, tau, thetas = drawn_rows(model, 6)
    thetas[2] *= -1.0
    with without_optimisation():
        found = robot.forward_dynamics(q, qd, tau, theta_b=thetas)
    assert np.isnan(found).any(axis=1).tolist() == [False, False, True, False, False, False]


def test_a_step_calls_forward_dynamics_with_the_parameters_of_its_row(
    arm: tuple[DynamicsModel, CompiledRobot],
) -> None:
    model, robot = arm
    q, qd, tau, thetas = drawn_rows(model, 3)
    with without_optimisation():
        found = robot.rk4_step(q, qd, tau, 0.01, theta_b=thetas)
    for k, theta in enumerate(thetas):

        def acceleration(at: Array, rate: Array, theta: Array = theta, k: int = k) -> Array:
            return model.forward_dynamics(at, rate, tau[k], theta_b=theta)

        rates = [(qd[k], acceleration(q[k], qd[k]))]
        for share in (0.005, 0.005, 0.01):
            rate = qd[k] + share * rates[-1][1]
            rates.append((rate, acceleration(q[k] + share * rates[-1][0], rate)))
        weights = np.array([1, 2, 2, 1]) * 0.01 / 6
        np.testing.assert_allclose(found.qd_next[k], qd[k] + weights @ [a for _, a in rates], atol=1e-12)
        np.testing.assert_allclose(found.q_next[k], q[k] + weights @ [v for v, _ in rates], atol=1e-12)


def test_a_package_with_rows_tests_itself(arm: tuple[DynamicsModel, CompiledRobot], tmp_path: Path) -> None:
    names = ["inverse_dynamics_theta_rows", "forward_dynamics_theta_rows"]
    psdmc.emit_c(arm[0], tmp_path / "arm", functions=names, name="arm")
    header = (tmp_path / "arm/include/arm/arm.h").read_text()
    assert "void arm_inverse_dynamics_theta_rows_batch(size_t count, const double *q" in header
    assert "arm_inverse_dynamics(" not in header
    assert checks_of(build_package(tmp_path / "arm")) == "6 checks of 2 functions"


def test_what_has_no_batches_has_no_rows(arm: tuple[DynamicsModel, CompiledRobot], tmp_path: Path) -> None:
    names = ["gravity_theta_rows"]
    with pytest.raises(InputError, match="target cortex-m4f has no functions for many states"):
        psdmc.emit_c(arm[0], tmp_path / "arm", functions=names, target="cortex-m4f")
    with pytest.raises(InputError, match="the back end rust has no --functions NAME_theta_rows"):
        emit(arm[0], tmp_path / "arm", "rust", functions=names)
    with pytest.raises(InputError, match="function 'regressor_theta_rows' is not known"):
        psdmc.emit_c(arm[0], tmp_path / "arm", functions=["regressor_theta_rows"])
    assert not (tmp_path / "arm").exists()


def test_rows_are_no_functions_of_their_own() -> None:
    assert set(BY_ROWS) == {f"{name}{THETA_ROWS}" for name, each in SIGNATURES.items() if each.theta}
    assert not set(BY_ROWS) & set(RECIPES)
