"""Robots whose joints have several coordinates in C, C++ and Python: lengths of q and of rates differ."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model
from command_line import status
from numpy.testing import assert_allclose
from random_trees import RandomTree
from unoptimised import without_optimisation, wrapper

import psdmc
from psdmc import compiler
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import OF_TREES
from psdmc.lower import kernels, search
from psdmc.lower.admitted import require
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load
from psdmc.toolchain.build_package import build_package

FUNCTIONS = ["inverse_dynamics", "forward_dynamics", "mass_matrix", "jacobian", "regressor"]
BETWEEN = ["neutral", "integrate", "difference", "semi_implicit_euler", "forward_dynamics_derivatives"]
"""What moves q, and what is along its tangent; the last takes many states one after the other."""

BUDGET = 12
"""Programs that the search may trace: what it takes must be right, not cheap."""

COUNT = 21
"""States: whole blocks of lanes and some more."""


@pytest.fixture(scope="module", autouse=True)
def short_search() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "Search", partial(search.Search, budget=BUDGET))
        yield


@pytest.fixture(scope="module")
def tree() -> RandomTree:
    """A floating base with a planar joint, a spherical one behind a revolute one, and a translating one."""
    return RandomTree(51, (-1, 0, 1, 0, 3), "FRSLT")


@pytest.fixture(scope="module")
def model(tree: RandomTree) -> DynamicsModel:
    return derive_model(tree.mechanism(), expand=False)


@pytest.fixture(scope="module")
def package(model: DynamicsModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wide") / "tree"
    compiler.emit_c(model, folder, functions=[*FUNCTIONS, *BETWEEN])
    return folder


def header(folder: Path) -> str:
    return next(folder.glob("include/*/*.h")).read_text(encoding="ascii")


def test_the_header_says_how_long_vectors_are(package: Path) -> None:
    macros = dict(re.findall(r"#define tree_(\w+) (\d+)", header(package)))
    sizes = {name: int(macros[name]) for name in ("DOF", "JOINTS", "NQ", "NV", "BASE_PARAMETERS")}
    l = (
        5 * 10 - (0 + 3 + 1 + 1 + 6) + 1
    )  # a body's ten, less what each joint hides, and the hinge's drive inertia
    assert sizes == {"DOF": 16, "JOINTS": 5, "NQ": 19, "NV": 16, "BASE_PARAMETERS": l}
    text = header(package)
    assert "joint_names[tree_JOINTS]" in text
    assert "unit quaternion x y z w" in text


def test_a_chains_header_has_no_further_sizes(tmp_path: Path) -> None:
    compiler.emit_c(bundled_model("scara"), tmp_path / "chain", functions=["gravity"])
    assert not re.search(r"#define \w+_(JOINTS|NQ|NV) ", header(tmp_path / "chain"))


def test_the_package_passes_its_own_test_in_every_layout(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", str(wrapper(tmp_path)))
    build_package(package)


@pytest.mark.needs("g++")
def test_the_class_has_the_lengths_too(package: Path, tmp_path: Path) -> None:
    source = tmp_path / "lengths.cpp"
    source.write_text(
        '#include "tree/tree.hpp"\n'
        "using Robot = tree::Robot;\n"
        "static_assert(Robot::dof == 16 && Robot::nq == 19 && Robot::nv == 16 && Robot::joints == 5);\n"
        "static_assert(Robot::joint_names.size() == 5);\n"
        "std::array<double, 16> f(const std::array<double, 19> &q, const Robot::Vector &v)\n"
        "{ return Robot::inverse_dynamics(q, v, v); }\n"
    )
    done = subprocess.run(
        ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{package / 'include'}", str(source)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_python_takes_and_gives_arrays_of_these_shapes(tree: RandomTree, model: DynamicsModel) -> None:
    with without_optimisation():
        robot = psdmc.compile(model, functions=FUNCTIONS)
        q, qd, qdd = tree.motion(COUNT)
        expected = tree.each(pin.rnea, q, qd, qdd)
        tau = robot.inverse_dynamics(q, qd, qdd)
        assert tau.shape == (COUNT, 16)
        assert_allclose(tau, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        assert_allclose(robot.inverse_dynamics(q, qd, qdd, model.theta_b), tau, rtol=0, atol=1e-10)
        assert_allclose(robot.forward_dynamics(q, qd, tau), qdd, rtol=0, atol=1e-8)
        assert robot.mass_matrix(q[0]).shape == (16, 16)
        assert robot.regressor(q, qd, qdd).shape == (COUNT, 16, model.l)
        assert robot.jacobian(q).shape == (COUNT, 6, 16)
        with pytest.raises(InputError, match=r"q has shape \(16,\), expected \(..., 19\)"):
            robot.inverse_dynamics(qd[0], qd[0], qd[0])
    assert_allclose(model.inverse_dynamics(q, qd, qdd), expected, rtol=0, atol=1e-11)
    with pytest.raises(InputError, match=r"q has shape \(16,\), expected \(..., 19\)"):
        model.inverse_dynamics(qd[0], qd[0], qd[0])


def test_no_function_is_refused_to_joints_of_several_rates(model: DynamicsModel) -> None:
    require(model, OF_TREES)


@pytest.mark.slow
def test_a_steps_jacobians_have_the_rates_lengths(model: DynamicsModel) -> None:
    rates = model.nv
    with without_optimisation():
        robot = psdmc.compile(model, functions=["rk4_step_derivatives"])
    q, qd, tau = model.neutral(), np.zeros(rates), np.zeros(rates)
    found = robot.rk4_step_derivatives(q, qd, tau, 1e-3)
    assert found.A.shape == (2 * rates, 2 * rates)
    assert found.B.shape == (2 * rates, rates)
    assert_allclose(found.A, model.rk4_step_derivatives(q, qd, tau, 1e-3).A, rtol=0, atol=1e-9)


def test_a_model_file_keeps_the_joints(model: DynamicsModel, tmp_path: Path) -> None:
    model.save(tmp_path / "tree.npz")
    again = load(tmp_path / "tree.npz")
    assert again.content_hash == model.content_hash
    assert again.mechanism.types == model.mechanism.types
    assert (again.nq, again.nv) == (19, 16)


def test_the_command_shows_such_a_model(
    model: DynamicsModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model.save(tmp_path / "tree.npz")
    assert status("show", tmp_path / "tree.npz") == 0
    shown = capsys.readouterr().out
    for word in ("free", "spherical", "planar", "translation"):
        assert re.search(rf"^joint\d  link\d .* {word} ", shown, re.MULTILINE), word
    assert len(re.findall(r"^joint\d .*\d\.\de[-+]\d\d$", shown, re.MULTILINE)) == len(model.joint_names)
