"""Functions are told of in one place each: every file of psdmc/functions is one, and nothing else lists them."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest

import psdmc.functions
from psdmc.frameworks.differentiation import rule_of
from psdmc.functions import DEFAULT, RECIPES, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.signature import WORDS
from psdmc.recipes.recipe import Needs
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.stubs import ANSWERS, STUB, answers_stub, own_methods, stub

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
import derivative_table
import function_table

PACKAGE = Path(psdmc.functions.__file__).parents[1]

NAMES_SEVERAL = {
    "backends/c/adapters/casadi_externals.py": "what derivatives by the entries of q and by theta_b are made of",
    "bench/rivals/casadi_c.py": "what this rival has, and under which names",
    "bench/rivals/cppadcg_c.py": "what this rival has, and under which names",
    "bench/rivals/mujoco_c.py": "what this rival has",
    "bench/rivals/pinocchio_cpp.py": "what this rival has, and under which names",
    "calibration/verdict/judge.py": "steps of a calibration, and what the verdict compares",
    "calibration/verdict/record.py": "steps of a calibration, and what the verdict compares",
    "model/dynamics_model.py": "methods with documentation of their own: what E and P are defined by",
    "model_functions.py": "what is computed from E and P where a model has them",
    "backends/c/adapters/ros2.py": "what the two controllers call",
    "backends/c/adapters/fmu.py": "what an FMU simulates, and its optional outputs",
    "frameworks/coordinates.py": "which functions JAX and PyTorch compute themselves",
    "frameworks/differentiation.py": "which function gives the derivatives of which",
    "bench/legged.py": "the rows of the table of legged robots, and what rivals compute in their place",
    "report/bench_markdown.py": "the columns of README's table",
}
"""Files that name more than one function, and why they must."""


def texts(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_every_file_of_the_folder_is_a_function_in_its_order() -> None:
    files = {path.stem for path in (PACKAGE / "functions").glob("*.py")} - {"__init__"}
    assert files == set(RECIPES) == set(SIGNATURES)
    orders = [recipe.signature.order for recipe in RECIPES.values()]
    assert orders == sorted(set(orders))


def test_nothing_else_lists_functions() -> None:
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = path.relative_to(PACKAGE).as_posix()
        named = set(texts(path)) & set(RECIPES)
        if len(named) > 1 and not inside.startswith("functions/"):
            found[inside] = sorted(named)
    assert set(found) == set(NAMES_SEVERAL), found


def test_functions_that_solve_the_mass_matrix_need_a_positive_one() -> None:
    for recipe in RECIPES.values():
        solved = any(matrix.name.startswith("the mass matri") for matrix in recipe.signature.factorises)
        assert (recipe.needs is Needs.POSITIVE_MASS) == solved, recipe.name


def test_recipes_only_lean_on_functions_that_there_are() -> None:
    for recipe in RECIPES.values():
        for other in (recipe.starts, recipe.shares):
            assert other is None or (other in RECIPES and RECIPES[other].starts is None), recipe.name
        assert not (recipe.starts and recipe.shares), recipe.name
        is_searched = recipe.signature.theta or recipe.regions
        assert is_searched or not (recipe.starts or recipe.shares), recipe.name
        if recipe.name in DEFAULT:
            assert "frames" not in {axis for q in recipe.signature.stored for axis in q.axes}


def test_every_function_is_a_method_with_its_arguments_and_summary() -> None:
    for name, signature in SIGNATURES.items():
        method = getattr(CompiledRobot, name)
        assert method.__name__ == name
        assert method.__doc__.startswith(signature.summary + "\n")
        expected = [
            "self",
            *(q.name for q in signature.inputs),
            *(["theta_b"] if signature.theta else []),
            *(["gravity"] if signature.depends_on_gravity else []),
            "out",
        ]
        assert list(method.__signature__.parameters) == expected


def test_the_stub_is_what_the_signatures_say() -> None:
    """After a change: python -m psdmc.toolchain.stubs"""
    assert STUB.read_text(encoding="utf-8") == stub(SIGNATURES.values())
    assert ANSWERS.read_text(encoding="utf-8") == answers_stub(SIGNATURES.values())
    assert own_methods() & set(SIGNATURES) == set(SIGNATURES) & set(vars(DynamicsModel))


def test_the_documents_table_is_of_the_declarations() -> None:
    text = function_table.PAGE.read_text(encoding="utf-8")

    assert function_table.with_table(text) == text, "run python docs/function_table.py"


@pytest.mark.parametrize("page", derivative_table.PAGES, ids=lambda page: page.stem)
def test_tables_of_derivatives_are_of_the_rules(page: Path) -> None:
    text = page.read_text(encoding="utf-8")

    assert derivative_table.with_table(text) == text, "run python docs/derivative_table.py"
    for name in SIGNATURES:
        if rule_of(name):
            assert f"`{name}`" in derivative_table.table()


def test_sizes_have_one_meaning_each_and_quantities_are_explained() -> None:
    for signature in SIGNATURES.values():
        assert re.fullmatch(r"(Compute|Return) .*\.", signature.summary)
        assert all(quantity.means for quantity in (*signature.inputs, *signature.outputs)), signature.name
        axes = [quantity.axes for quantity in (*signature.inputs, *signature.outputs)]
        for axis in chain(*axes, *(matrix.axes for matrix in signature.factorises)):
            assert axis in WORDS or axis.isdecimal()


@pytest.mark.parametrize("name", list(RECIPES))
def test_every_function_has_a_test_file_or_is_tested_with_all(name: str) -> None:
    assert name in DEFAULT or (Path(__file__).parent / f"test_{name}.py").is_file()
