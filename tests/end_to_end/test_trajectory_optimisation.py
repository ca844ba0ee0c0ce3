"""examples/trajectory_optimisation in a short form: what iLQR finds are motions, and another solver finds the same."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from bundled import ROBOTS, bundled_model, bundled_robot
from installed import in_wheel, need
from unoptimised import without_optimisation

from psdmc.compiler import emit_c
from psdmc.robot.reference import reference
from psdmc.toolchain.compiler_command import find_compiler

EXAMPLES = ROBOTS.parent / "trajectory_optimisation"
sys.path.insert(0, str(EXAMPLES))

import ilqr  # noqa: E402


@pytest.fixture(scope="module")
def kr6() -> ilqr.Problem:
    with without_optimisation():
        return ilqr.kr6(steps=12, duration=0.6)


@pytest.fixture(scope="module")
def acrobot() -> ilqr.Problem:
    with without_optimisation():
        return ilqr.acrobot()


def test_jacobians_of_the_step_are_its_difference_quotients(kr6: ilqr.Problem) -> None:
    rng = np.random.default_rng(1)
    x, u = rng.uniform(-1.0, 1.0, 12), kr6.held + rng.uniform(-5.0, 5.0, 6)
    A, B = kr6.jacobians(x, u)
    h = 1e-6
    by_x = [(kr6.step(x + h * e, u) - kr6.step(x - h * e, u)) / (2 * h) for e in np.eye(12)]
    by_u = [(kr6.step(x, u + h * e) - kr6.step(x, u - h * e)) / (2 * h) for e in np.eye(6)]
    assert np.abs(A - np.transpose(by_x)).max() < 1e-6 * np.abs(A).max()
    assert np.abs(B - np.transpose(by_u)).max() < 1e-6 * np.abs(B).max()


def test_the_kr6_arrives(kr6: ilqr.Problem) -> None:
    found = ilqr.solve(kr6)
    assert all(after < before for before, after in zip(found.costs, found.costs[1:], strict=False))
    assert np.abs(found.x[-1] - kr6.goal)[:6].max() < 0.02
    pinocchio = reference(bundled_robot("kr6"))
    rates = (found.x[1:, 6:] - found.x[:-1, 6:]) / kr6.dt
    torques = pinocchio.inverse_dynamics(found.x[:-1, :6], found.x[:-1, 6:], rates)
    assert np.abs(torques - found.u).max() < 1e-8 * np.abs(found.u).max()


def test_the_acrobot_is_swung_up(acrobot: ilqr.Problem) -> None:
    """By a motor in the elbow, which cannot hold the first link: it is swung back and forth."""
    found = ilqr.solve(acrobot)
    assert np.abs(found.x[-1] - acrobot.goal).max() < 0.02
    assert found.u.shape == (acrobot.steps, 1)


def test_crocoddyl_finds_the_same_motion(kr6: ilqr.Problem) -> None:
    pytest.importorskip("crocoddyl")
    import in_crocoddyl

    own = ilqr.solve(kr6).costs[-1]
    cost, *_ = in_crocoddyl.solved(in_crocoddyl.with_psdmc(kr6), kr6)
    theirs, *_ = in_crocoddyl.solved(in_crocoddyl.with_pinocchio(kr6, in_crocoddyl.kr6_of_pinocchio()), kr6)
    assert cost == pytest.approx(own, rel=1e-7)
    assert theirs == pytest.approx(own, rel=1e-7)


@pytest.mark.slow
def test_the_step_of_a_1_khz_controller_compiles_and_arrives(tmp_path: Path) -> None:
    need("g++", "make")
    functions = ["gravity", "forward_dynamics", "forward_dynamics_derivatives"]
    emit_c(bundled_model("kr6"), tmp_path / "package", functions=functions, name="robot")
    flags = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"]
    source, library = str(EXAMPLES / "mpc_step.cpp"), "package/build/librobot.a"
    for words in (
        ["make", "-s", "-C", "package", "CFLAGS=-O0", "build/librobot.a"],
        ["g++", "-std=c++17", "-O1", *flags, "-Ipackage/include", source, library, "-lm", "-o", "mpc"],
    ):
        subprocess.run(words, cwd=tmp_path, check=True)
    done = subprocess.run([str(tmp_path / "mpc")], capture_output=True, text=True, check=True)
    assert "largest error after 1.5 s" in done.stdout


@pytest.fixture(scope="module")
def jumped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any, Any]:
    """The example's module, its robot, and a jump in 13 nodes with the package's functions, which are not optimised."""
    casadi = pytest.importorskip("casadi")
    import jump

    model, folder = jump.solo12(), tmp_path_factory.mktemp("jump") / "solo"
    names = ["inverse_dynamics_with_wrenches", "forward_kinematics"]
    emit_c(model, folder, functions=names, name="solo", adapters=["casadi_hessian"])
    words = [*find_compiler().command, "-std=c99", "-O0", "-shared", "-fPIC", "-Iinclude"]
    source = "casadi_hessian/solo_casadi_hessian.c"
    subprocess.run([*words, source, "-lm", "-o", "solo.so"], cwd=folder, check=True)
    dynamics = jump.Dynamics(*(casadi.external(f"solo_{name}", str(folder / "solo.so")) for name in names))
    return jump, model, jump.jump(dynamics, 24.0, PHASES, 0.4, 0.1)


PHASES = (5, 4, 4)


@pytest.mark.slow
def test_solo12_jumps(jumped: tuple[Any, Any, Any]) -> None:
    """Pinocchio's torques and feet for the motion that was found: motors, floor and friction are respected."""
    jump, _, found = jumped
    robot = pin.buildModelFromUrdf(str(in_wheel("solo12.urdf")), pin.JointModelFreeFlyer())
    data = robot.createData()
    feet = [robot.getFrameId(name) for name in jump.FEET]
    dt = 0.4 / sum(PHASES)
    for k in range(sum(PHASES)):
        q, qd = found.q[:, k].copy(), found.qd[:, k]
        q[3:7] /= np.linalg.norm(q[3:7])
        pin.framesForwardKinematics(robot, data, q)
        heights = np.array([data.oMf[foot].translation[2] for foot in feet])
        loads = [pin.Force.Zero() for _ in range(robot.njoints)]
        for foot, force in zip(feet, found.force[:, k].reshape(4, 3), strict=True):
            frame = robot.frames[foot]
            along = data.oMf[foot].rotation.T @ force
            loads[frame.parentJoint] += frame.placement.act(pin.Force(along, np.zeros(3)))
            assert np.hypot(*force[:2]) <= jump.FRICTION * force[2] + 1e-6
        tau = pin.rnea(robot, data, q, qd, (found.qd[:, k + 1] - qd) / dt, loads)
        np.testing.assert_allclose(tau, np.r_[np.zeros(6), found.tau[:, k]], atol=1e-6)
        if PHASES[0] <= k < PHASES[0] + PHASES[1]:
            assert np.abs(found.force[:, k]).max() < 1e-6
            assert heights.min() > -1e-6
        else:
            assert np.abs(heights).max() < 1e-6
        if k == PHASES[0] + PHASES[1] // 2:
            assert heights.min() > 1e-3
    assert np.abs(found.tau).max() <= jump.TORQUE + 1e-6
    assert found.q[0, -1] == pytest.approx(0.1, abs=1e-6)


@pytest.mark.slow
def test_the_jump_is_that_of_pinocchio_on_symbols(jumped: tuple[Any, Any, Any]) -> None:
    jump, model, found = jumped
    need("g++")
    theirs = jump.jump(jump.with_pinocchio(model), 24.0, PHASES, 0.4, 0.1)
    assert theirs.cost == pytest.approx(found.cost, rel=1e-8)
    assert np.abs(theirs.q - found.q).max() < 1e-5
    assert abs(theirs.iterations - found.iterations) <= 2, "rounding may add a step"


@pytest.mark.slow
def test_the_jump_is_drawn(jumped: tuple[Any, Any, Any], tmp_path: Path) -> None:
    from jump_plots import animate, plot

    plot(jumped[2], tmp_path / "jump.png")
    animate(jumped[2], tmp_path / "jump.gif")
    assert (tmp_path / "jump.png").stat().st_size > 20_000
    assert (tmp_path / "jump.gif").read_bytes().startswith(b"GIF89a")
