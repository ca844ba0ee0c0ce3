"""A quadruped on a floating base, from its URDF to a tested library, as a user types it; and from Python."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from command_line import status, typed
from pinocchio_robots import path_of
from unoptimised import without_optimisation, wrapper

import psdmc
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.toolchain.compiler_command import find_compiler

FUNCTIONS = ["inverse_dynamics", "mass_matrix", "forward_dynamics"]
COUNT = 20
BODIES, REVOLUTE = 13, 12


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("floating")
    shutil.copy(path_of("solo12"), folder / "solo12.urdf")
    done = typed("derive", "solo12.urdf", "--floating", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert f"solo12.npz: {BODIES} joints, l = {10 * BODIES - 3 * REVOLUTE}" in done.stdout
    assert "link 'base_link' moves freely by joint 'root_joint'" in done.stdout
    assert "--tip" not in done.stdout
    return folder


@pytest.fixture(scope="module")
def model(work: Path) -> DynamicsModel:
    return psdmc.load(work / "solo12.npz")


@pytest.fixture(scope="module")
def oracle(work: Path) -> pin.Model:
    return pin.buildModelFromUrdf(str(work / "solo12.urdf"), pin.JointModelFreeFlyer())


def of_pinocchio(oracle: pin.Model, function, *states: np.ndarray) -> np.ndarray:
    data = oracle.createData()
    return np.array([np.array(function(oracle, data, *state)) for state in zip(*states, strict=True)])


def test_show_tells_of_the_root_joint(work: Path) -> None:
    shown = typed("show", "solo12.npz", cwd=work).stdout
    row = next(line for line in shown.splitlines() if line.startswith("root_joint"))
    assert re.split(" {2,}", row)[:5] == ["root_joint", "base_link", "universe", "free", "none"]
    assert "universe to 4 ends" in shown
    assert "monomials not expanded (they are of joints of one coordinate)" in shown


def test_check_passes_pinocchios_free_flyer(work: Path) -> None:
    done = typed("check", "solo12.npz", cwd=work)
    assert done.returncode == 0, done.stdout
    assert "FAIL" not in done.stdout
    assert "the mass matrix is positive definite" in done.stdout


@pytest.fixture(scope="module")
def package(work: Path) -> Path:
    functions = "inverse_dynamics,neutral,integrate,difference"
    done = typed("emit-c", "solo12.npz", "-o", "solo", "--functions", functions, cwd=work)
    assert done.returncode == 0, done.stderr
    return work / "solo"


def test_its_package_is_built_and_passes_its_own_test(work: Path, package: Path) -> None:
    header = (package / "include/solo/solo.h").read_text(encoding="utf-8")
    assert "solo_NQ 19" in header
    assert "solo_NV 18" in header
    assert "Robot: solo, a floating base in the world (universe)" in header
    assert "m/s^2 in the world frame" in header
    assert "base frame" not in header
    assert "from base to tip" not in header
    assert "FL_HFE (revolute)" in header
    assert "on link FL_SHOULDER" in header
    assert "on link universe; q[0..6], rates[0..5]" in header
    assert "on link FL_SHOULDER; q[8], rates[7]" in header
    readme = (package / "README.md").read_text(encoding="utf-8")
    assert "q[solo_NQ], ...;" in readme
    assert "`solo_integrate(q, v, q)` moves q by v, rates times seconds" in readme
    root, hip = json.loads((package / "manifest.json").read_text(encoding="utf-8"))["joints"][:2]
    assert (root["nq"], root["nv"], root["parent"]) == (7, 6, "universe")
    assert (hip["parent"], "nq" in hip) == ("base_link", False)
    built = typed("build", "solo", cwd=work, CC=str(wrapper(work)))
    assert built.returncode == 0, built.stderr
    assert "self-test passed" in built.stdout


PROGRAM = """
#include <solo/solo.h>
#include <stdio.h>

int main(void)
{
    double q[solo_NQ], start[solo_NQ], v[solo_NV], way[solo_NV], rest[solo_NV] = {0}, tau[solo_NV];
    solo_neutral(q);
    solo_neutral(start);
    for (int k = 0; k < solo_NV; k++) {
        v[k] = 0.1 * (k + 1);
    }
    solo_integrate(q, v, q);
    solo_difference(start, q, way);
    solo_inverse_dynamics(q, rest, rest, tau);
    for (int k = 0; k < solo_NQ; k++) {
        printf("%.17g ", q[k]);
    }
    for (int k = 0; k < solo_NV; k++) {
        printf("%.17g ", way[k]);
    }
    for (int k = 0; k < solo_NV; k++) {
        printf("%.17g ", tau[k]);
    }
    return 0;
}
"""
"""What README tells: begin at the neutral position, move, and ask for torques there."""


def test_a_c_program_moves_it_as_readme_says(work: Path, package: Path, oracle: pin.Model) -> None:
    (work / "main.c").write_text(PROGRAM, encoding="utf-8")
    sources = [str(path) for path in sorted((package / "src").glob("*.c"))]
    command = [*find_compiler().command, "-std=c99", f"-I{package}/include", str(work / "main.c"), *sources]
    subprocess.run([*command, "-lm", "-o", str(work / "main")], check=True)
    printed = subprocess.run([str(work / "main")], check=True, capture_output=True, text=True).stdout.split()
    q, way, tau = np.split(np.array(printed, dtype=float), [oracle.nq, oracle.nq + oracle.nv])
    v = 0.1 * np.arange(1, oracle.nv + 1)
    np.testing.assert_allclose(q, pin.integrate(oracle, pin.neutral(oracle), v), atol=1e-14)
    np.testing.assert_allclose(way, v, atol=1e-14)
    rest = np.zeros(oracle.nv)
    np.testing.assert_allclose(tau, pin.rnea(oracle, oracle.createData(), q, rest, rest), atol=1e-13)


@pytest.mark.slow
def test_compiled_functions_are_pinocchios(model: DynamicsModel, oracle: pin.Model) -> None:
    assert list(oracle.names)[1:] == list(model.joint_names)
    with without_optimisation():
        robot = psdmc.compile(model, functions=FUNCTIONS)
    q, qd, qdd = states_of(model.mechanism, np.random.default_rng(1), COUNT)
    tau = of_pinocchio(oracle, pin.rnea, q, qd, qdd)
    found = robot.inverse_dynamics(q, qd, qdd)
    assert np.all(np.abs(found - tau).max(axis=0) <= 1e-12 * np.abs(tau).max(axis=0))
    upper = np.triu(of_pinocchio(oracle, pin.crba, q))
    mass = upper + np.triu(upper, 1).transpose(0, 2, 1)
    np.testing.assert_allclose(robot.mass_matrix(q), mass, rtol=0, atol=1e-12 * np.abs(mass).max())
    expected = of_pinocchio(oracle, pin.aba, q, qd, tau)
    np.testing.assert_allclose(
        robot.forward_dynamics(q, qd, tau), expected, rtol=0, atol=1e-10 * np.abs(expected).max()
    )


def test_python_derives_what_the_command_does(work: Path, model: DynamicsModel) -> None:
    again = psdmc.derive(work / "solo12.urdf", floating=True)
    np.testing.assert_array_equal(again.B, model.B)
    assert again.joint_names == model.joint_names


REFUSED = [
    (("derive", "solo12.urdf", "--floating", "--tip", "FL_FOOT"), 2, "--floating puts the whole robot"),
    (("derive", "solo12.urdf", "--floating", "--expand"), 3, "E and P are of joints of one coordinate"),
    (("derive", "row.toml", "--floating"), 2, "--floating frees the root link of a URDF"),
    (("excite", "solo12.npz", "-o", "campaign"), 2, "a campaign is of joints of one coordinate each"),
    (("calibrate", "solo12.npz", "log.csv", "-o", "x.npz"), 2, "calibration is of joints of one coordinate"),
]


@pytest.mark.parametrize(("words", "expected", "said"), REFUSED, ids=lambda value: str(value)[:40])
def test_what_is_not_of_floating_bases_is_refused_in_a_line(
    work: Path,
    words: tuple[str, ...],
    expected: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(work)
    (work / "row.toml").write_text('name = "row"\nconvention = "standard"\n[[joint]]\na = 1.0\n', "utf-8")
    (work / "log.csv").write_text("t\n", "utf-8")
    assert status(*words) == expected
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(":")[0] for line in lines] == ["error", "hint"], lines
    assert said in lines[0]
