"""CasADi's derivatives that no emitted function computes: Jacobians of all functions, and exact Hessians."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import ROBOTS, bundled_model, bundled_robot
from command_line import typed
from pinocchio_in_casadi import acceleration
from test_casadi_adapter import (
    External,
    close,
    external,
    free_model,
    free_state,
    free_tree,
    off_the_sphere,
    oracles,
)

from psdmc.backends.c.adapters import casadi_kernels, remarks
from psdmc.functions import RECIPES
from psdmc.robot.reference import reference

casadi = pytest.importorskip("casadi")
sys.path.insert(0, str(ROBOTS.parent / "trajectory_optimisation"))

OTHERS = ("mass_matrix", "kinetic_energy", "jacobian", "forward_kinematics", "integrate", "difference")
TWICE = ("inverse_dynamics", "forward_dynamics", "gravity")
Array = np.ndarray


@pytest.fixture(scope="module")
def floating(tmp_path_factory: pytest.TempPathFactory) -> External:
    """A floating base with a hinge."""
    names = [*TWICE, "mass_matrix", "inverse_dynamics_with_wrenches"]
    folder = tmp_path_factory.mktemp("casadi") / "floating"
    return external("floating", folder, names, free_model(), adapter="casadi_hessian")


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> External:
    return external("floating", tmp_path_factory.mktemp("casadi") / "first", [*OTHERS], free_model())


@pytest.fixture(scope="module")
def scara(tmp_path_factory: pytest.TempPathFactory) -> External:
    folder = tmp_path_factory.mktemp("casadi") / "scara"
    return external("scara", folder, ["forward_dynamics"], level="-O1", adapter="casadi_hessian")


def symbols(given: list[Array]) -> list[casadi.MX]:
    return [casadi.MX.sym(f"x{k}", *casadi.DM(x).shape) for k, x in enumerate(given)]


def with_tip() -> tuple[pin.Model, int]:
    """Pinocchio's model of the tree, with the tip as a frame, and its number."""
    model, (tip,) = free_tree().model.copy(), free_model().mechanism.frames
    placement = pin.SE3(tip.placement.rotation, tip.placement.translation)
    return model, model.addFrame(pin.Frame(tip.name, tip.joint + 1, 0, placement, pin.FrameType.OP_FRAME))


def pinocchios(name: str) -> Callable[..., list[Array]]:
    """A function of Pinocchio's, of q whose quaternion is divided by its length."""
    model, tip = with_tip()
    data = model.createData()

    def at(q: Array) -> Array:
        return np.concatenate([q[:3], q[3:7] / np.linalg.norm(q[3:7]), q[7:]])

    def placed(q: Array) -> list[Array]:
        pin.framesForwardKinematics(model, data, at(q))
        return [data.oMf[tip].translation[None].copy(), data.oMf[tip].rotation.copy()]

    aligned = pin.LOCAL_WORLD_ALIGNED
    return {
        "jacobian": lambda q: [pin.computeFrameJacobian(model, data, at(q), tip, aligned)],
        "forward_kinematics": placed,
        "integrate": lambda q, dq: [pin.integrate(model, at(q), dq)],
        "difference": lambda q, other: [pin.difference(model, at(q), at(other))],
    }[name]


@pytest.mark.parametrize("name", ["jacobian", "forward_kinematics", "integrate", "difference"])
def test_kinematics_have_jacobians_by_every_entry_of_q(first: External, name: str) -> None:
    """Against central differences of Pinocchio's functions; entries of matrices column by column."""
    given = [free_state()[quantity.name].copy() for quantity in RECIPES[name].signature.inputs]
    given[0][3:7] *= 0.7
    function, oracle = first(name), pinocchios(name)
    found = function.jacobian()(*given, *[0] * function.n_out())
    blocks = iter(found if isinstance(found, tuple) else (found,))
    h = 1e-6
    for output in range(function.n_out()):
        for k, x in enumerate(given):
            steps = []
            for unit in np.eye(len(x)):
                ahead, behind = (
                    oracle(*[y + sign * h * unit if i == k else y for i, y in enumerate(given)])[output]
                    for sign in (1, -1)
                )
                steps.append((ahead - behind).ravel(order="F") / (2 * h))
            expected = np.transpose(steps)
            assert np.abs(np.array(casadi.DM(next(blocks))) - expected).max() < 1e-8 * max(
                np.abs(expected).max(), 1
            )


def masses() -> casadi.Function:
    """q -> M: what torques are by accelerations, in which they are affine."""
    at, rates = symbols([np.zeros(8), np.zeros(7)])
    M = casadi.jacobian(oracles()["inverse_dynamics"](at, 0 * rates, rates), rates)
    return casadi.Function("M", [at], casadi.substitute([M], [rates], [casadi.DM.zeros(7)]))


@pytest.mark.parametrize("length", [0.3, 1.0, 40.0])
def test_masses_and_energies_have_the_jacobians_of_plain_symbols(first: External, length: float) -> None:
    q, qd, _ = off_the_sphere(length)
    at, rates = symbols([q, qd])
    M = masses()(at)
    for name, expected, given in (
        ("mass_matrix", M, [q]),
        ("kinetic_energy", 0.5 * casadi.bilin(M, rates, rates), [q, qd]),
    ):
        by = [at, rates][: len(given)]
        found = first(name)(*by)
        for one in by:
            blocks = [
                np.array(casadi.DM(casadi.Function("J", by, [casadi.jacobian(value, one)])(*given)))
                for value in (found, expected)
            ]
            close(*blocks)


def hessian(function: casadi.Function, given: list[Array], weights: Array) -> Array:
    """Of the weighted sum of outputs, by all inputs and the weights."""
    flat = casadi.MX.sym("x", sum(x.size for x in given) + weights.size)
    ends = np.cumsum([0, *(x.size for x in given), weights.size]).tolist()
    *parts, last = casadi.vertsplit(flat, ends)
    shaped = [casadi.reshape(part, *casadi.DM(x).shape) for part, x in zip(parts, given, strict=True)]
    scalar = casadi.dot(casadi.vec(function(*shaped)), last)
    made = casadi.Function("H", [flat], [casadi.hessian(scalar, flat)[0]])
    return np.array(casadi.DM(made(np.concatenate([*(x.ravel(order="F") for x in given), weights]))))


@pytest.mark.parametrize("length", [0.3, 1.0, 40.0])
@pytest.mark.parametrize("name", TWICE)
def test_hessians_are_casadis_own_by_every_entry_of_q(floating: External, name: str, length: float) -> None:
    given = off_the_sphere(length)[: 1 if name == "gravity" else 3]
    weights = np.array([1.0, -2, 3, 0.5, 4, -1, 2])
    found = hessian(floating(name), given, weights)
    close(found, hessian(oracles()[name], given, weights), 1e-10)
    assert np.abs(found - found.T).max() < 1e-12 * np.abs(found).max()


def test_hessians_of_matrices_are_casadis_own(floating: External) -> None:
    q = off_the_sphere(1.5)[0]
    weights = np.cos(np.arange(49.0))
    found = hessian(floating("mass_matrix"), [q], weights)
    close(found, hessian(masses(), [q], weights))


def test_casadi_takes_them_from_the_library(floating: External) -> None:
    """And sees their zeros: nothing depends on where the base is."""
    second = floating("inverse_dynamics").reverse(1).jacobian()
    assert second.class_name() == "External"
    assert np.array(casadi.DM(second.sparsity_out(0), 1.0))[:3].max() == 0.0
    assert second.sparsity_out(2).nnz() < 8 * 7


def test_gradients_by_wrenches_are_pinocchios_jacobians(floating: External) -> None:
    """A matrix among the inputs: six numbers in a column for each frame. tau = ... - J^T wrench."""
    (q, qd, qdd), wrench = off_the_sphere(1.0), np.arange(6.0)[:, None]
    weights = np.array([1.0, -2, 3, 0.5, 4, -1, 2])
    model, tip = with_tip()
    J = pin.computeFrameJacobian(model, model.createData(), q, tip, pin.LOCAL)
    function = floating("inverse_dynamics_with_wrenches")
    gradient = function.reverse(1)(q, qd, qdd, wrench, 0, weights)[3]
    close(gradient, -J @ weights)
    close(function.jacobian()(q, qd, qdd, wrench, 0)[3], -J.T)
    at = [*off_the_sphere(1.0), wrench]
    close(hessian(function, at, weights)[-13:-7, -7:], -J)


def test_by_theta_energies_have_jacobians_too(tmp_path: Path) -> None:
    """Energies are linear in theta_b."""
    energy = external("floating", tmp_path / "e", ["kinetic_energy"], free_model(), adapter="casadi_theta")(
        "kinetic_energy_theta"
    )
    q, qd, _ = off_the_sphere(1.7)
    theta = np.asarray(free_model().theta_b)
    by_theta = np.array(casadi.DM(energy.jacobian()(q, qd, theta, 0)[2])).ravel()
    close(by_theta, np.array([float(energy(q, qd, unit)) for unit in np.eye(len(theta))]))


def test_ipopt_takes_fewer_iterations_with_exact_hessians(scara: External) -> None:
    """From rest to rest: the optimum of limited memory, and that of Newton-Euler on plain symbols in as many steps."""
    from shooting import point_to_point

    ours, oracle = scara("forward_dynamics"), acceleration(reference(bundled_robot("scara")).model)
    start, goal = np.zeros(4), 0.3 * (-1.0) ** np.arange(4)

    def solved(function: casadi.Function, way: str):
        return point_to_point(function, start, goal, steps=8, duration=0.4, hessian=way)

    exact, approximate, theirs = (
        solved(ours, "exact"),
        solved(ours, "limited-memory"),
        solved(oracle, "exact"),
    )
    assert exact.iterations < approximate.iterations
    assert exact.iterations == theirs.iterations
    assert exact.cost == pytest.approx(approximate.cost, rel=1e-6)
    assert exact.cost == pytest.approx(theirs.cost, rel=1e-9)


@pytest.mark.slow
def test_of_a_kr6_too(tmp_path: Path) -> None:
    from shooting import point_to_point

    kr6 = external("kr6", tmp_path / "kr6", ["forward_dynamics"], level="-O1", adapter="casadi_hessian")
    function, oracle = kr6("forward_dynamics"), acceleration(reference(bundled_robot("kr6")).model)
    given, weights = [np.cos(np.arange(6.0) + k) for k in range(3)], np.sin(np.arange(6.0))
    close(hessian(function, given, weights), hessian(oracle, given, weights), 1e-8)
    start, goal = np.zeros(6), 0.3 * (-1.0) ** np.arange(6)
    exact, approximate = (
        point_to_point(function, start, goal, steps=6, duration=0.4, hessian=way)
        for way in ("exact", "limited-memory")
    )
    assert exact.iterations < approximate.iterations
    assert exact.cost == pytest.approx(approximate.cost, rel=1e-6)


def test_large_jacobians_are_left_out_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(casadi_kernels, "MOST", 100)
    robot = free_model().mechanism
    asked = ["mass_matrix", "gravity", "kinetic_energy"]
    (said,) = remarks(robot, ["casadi"], asked)
    assert said.endswith("without derivatives: mass_matrix")
    made = external("floating", tmp_path / "small", ["mass_matrix", "kinetic_energy"], free_model())
    with pytest.raises(RuntimeError, match="Derivatives cannot be calculated"):
        made("mass_matrix").jacobian()
    assert made("kinetic_energy").jacobian().size_out(0) == (1, 8)


def test_the_command_writes_them(tmp_path: Path) -> None:
    bundled_model("two_link").save(tmp_path / "arm.npz")
    words = ("emit-c", "arm.npz", "--functions", "gravity", "--with", "casadi_hessian,casadi")
    assert typed(*words, cwd=tmp_path).returncode == 0
    written = {str(path.relative_to(tmp_path / "arm")) for path in (tmp_path / "arm").rglob("*.c")}
    robot = next(iter(tmp_path.glob("arm/include/*"))).name
    assert {
        f"casadi_hessian/{robot}_casadi_hessian.c",
        f"casadi/{robot}_casadi.c",
        "src/gravity_jac_adj1.c",
    } <= written
    assert "gravity_jac_adj1" not in (tmp_path / "arm" / "casadi" / f"{robot}_casadi.c").read_text()
    assert typed(*words, "--check", cwd=tmp_path).returncode == 0
