"""Patterns of trees' matrices: every other entry is exactly zero at every state, and every entry of it is not at some."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from random_trees import RandomTree
from unoptimised import without_optimisation

import psdmc
from psdmc import compiler
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.toolchain.call import CompiledRobot

FUNCTIONS = ["mass_matrix", "regressor", "jacobian", "gravity"]
PARENTS = (-1, 0, 1, 0)
"""A floating base with two branches, of two joints and one."""


@pytest.fixture(scope="module")
def model() -> DynamicsModel:
    return derive_model(RandomTree(3, PARENTS, "FRPR").mechanism())


@pytest.fixture(scope="module")
def robot(model: DynamicsModel) -> CompiledRobot:
    with without_optimisation():
        return psdmc.compile(model, functions=FUNCTIONS)


def dense(shape: tuple[int, int], places: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    found = np.zeros(shape, dtype=bool)
    found[places] = True
    return found


def related(model: DynamicsModel) -> np.ndarray:
    """(nv, nv) whether a mass matrix has an entry: where one joint carries the other. The floating base's own block is m 1
    and m [c]x, with zeros of its own."""
    robot = model.mechanism
    paths = [set(robot.path_to(joint)) for joint in robot.rate_joints]
    found = np.array([[own <= other or other <= own for other in paths] for own in paths])
    found[:3, :3] = np.eye(3, dtype=bool)
    found[:3, 3:6] = found[3:6, :3] = ~np.eye(3, dtype=bool)
    return found


def test_a_mass_matrix_has_its_branches_pattern(robot: CompiledRobot, model: DynamicsModel) -> None:
    rows, columns = robot.pattern("mass_matrix")
    n = model.nv

    assert np.array_equal(dense((n, n), (rows, columns)), related(model))
    assert np.array_equal(np.lexsort((columns, rows)), np.arange(len(rows)))


@pytest.mark.parametrize("name", ["mass_matrix", "regressor"])
def test_values_outside_are_zero_and_inside_are_not(
    name: str, robot: CompiledRobot, model: DynamicsModel
) -> None:
    states = states_of(model.mechanism, np.random.default_rng(0), 200)
    values = getattr(robot, name)(*states[: 1 if name == "mass_matrix" else 3])
    places = robot.pattern(name)
    inside = dense(values.shape[1:], places)

    assert not inside.all()
    assert not np.any(values[:, ~inside])
    assert np.all(np.any(values[:, inside] != 0.0, axis=0))
    packed = values[:, *places]
    again = np.zeros_like(values)
    again[:, *places] = packed
    assert np.array_equal(again, values)


def test_a_regressor_has_columns_only_for_what_a_joint_carries(
    robot: CompiledRobot, model: DynamicsModel
) -> None:
    """Against the model's own regressor on arrays, which knows no PROGRAM."""
    states = states_of(model.mechanism, np.random.default_rng(1), 50)
    Y = model.regressor(*states)
    nonzero = np.any(np.abs(Y) > 1e-9 * np.abs(Y).max(), axis=0)

    assert not np.any(nonzero & ~dense(Y.shape[1:], robot.pattern("regressor")))


def test_functions_of_no_matrix_are_refused_by_name(robot: CompiledRobot) -> None:
    with pytest.raises(InputError, match="gravity is no function of one matrix"):
        robot.pattern("gravity")
    with pytest.raises(InputError, match="coriolis_matrix was not compiled"):
        robot.pattern("coriolis_matrix")


@pytest.mark.needs("g++")
def test_the_c_and_cpp_tables_are_pythons(robot: CompiledRobot, model: DynamicsModel, tmp_path: Path) -> None:
    """Read by a C and a C++ program, from what was written."""
    folder = tmp_path / "tree"
    compiler.emit_c(model, folder, functions=FUNCTIONS)
    text = next(folder.glob("include/*/*.h")).read_text(encoding="ascii")
    sizes = dict(re.findall(r"#define tree_(\w+)_NONZEROS (\d+)", text))
    assert sizes == {
        n.upper(): str(len(robot.pattern(n)[0])) for n in ("mass_matrix", "regressor", "jacobian")
    }
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "tree/tree.h"\nint main(void) { for (int k = 0; k < tree_MASS_MATRIX_NONZEROS; ++k)'
        ' printf("%d %d\\n", tree_mass_matrix_pattern[k][0], tree_mass_matrix_pattern[k][1]); return 0; }\n'
    )
    (tmp_path / "main.cpp").write_text(
        '#include <cstdio>\n#include "tree/tree.hpp"\nint main() { using T = tree::Description; (void)sizeof(T);'
        ' for (const auto &at : T::regressor_pattern) std::printf("%d %d\\n", at[0], at[1]); }\n'
    )
    include = f"-I{folder / 'include'}"
    for command, name in (
        (["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", include, "main.c", str(folder / "src/tables.c")], "mass_matrix"),
        (["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", include, "main.cpp"], "regressor"),
    ):  # fmt: skip
        subprocess.run([*command, "-o", "main"], cwd=tmp_path, check=True, capture_output=True)
        said = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
        found = np.array([line.split() for line in said.splitlines()], dtype=int).T
        assert np.array_equal(found, robot.pattern(name))


def test_a_chains_package_has_no_such_tables(tmp_path: Path) -> None:
    compiler.emit_c(bundled_model("scara"), tmp_path / "chain", functions=["mass_matrix", "regressor"])
    text = next((tmp_path / "chain").glob("include/*/*.h")).read_text(encoding="ascii")
    assert "pattern" not in text
    assert "NONZEROS" not in text
