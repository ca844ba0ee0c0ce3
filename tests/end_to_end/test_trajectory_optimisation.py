"""examples/trajectory_optimisation in a short form: what iLQR finds are motions, and another solver finds the same."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bundled import ROBOTS, bundled_model, bundled_robot
from unoptimised import without_optimisation

from psdmc.compiler import emit_c
from psdmc.robot.reference import reference

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
    if shutil.which("g++") is None or shutil.which("make") is None:
        pytest.skip("g++ or make is not installed")
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
