"""emit-c --with casadi: CasADi's functions from the emitted code, their Jacobians, and an optimal control problem."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import ROBOTS, bundled_model, bundled_robot
from command_line import typed
from pinocchio_in_casadi import acceleration
from random_trees import RandomTree
from robots_at_hand import in_wheel
from unoptimised import without_optimisation

import psdmc
from psdmc.backends.c.adapters import lacking
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
External = Callable[[str], "casadi.Function"]


def external(robot: str, folder: Path, functions: list[str], model: DynamicsModel | None = None) -> External:
    """A robot's functions for CasADi, compiled as the header of the emitted file says."""
    known = model or bundled_model(robot)
    emit_c(known, folder, "factored", functions, adapters=["casadi"], name=robot)
    return built(robot, folder)


def built(robot: str, folder: Path, level: str = "-O1") -> External:
    """The functions of a package's folder, compiled with this level of optimisation."""
    library = folder / f"lib{robot}_casadi.so"
    command = [*find_compiler().command, "-std=c99", "-Wall", "-Wextra", "-Werror", level, "-shared", "-fPIC"]
    words = [
        *command,
        f"-I{folder}/include",
        str(folder / f"casadi/{robot}_casadi.c"),
        "-lm",
        "-o",
        str(library),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return lambda name: casadi.external(f"{robot}_{name}", str(library))


@pytest.fixture(scope="module")
def scara(tmp_path_factory: pytest.TempPathFactory) -> External:
    return external("scara", tmp_path_factory.mktemp("casadi") / "scara", FUNCTIONS)


@pytest.fixture(scope="module")
def kr6(tmp_path_factory: pytest.TempPathFactory) -> External:
    return external("kr6", tmp_path_factory.mktemp("casadi") / "kr6", ["forward_dynamics"])


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
    with pytest.raises(RuntimeError, match="Derivatives cannot be calculated"):
        scara("mass_matrix").jacobian()


ON_FLOATING = [
    *("inverse_dynamics", "forward_dynamics", "mass_matrix", "gravity", "jacobian", "kinetic_energy"),
    *("inverse_dynamics_derivatives", "inverse_dynamics_vjp", "integrate", "difference", "neutral"),
]


@cache
def free_tree() -> RandomTree:
    """A free root with a hinge."""
    return RandomTree(5, (-1, 0), "FR")


@cache
def free_model() -> DynamicsModel:
    return derive_model(free_tree().mechanism(), expand=False)


@cache
def free_state() -> dict[str, np.ndarray]:
    """One state for every input that these functions read."""
    model, rng = free_model(), np.random.default_rng(2)
    sizes = Sizes(model.n, model.nq, model.nv, model.l, len(model.frame_names))
    read = {q.name: q for name in ON_FLOATING for q in RECIPES[name].signature.inputs}
    found = {name: rng.uniform(-1.0, 1.0, sizes.shape(quantity.axes)) for name, quantity in read.items()}
    for name, quantity in read.items():
        if quantity.axes == Q.axes:
            found[name] = on_joints(model.mechanism, found[name][None])[0]
    return found


@pytest.fixture(scope="module")
def floating(tmp_path_factory: pytest.TempPathFactory) -> External:
    return external("floating", tmp_path_factory.mktemp("casadi") / "floating", ON_FLOATING, free_model())


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


@pytest.mark.parametrize("name", [name for name in ON_FLOATING if name != "neutral"])
def test_on_a_floating_base_no_function_offers_a_jacobian(floating: External, name: str) -> None:
    """CasADi says so when it is asked, for Jacobians and for reverse mode, instead of failing when it calls them."""
    function = floating(name)
    for asked in (function.jacobian, lambda: function.reverse(1)):
        with pytest.raises(RuntimeError, match="Derivatives cannot be calculated"):
            asked()


def test_the_command_says_what_a_floating_base_lacks(tmp_path: Path) -> None:
    save(free_model(), tmp_path / "free.npz")
    done = typed("emit-c", "free.npz", "--functions", "gravity,neutral", "--with", "casadi", cwd=tmp_path)
    assert (
        "note: CasADi derivatives are not available for a floating base (the C code is not affected); "
        "CasADi can call, without derivatives: gravity, neutral\n" in done.stdout
    )
    assert not (tmp_path / "free" / "src" / "gravity_derivatives.c").exists(), "nobody asked for it"


@pytest.mark.slow
def test_casadi_calls_the_functions_of_hyq(tmp_path: Path) -> None:
    """The command's own words and file, the package's default functions, and Pinocchio's reading of the same URDF."""
    urdf = in_wheel("hyq_no_sensors.urdf")
    assert typed("derive", urdf, "--floating", "-o", "hyq.npz", cwd=tmp_path).returncode == 0
    done = typed("emit-c", "hyq.npz", "-o", "hyq", "--name", "hyq", "--with", "casadi", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "note: CasADi derivatives are not available for a floating base" in done.stdout

    call = built("hyq", tmp_path / "hyq", "-O0")
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
    with pytest.raises(RuntimeError, match="Derivatives cannot be calculated"):
        call("inverse_dynamics").jacobian()


def test_robots_with_and_without_long_coordinates() -> None:
    """A ball joint is no floating base; three translations have three rates."""
    arm = ((-1, 0), "RS"), ((-1, 0), "RT")
    spherical, sliding = (RandomTree(3, parents, kinds).mechanism() for parents, kinds in arm)
    assert lacking(sliding, ["casadi"]) == ()
    assert lacking(spherical, []) == ()
    assert lacking(spherical, ["casadi"]) == (
        "CasADi derivatives are not available for joint 'joint1', whose q is longer than its rates",
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
