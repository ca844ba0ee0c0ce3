"""emit-c --with casadi: CasADi's functions from the emitted code, their Jacobians, and an optimal control problem."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import (
    ROBOTS,
    bundled_model,
    bundled_robot,
    robot_path,
    under_gravity,
    weighed_model,
)
from command_line import typed
from installed import in_wheel
from pinocchio_in_casadi import acceleration, inverse_dynamics
from random_trees import RandomTree
from unoptimised import without_optimisation

import psdmc
from psdmc.backends.c.adapters import remarks
from psdmc.compiler import emit_c
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.model.store import save
from psdmc.program.signature import Q, Sizes
from psdmc.robot.reference import Reference, reference
from psdmc.toolchain.compiler_command import find_compiler

casadi = pytest.importorskip("casadi")
sys.path.insert(0, str(ROBOTS.parent / "trajectory_optimisation"))

FUNCTIONS = [
    "inverse_dynamics",
    "forward_dynamics",
    "gravity",
    "mass_matrix",
    "forward_kinematics",
    "kinetic_energy",
]


@dataclass(frozen=True)
class External:
    """The functions of a library, by their names without the robot's."""

    robot: str
    library: str

    def __call__(self, name: str) -> casadi.Function:
        return casadi.external(f"{self.robot}_{name}", self.library)


def external(
    robot: str,
    folder: Path,
    functions: list[str],
    model: DynamicsModel | None = None,
    level: str = "-O0",
    adapter: str = "casadi",
) -> External:
    """A robot's functions for CasADi, compiled as the header of the emitted file says."""
    known = model or bundled_model(robot)
    emit_c(known, folder, "factored", functions, adapters=[adapter], name=robot)
    return built(robot, folder, level, adapter)


def built(robot: str, folder: Path, level: str = "-O0", adapter: str = "casadi") -> External:
    """The functions of a package's folder, compiled with this level of optimisation."""
    library = folder / f"lib{robot}_{adapter}.so"
    command = [*find_compiler().command, "-std=c99", "-Wall", "-Wextra", "-Werror", level, "-shared", "-fPIC"]
    words = [
        *command,
        f"-I{folder}/include",
        str(folder / f"{adapter}/{robot}_{adapter}.c"),
        "-lm",
        "-o",
        str(library),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return External(robot, str(library))


@pytest.fixture(scope="module")
def scara(tmp_path_factory: pytest.TempPathFactory) -> External:
    return external("scara", tmp_path_factory.mktemp("casadi") / "scara", FUNCTIONS)


@pytest.fixture(scope="module")
def kr6(tmp_path_factory: pytest.TempPathFactory) -> External:
    return external("kr6", tmp_path_factory.mktemp("casadi") / "kr6", ["forward_dynamics"], level="-O1")


def state(seed: int, n: int = 4) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    return tuple(limit * rng.uniform(-1.0, 1.0, n) for limit in (3.0, 3.0, 5.0))


def pinocchio_of(name: str) -> Reference:
    return reference(bundled_robot(name))


def close(found: object, expected: np.ndarray, limit: float = 1e-10) -> None:
    """Within a share of the largest entry; vectors as columns."""
    values = np.asarray(expected, float).reshape(np.array(found).shape)
    assert np.abs(np.array(found) - values).max() <= limit * np.abs(values).max()


@pytest.mark.parametrize("seed", range(3))
def test_functions_are_pinocchios(scara: External, seed: int) -> None:
    (q, qd, x), robot = state(seed), pinocchio_of("scara")
    close(scara("inverse_dynamics")(q, qd, x), robot.inverse_dynamics(q[None], qd[None], x[None]))
    close(scara("forward_dynamics")(q, qd, x), robot.forward_dynamics(q[None], qd[None], x[None]))
    close(scara("mass_matrix")(q), robot.mass_matrix(q[None]))
    _, rotation = scara("forward_kinematics")(q)
    close(rotation, robot.poses(q[None], [robot.tip_name])[0, 0, :3, :3])


@pytest.mark.parametrize("seed", range(3))
def test_jacobians_are_pinocchios(scara: External, seed: int) -> None:
    given, robot = state(seed), pinocchio_of("scara")
    rows = [v[None] for v in given]
    inverse = scara("inverse_dynamics").jacobian()(*given, 0)
    for block, expected in zip(inverse, robot.inverse_dynamics_derivatives(*rows), strict=True):
        close(block, expected[0])
    forward = scara("forward_dynamics").jacobian()(*given, 0)
    for block, expected in zip(forward, robot.forward_dynamics_derivatives(*rows)[1:], strict=True):
        close(block, expected[0])
    rest = 0 * given[0]
    by_q = robot.inverse_dynamics_derivatives(rows[0], rest[None], rest[None])[0]
    close(scara("gravity").jacobian()(given[0], 0), by_q[0])


def test_entries_that_are_always_zero_are_no_nonzeros(scara: External) -> None:
    """Turning the first joint of an arm on a floor changes no torque: Pinocchio has zeros there, CasADi stores none."""
    by_q = scara("inverse_dynamics").jacobian().sparsity_out(0)
    expected = pinocchio_of("scara").inverse_dynamics_derivatives(*(v[None] for v in state(7)))[0][0]
    assert 0 < by_q.nnz() < 16
    assert np.array_equal(np.array(casadi.DM(by_q, 1.0)) != 0.0, np.abs(expected) > 1e-9)


def test_graphs_differentiate_through_it(scara: External) -> None:
    """Reverse mode by MX, and calls in SX and on threads."""
    q, qd, x = state(1)
    f, at = scara("forward_dynamics"), casadi.MX.sym("q", 4)
    gradient = casadi.Function("gradient", [at], [casadi.gradient(casadi.sumsqr(f(at, qd, x)), at)])
    by_q = pinocchio_of("scara").forward_dynamics_derivatives(q[None], qd[None], x[None])
    close(gradient(q), 2 * by_q[1][0].T @ by_q[0][0])
    symbol = casadi.SX.sym("q", 4)
    close(casadi.Function("sx", [symbol], [f(symbol, qd, x)])(q), by_q[0])
    many = [np.column_stack(column) for column in zip(*map(state, range(50)), strict=True)]
    one_by_one = np.column_stack([np.array(f(*state(k))) for k in range(50)])
    assert np.array_equal(np.array(f.map(50, "thread", 2)(*many)), one_by_one)


def test_reverse_mode_takes_the_gradient_function_where_it_is_emitted(tmp_path: Path) -> None:
    f = external("scara", tmp_path / "scara", ["forward_dynamics", "forward_dynamics_vjp"])(
        "forward_dynamics"
    )
    q, qd, x = state(4)
    at = [casadi.MX.sym(name, 4) for name in ("q", "qd", "tau")]
    slopes = [casadi.gradient(casadi.dot(casadi.DM([1, -2, 3, 0.5]), f(*at)), one) for one in at]
    found = casadi.Function("slopes", at, slopes)
    assert f.reverse(1).class_name() == "External"  # not made by CasADi from the Jacobian
    blocks = pinocchio_of("scara").forward_dynamics_derivatives(q[None], qd[None], x[None])[1:]
    for gradient, block in zip(found(q, qd, x), blocks, strict=True):
        close(gradient, block[0].T @ [1, -2, 3, 0.5])


def test_wrenches_are_an_input_with_derivatives(tmp_path: Path) -> None:
    """Of two frames; the Jacobian, and the reverse mode of the emitted gradient."""
    model = psdmc.derive(robot_path("kr6"), frames=["link4", "link6"])
    functions = ["forward_dynamics_with_wrenches", "forward_dynamics_with_wrenches_vjp", "frame_acceleration"]
    called = external("kr6", tmp_path / "kr6", functions, model)
    f, frame = called("forward_dynamics_with_wrenches"), called("frame_acceleration")
    rng = np.random.default_rng(3)
    given = [*state(5, 6), rng.uniform(-20.0, 20.0, (2, 6))]
    given[3] = given[3].T  # CasADi has a column per frame
    blocks = f.jacobian()(*given, 0)
    at = [casadi.MX.sym(f"x{k}", *np.shape(np.atleast_2d(value.T).T)) for k, value in enumerate(given)]
    weights = np.array([1, -2, 3, 0.5, -1, 2])
    slopes = [casadi.gradient(casadi.dot(casadi.DM(weights), f(*at)), one) for one in at]
    found = casadi.Function("slopes", at, slopes)(*given)
    for k, (block, gradient) in enumerate(zip(blocks, found, strict=True)):
        flat = given[k].reshape(-1, order="F")
        for j in range(flat.size):
            ahead, behind = ([*given], [*given])
            for side, sign in ((ahead, 1e-5), (behind, -1e-5)):
                side[k] = (flat + sign * np.eye(flat.size)[j]).reshape(given[k].shape, order="F")
            slope = (np.array(f(*ahead)) - np.array(f(*behind)))[:, 0] / 2e-5
            assert np.abs(np.array(block)[:, j] - slope).max() <= 1e-6 * np.abs(np.array(block)).max()
        column = np.array(gradient).reshape(-1, order="F")
        close(column, np.array(block).T @ weights)
    assert frame.jacobian().class_name() == "External"


def test_missing_inputs_are_zero_and_unwanted_outputs_are_not_written(scara: External) -> None:
    """CasADi hands over null pointers for both."""
    f = scara("inverse_dynamics")
    close(f(q=state(2)[0])["tau"], pinocchio_of("scara").gravity(state(2)[0][None]))
    at = casadi.MX.sym("q", 4)
    alone = casadi.Function("position", [at], [scara("forward_kinematics")(at)[0]])
    close(
        alone(state(2)[0]),
        pinocchio_of("scara").poses(state(2)[0][None], [pinocchio_of("scara").tip_name])[0, 0, :3, 3],
    )


def test_a_function_without_derivatives_says_so(scara: External) -> None:
    """Derivatives are not differentiated again."""
    with pytest.raises(RuntimeError, match="Derivatives cannot be calculated"):
        scara("inverse_dynamics_derivatives").jacobian()


ON_FLOATING = [
    *("inverse_dynamics", "forward_dynamics", "mass_matrix", "gravity", "jacobian", "kinetic_energy"),
    *("inverse_dynamics_derivatives", "inverse_dynamics_vjp", "integrate", "difference", "neutral"),
    *("forward_dynamics_jvp", "tangent_map"),
]


@cache
def free_tree() -> RandomTree:
    """A floating base with a hinge."""
    return RandomTree(5, (-1, 0), "FR")


@cache
def free_model() -> DynamicsModel:
    return derive_model(free_tree().mechanism(), expand=False)


@cache
def free_state() -> dict[str, np.ndarray]:
    """One state for every input that these functions read."""
    model, rng = free_model(), np.random.default_rng(2)
    sizes = Sizes.of(model.mechanism, model.l)
    read = {q.name: q for name in ON_FLOATING for q in RECIPES[name].signature.inputs}
    found = {name: rng.uniform(-1.0, 1.0, sizes.shape(quantity.axes)) for name, quantity in read.items()}
    for name, quantity in read.items():
        if quantity.axes == Q.axes:
            found[name] = on_joints(model.mechanism, found[name][None])[0]
    return found


@pytest.fixture(scope="module")
def floating(tmp_path_factory: pytest.TempPathFactory) -> External:
    return external("floating", tmp_path_factory.mktemp("casadi") / "floating", ON_FLOATING, free_model())


def test_momenta_and_wrenches_differentiate_by_every_entry_of_q(tmp_path: Path) -> None:
    """Against difference quotients of CasADi's functions, which divide the quaternion by its length."""
    names = ["centroidal_momentum_rate", "inverse_dynamics_with_wrenches"]
    called = external("floating", tmp_path / "floating", names, free_model())
    rng = np.random.default_rng(6)
    for name in names:
        f = called(name)
        given = [rng.uniform(-1.0, 1.0, f.size_in(k)) for k in range(f.n_in())]
        for k, block in enumerate(f.jacobian()(*given, 0)):
            for j in range(given[k].size):
                ends = []
                for step in (1e-5, -1e-5):
                    there = [value.copy(order="F") for value in given]
                    there[k].reshape(-1, order="F")[j] += step
                    ends.append(np.array(f(*there))[:, 0])
                slope = (ends[0] - ends[1]) / 2e-5
                assert np.abs(np.array(block)[:, j] - slope).max() <= 1e-6 * np.abs(np.array(block)).max()


@pytest.mark.parametrize("name", ON_FLOATING)
def test_functions_on_a_floating_base_are_the_compiled_robots(floating: External, name: str) -> None:
    """Those are Pinocchio's (tests/functions)."""
    given = [free_state()[quantity.name] for quantity in RECIPES[name].signature.inputs]
    found = floating(name)(*given) if given else floating(name)()["q"]
    with without_optimisation():
        robot = psdmc.compile(free_model(), functions=ON_FLOATING)
    expected = getattr(robot, name)(*given)
    pairs = zip(found, expected, strict=True) if isinstance(found, tuple) else [(found, expected)]
    for one, other in pairs:
        close(one, np.asarray(other), 1e-12)


def test_on_a_floating_base_they_are_pinocchios(floating: External) -> None:
    oracle = Reference(free_tree().model, "tip")
    q, qd, qdd = (free_state()[name] for name in ("q", "qd", "qdd"))
    rows = [v[None] for v in (q, qd, qdd)]
    close(floating("inverse_dynamics")(q, qd, qdd), oracle.inverse_dynamics(*rows))
    close(floating("forward_dynamics")(q, qd, qdd), oracle.forward_dynamics(*rows))
    close(floating("mass_matrix")(q), oracle.mass_matrix(rows[0]))


def off_the_sphere(length: float) -> list[np.ndarray]:
    """q with a quaternion of this length, qd, and accelerations or torques."""
    q, qd, x = (free_state()[name] for name in ("q", "qd", "qdd"))
    return [np.concatenate([q[:3], length * q[3:7], q[7:]]), qd, x]


@cache
def oracles() -> dict[str, casadi.Function]:
    """Inverse and forward dynamics and gravity of f(q with its quaternion divided by its length)."""
    model = free_tree().model
    torques = inverse_dynamics(model)
    q, still = casadi.SX.sym("q", model.nq), np.zeros(model.nv)
    gravity = casadi.Function("gravity", [q], [torques(q, still, still)])
    return {"inverse_dynamics": torques, "forward_dynamics": acceleration(model), "gravity": gravity}


def test_the_oracle_is_pinocchio() -> None:
    model = free_tree().model
    q, qd, x = off_the_sphere(1.0)
    close(oracles()["inverse_dynamics"](q, qd, x), pin.rnea(model, model.createData(), q, qd, x), 1e-12)
    close(oracles()["forward_dynamics"](q, qd, x), pin.aba(model, model.createData(), q, qd, x), 1e-12)


@pytest.mark.parametrize("length", [0.3, 1.0, 40.0])
@pytest.mark.parametrize("name", ["inverse_dynamics", "forward_dynamics", "gravity"])
def test_on_a_floating_base_derivatives_are_casadis_own_by_every_entry_of_q(
    floating: External, name: str, length: float
) -> None:
    """Jacobians with their zeros, reverse and forward mode; also where the quaternion's length is not one."""
    given = off_the_sphere(length)[: 1 if name == "gravity" else 3]
    function, oracle = floating(name), oracles()[name]
    close(function(*given), oracle(*given))
    at = [casadi.MX.sym(f"x{k}", len(x)) for k, x in enumerate(given)]
    cotangent, directions = np.array([1.0, -2, 3, 0.5, 4, -1, 2]), [np.cos(np.arange(len(x))) for x in given]

    def slopes(f: casadi.Function) -> list[np.ndarray]:
        value = f(*at)
        asked = [casadi.jacobian(value, one) for one in at]
        asked += [casadi.jtimes(value, one, cotangent, True) for one in at]
        asked += [casadi.jtimes(value, one, way) for one, way in zip(at, directions, strict=True)]
        return [np.array(casadi.DM(found)) for found in casadi.Function("slopes", at, asked).call(given)]

    for found, expected in zip(slopes(function), slopes(oracle), strict=True):
        close(found, expected)
    by_q = np.array(
        casadi.DM(function.jacobian()(*given, 0)[0] if len(given) > 1 else function.jacobian()(*given, 0))
    )
    assert np.abs(by_q[:, 3:7] @ given[0][3:7]).max() < 1e-13 * np.abs(by_q).max() * length
    stored = function.jacobian().sparsity_out(0)
    assert np.array(casadi.DM(stored, 1.0))[:, :3].max() == 0.0, "nothing depends on where the base is"
    assert stored.nnz() <= 35


def test_on_a_floating_base_casadi_calls_the_emitted_modes(floating: External) -> None:
    """CasADi does not make them from the Jacobian."""
    assert floating("inverse_dynamics").reverse(1).class_name() == "External"
    assert floating("forward_dynamics").forward(1).class_name() == "External"


def test_tangent_forms_times_the_map_are_the_jacobian(floating: External) -> None:
    given = off_the_sphere(2.0)
    along = floating("inverse_dynamics_derivatives")(*given)[0]
    assert along.shape == (7, 7)
    close(along @ floating("tangent_map")(given[0]), floating("inverse_dynamics").jacobian()(*given, 0)[0])


@pytest.mark.parametrize("length", [0.0, 1e-160, np.nan, 1e160])
@pytest.mark.parametrize(
    "name", ["inverse_dynamics", "jac_floating_forward_dynamics", "integrate", "tangent_map"]
)
def test_a_quaternion_without_a_length_gives_nan_and_a_status(
    floating: External, name: str, length: float
) -> None:
    """In C; CasADi stops with an error, and a solver takes the point as one where nothing can be evaluated."""
    given = off_the_sphere(1.0)
    given[0][3:7] *= length
    library = ctypes.CDLL(floating.library)
    symbol = name if name.startswith("jac") else f"floating_{name}"
    out = casadi.external(symbol, floating.library).sparsity_out(0).nnz()
    result, work = np.ones(out + 1), np.zeros(5000)
    pointers = [x.ctypes.data for x in (*given, np.zeros(1))]
    status = getattr(library, symbol)(
        (ctypes.c_void_p * 4)(*pointers),
        (ctypes.c_void_p * 3)(result.ctypes.data, None, None),
        None,
        work.ctypes.data_as(ctypes.c_void_p),
        0,
    )
    assert status == 1
    assert np.isnan(result[:-1]).all()
    assert result[-1] == 1.0, "nothing is written behind the result"
    if not name.startswith("jac"):
        with pytest.raises(RuntimeError, match="Evaluation failed"):
            floating(name)(*given[: floating(name).n_in()])


def test_ball_joints_differentiate_too(tmp_path: Path) -> None:
    """On a fixed base, behind a hinge."""
    tree = RandomTree(3, (-1, 0), "RS")
    function = external(
        "arm", tmp_path / "arm", ["forward_dynamics"], derive_model(tree.mechanism(), expand=False)
    )
    rng = np.random.default_rng(1)
    given = [rng.uniform(-1.0, 1.0, n) for n in (5, 4, 4)]
    found, expected = (
        f.jacobian()(*given, 0) for f in (function("forward_dynamics"), acceleration(tree.model))
    )
    for one, other in zip(found, expected, strict=True):
        close(one, np.array(other))


def test_the_command_says_what_casadi_does_on_a_floating_base(tmp_path: Path) -> None:
    save(free_model(), tmp_path / "free.npz")
    done = typed("emit-c", "free.npz", "--functions", "gravity,neutral", "--with", "casadi", cwd=tmp_path)
    assert (
        "note: CasADi functions normalize the q of a floating base and differentiate by each of its entries; "
        "without derivatives: neutral\n" in done.stdout
    )
    assert (tmp_path / "free" / "src" / "gravity_derivatives.c").exists()


def test_an_optimiser_finds_the_optimum_of_plain_symbols(floating: External) -> None:
    """A floating robot is to turn over and to move its hinge in four steps, with the least effort; IPOPT."""
    ours, theirs = (turned_over(f) for f in (floating("forward_dynamics"), oracles()["forward_dynamics"]))
    assert ours[0] == pytest.approx(theirs[0], rel=1e-7)
    assert np.abs(ours[1] - theirs[1]).max() < 1e-5 * np.abs(theirs[1]).max()


def turned_over(dynamics: casadi.Function, steps: int = 4, dt: float = 0.1) -> tuple[float, np.ndarray]:
    """The cost, and the states and efforts. A quaternion leaves the sphere within a step: nothing but the dynamics makes it
    of length one."""
    opti = casadi.Opti()
    q, qd, tau = opti.variable(8, steps + 1), opti.variable(7, steps + 1), opti.variable(7, steps)
    start, goal = (
        np.array([0, 0, 0, *turn, hinge]) for turn, hinge in (((0, 0, 0, 1), 0.0), ((0, 0.6, 0, 0.8), 0.5))
    )
    for k in range(steps):
        opti.subject_to(qd[:, k + 1] == qd[:, k] + dt * dynamics(q[:, k], qd[:, k], tau[:, k]))
        x, y, z, w = casadi.vertsplit(q[3:7, k])
        spin = casadi.blockcat([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]])
        opti.subject_to(q[3:7, k + 1] == q[3:7, k] + 0.5 * dt * spin @ qd[3:6, k + 1])
        opti.subject_to(q[:3, k + 1] == q[:3, k] + dt * qd[:3, k + 1])
        opti.subject_to(q[7, k + 1] == q[7, k] + dt * qd[6, k + 1])
    opti.subject_to(q[:, 0] == start)
    opti.subject_to(qd[:, 0] == 0)
    opti.subject_to(q[3:6, -1] * goal[6] == goal[3:6] * q[6, -1])
    opti.subject_to(q[7, -1] == goal[7])
    opti.minimize(casadi.sumsqr(tau) + casadi.sumsqr(qd))
    opti.set_initial(q, np.tile(start[:, None], steps + 1))
    quiet = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-10}
    opti.solver("ipopt", quiet | {"ipopt.hessian_approximation": "limited-memory", "ipopt.max_iter": 500})
    found = opti.solve()
    return float(found.value(opti.f)), np.concatenate([found.value(x).ravel() for x in (q, qd, tau)])


@pytest.mark.parametrize("adapter", ["casadi", "casadi_theta", "casadi_hessian"])
def test_gravity_is_an_input_with_derivatives(adapter: str, tmp_path: Path) -> None:
    """Values and Jacobians are Pinocchio's under this gravity. Accelerations are linear in gravity: their derivatives are
    differences of Pinocchio's."""
    names, pull = ["inverse_dynamics", "forward_dynamics"], np.array([3.0, -2.0, 6.0])
    own = {"adapters": [adapter], "gravity_input": True}
    emit_c(
        weighed_model("scara"),
        tmp_path / "c",
        "factored",
        [*names, "inverse_dynamics_vjp"],
        name="scara",
        **own,
    )  # type: ignore[arg-type]
    assert not (tmp_path / "c" / "src" / "forward_dynamics_derivatives.c").exists()
    of, theta = built("scara", tmp_path / "c", adapter=adapter), [np.asarray(weighed_model("scara").theta_b)]
    ending, more = ("_theta", theta) if adapter == "casadi_theta" else ("", [])
    (q, qd, x), plain = state(5), pinocchio_of("scara")
    robot = under_gravity(plain, pull)
    units = [under_gravity(plain, pull + unit) for unit in np.eye(3)]
    for name in names:
        function, values = (
            of(f"{name}{ending}"),
            [getattr(each, name)(q[None], qd[None], x[None])[0] for each in (robot, *units)],
        )
        close(function(q, qd, x, pull, *more), values[0])
        blocks = function.jacobian()(q, qd, x, pull, *more, 0)
        expected = getattr(robot, f"{name}_derivatives")(q[None], qd[None], x[None])[-3:]
        for found, block in zip(blocks, expected, strict=False):
            close(found, block[0])
        close(blocks[3], np.column_stack([value - values[0] for value in values[1:]]))
    symbol = casadi.MX.sym("gravity", 3)
    square = casadi.sumsqr(function(q, qd, x, symbol, *more))
    slopes = np.column_stack([value - values[0] for value in values[1:]])
    gradient = casadi.Function("g", [symbol], [casadi.gradient(square, symbol)])
    close(gradient(pull), 2.0 * slopes.T @ values[0])
    if adapter == "casadi_hessian":
        close(
            casadi.Function("h", [symbol], [casadi.hessian(square, symbol)[0]])(pull), 2.0 * slopes.T @ slopes
        )


@pytest.fixture(scope="module")
def by_theta(tmp_path_factory: pytest.TempPathFactory) -> External:
    """Functions that take theta_b."""
    functions = ["inverse_dynamics", "forward_dynamics", "mass_matrix", "inverse_dynamics_vjp_parameters"]
    folder = tmp_path_factory.mktemp("casadi") / "by_theta"
    return external("floating", folder, functions, free_model(), adapter="casadi_theta")


def heavier(model: pin.Model, factor: float) -> pin.Model:
    """The same robot with all masses and inertias multiplied; base parameters are linear in them."""
    found = model.copy()
    for i, body in enumerate(model.inertias):
        found.inertias[i] = pin.Inertia(factor * body.mass, body.lever, factor * body.inertia)
    found.armature = factor * model.armature
    return found


@pytest.mark.parametrize("name", ["inverse_dynamics", "forward_dynamics"])
def test_functions_take_theta_as_their_last_input(by_theta: External, name: str) -> None:
    """And are differentiated at its value, by all else as CasADi differentiates plain symbols."""
    robot = heavier(free_tree().model, 1.3)
    oracle = (inverse_dynamics if name == "inverse_dynamics" else acceleration)(robot)
    theta, given = 1.3 * np.asarray(free_model().theta_b), off_the_sphere(2.0)
    function = by_theta(f"{name}_theta")
    close(function(*given, theta), oracle(*given))
    for found, expected in zip(
        function.jacobian()(*given, theta, 0), oracle.jacobian()(*given, 0), strict=False
    ):
        close(found, np.array(expected))


def test_derivatives_by_theta(by_theta: External) -> None:
    """Torques are linear in theta_b, so that their slopes are differences; M d qdd / d theta_b are minus such slopes."""
    theta, (q, qd, x) = np.asarray(free_model().theta_b), off_the_sphere(2.0)
    torques, accelerations = by_theta("inverse_dynamics_theta"), by_theta("forward_dynamics_theta")
    slopes = np.column_stack([np.array(torques(q, qd, x, unit)).ravel() for unit in np.eye(len(theta))])
    close(torques.jacobian()(q, qd, x, theta, 0)[3], slopes)

    adjoint = torques.reverse(1)
    assert adjoint.class_name() == "External"
    cotangent = np.array([1.0, -2, 3, 0.5, 4, -1, 2])
    close(adjoint(q, qd, x, theta, 0, cotangent)[3], slopes.T @ cotangent)
    close(
        adjoint(q, qd, x, theta, 0, cotangent)[0],
        np.array(torques.jacobian()(q, qd, x, theta, 0)[0]).T @ cotangent,
    )

    qdd = np.array(accelerations(q, qd, x, theta)).ravel()
    slopes = np.column_stack([np.array(torques(q, qd, qdd, unit)).ravel() for unit in np.eye(len(theta))])
    by_parameters = np.array(accelerations.jacobian()(q, qd, x, theta, 0)[3])
    close(np.array(by_theta("mass_matrix_theta")(q, theta)) @ by_parameters, -slopes)


def test_a_fixed_robot_of_unknown_parameters_takes_theta(tmp_path: Path) -> None:
    """By the command, which names the remedy where --with casadi cannot give the functions."""
    known = bundled_model("two_link")
    replace(known, theta_b=None).save(tmp_path / "arm.npz")
    words = ("emit-c", "arm.npz", "--functions", "gravity,jacobian", "--with", "casadi_theta")
    done = typed(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "note: the base parameters are unknown" in done.stdout
    assert "--with" not in done.stdout
    (robot,) = (
        path.stem.removesuffix("_casadi_theta") for path in (tmp_path / "arm" / "casadi_theta").iterdir()
    )
    gravity = built(robot, tmp_path / "arm", adapter="casadi_theta")("gravity_theta")
    q, theta = state(5, 2)[0], np.asarray(known.theta_b)
    close(gravity(q, theta), pinocchio_of("two_link").gravity(q[None]))
    rest = np.zeros((1, 2))
    close(
        gravity.jacobian()(q, theta, 0)[0],
        pinocchio_of("two_link").inverse_dynamics_derivatives(q[None], rest, rest)[0][0],
    )
    close(np.array(gravity.jacobian()(q, theta, 0)[1]) @ theta, pinocchio_of("two_link").gravity(q[None]))


@pytest.mark.slow
def test_casadi_calls_the_functions_of_hyq(tmp_path: Path) -> None:
    """The command's own words and file, the package's default functions, and Pinocchio's reading of the same URDF."""
    urdf = in_wheel("hyq_no_sensors.urdf")
    assert typed("derive", urdf, "--floating", "-o", "hyq.npz", cwd=tmp_path).returncode == 0
    done = typed("emit-c", "hyq.npz", "-o", "hyq", "--name", "hyq", "--with", "casadi", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "note: CasADi functions normalize the q of a floating base" in done.stdout

    call = built("hyq", tmp_path / "hyq")
    oracle = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    data, rng = oracle.createData(), np.random.default_rng(7)
    q = pin.normalize(oracle, rng.uniform(-1.0, 1.0, oracle.nq))
    qd, other, dq = rng.uniform(-1.0, 1.0, (3, oracle.nv))
    zero = np.zeros(oracle.nv)
    mass = pin.crba(oracle, data, q).copy()
    mass = np.triu(mass) + np.triu(mass, 1).T
    close(call("inverse_dynamics")(q, qd, other), pin.rnea(oracle, data, q, qd, other))
    close(call("forward_dynamics")(q, qd, other), pin.aba(oracle, data, q, qd, other))
    close(call("mass_matrix")(q), mass)
    close(call("nonlinear_effects")(q, qd), pin.rnea(oracle, data, q, qd, zero))
    close(call("gravity")(q), pin.rnea(oracle, data, q, zero, zero))
    close(
        call("coriolis_matrix")(q, qd) @ qd,
        pin.rnea(oracle, data, q, qd, zero) - pin.rnea(oracle, data, q, zero, zero),
    )
    close(call("integrate")(q, dq), pin.integrate(oracle, q, dq))
    q[3:7] *= 1.4
    for name, own in (("inverse_dynamics", inverse_dynamics), ("forward_dynamics", acceleration)):
        blocks = zip(
            call(name).jacobian()(q, qd, other, 0), own(oracle).jacobian()(q, qd, other, 0), strict=True
        )
        for found, expected in blocks:
            close(found, np.array(casadi.DM(expected)), 1e-9)


def test_remarks_of_robots_with_and_without_long_coordinates() -> None:
    """A ball joint is no floating base; three translations have three rates."""
    arm = ((-1, 0), "RS"), ((-1, 0), "RT")
    spherical, sliding = (RandomTree(3, parents, kinds).mechanism() for parents, kinds in arm)
    assert remarks(sliding, ["casadi"], ["gravity"]) == ()
    assert remarks(spherical, [], ["gravity"]) == ()
    assert remarks(spherical, ["casadi", "casadi_theta"], ["gravity"]) == (
        "CasADi functions normalize the q of joint 'joint1' and differentiate by each of its entries",
    )


def test_unknown_parameters_and_single_precision_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="double"):
        emit_c(bundled_model("scara"), tmp_path, real="float32", functions=["gravity"], adapters=["casadi"])
    with pytest.raises(InputError, match="'cassadi'"):
        emit_c(bundled_model("scara"), tmp_path, adapters=["cassadi"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_an_optimal_control_problem_has_the_same_optimum_with_another_model(kr6: External) -> None:
    """KR6 from rest to rest, multiple shooting in IPOPT; the other model is Newton-Euler on CasADi's own symbols."""
    from shooting import point_to_point

    oracle = acceleration(pinocchio_of("kr6").model)
    q, qd, tau = state(3, 6)
    close(oracle(q, qd, tau), pinocchio_of("kr6").forward_dynamics(q[None], qd[None], tau[None]))
    start, goal = np.zeros(6), 0.3 * (-1.0) ** np.arange(6)
    ours = point_to_point(kr6("forward_dynamics"), start, goal, steps=6, duration=0.4)
    theirs = point_to_point(oracle, start, goal, steps=6, duration=0.4)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-6)
    assert np.abs(ours.states - theirs.states).max() < 1e-4
    assert np.abs(ours.states[[0, -1], :6] - [start, goal]).max() < 1e-7
