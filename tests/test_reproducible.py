"""psdmc.reproducible: its results against NumPy's and mpmath's, and that what is written comes from nowhere else."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import mpmath
import numpy as np
import pytest

import psdmc
from psdmc.reproducible import (
    arcsine,
    combined,
    cosine,
    in_any_order,
    inverse,
    lengths,
    sine,
    solved,
    times,
    triangle_solved,
)

PACKAGE = Path(psdmc.__file__).parent
WRITTEN = ("robot", "dynamics", "derivation", "model", "program", "recipes", "functions", "lower", "backends")
"""Folders whose numbers reach model files, C or reference states."""

STRANGE = {"linalg", "einsum", "dot", "matmul", "inner", "tensordot", "vdot"}
STRANGE |= {"sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "asin", "acos", "atan2", "exp"}
"""What NumPy, SciPy and the C library compute by the processor's own kernels."""

DECISIONS = {
    "recipes/load_momentum.py": "Pinocchio's side of a comparison",
    "robot/reference.py": "Pinocchio's side of a comparison",
    "robot/mujoco_reading.py": "MuJoCo's side of a comparison",
    "robot/coordinates.py:refuse_other_lengths": "a refusal",
    "robot/joints/joint_type.py": "a rank",
    "robot/reference_model.py": "a rank, and the textbook's side of a comparison",
    "robot/inertia.py:physical_fault": "a refusal, whose rounding is not printed",
    "derivation/from_callable.py": "an independent derivation that only tests run",
    "model/parameter_checks.py": "signs of eigenvalues, printed on the console",
    "model/loop_base_parameters.py": "singular values, printed on the console",
    "derivation/closed_loops.py": "a refusal, and a choice after rounding",
    "recipes/contacts.py": "Pinocchio's side of a comparison",
    "functions/passive_motion.py": "Pinocchio's side of a comparison",
    "functions/loop_inverse_dynamics.py": "Pinocchio's side of a comparison",
    "functions/constrained_forward_dynamics_derivatives.py": "Pinocchio's side of a comparison",
    "functions/delassus.py": "Pinocchio's side of a comparison",
    "functions/contact_inverse_dynamics.py": "Pinocchio's side of a comparison",
    "functions/contact_space_inertia.py": "Pinocchio's side of a comparison",
    "functions/operational_space_inertia.py": "Pinocchio's side of a comparison",
    "functions/tangent_map.py": "Pinocchio's side of a comparison",
    "functions/regressor_slotine_li.py": "Pinocchio's side of a comparison",
    "functions/frame_acceleration_derivatives.py": "Pinocchio's side of a comparison",
    "functions/frame_velocity_derivatives.py": "Pinocchio's side of a comparison",
    "lower/carriers.py": "thresholds with margins of decades",
    "lower/link_parameters.py": "scales with margins of decades, and an inverse of zeros and ones",
    "lower/reframe.py": "thresholds with margins of decades",
    "lower/accuracy.py": "errors that are compared with limits",
    "backends/reference_states.py": "condition numbers, which order states after rounding",
}
"""Files, or single functions of files, that use such functions for decisions with slack, or for another program's side of
a comparison."""


def strange_calls() -> Iterator[str]:
    for folder in WRITTEN:
        for path in sorted((PACKAGE / folder).rglob("*.py")):
            file = path.relative_to(PACKAGE).as_posix()
            for part in ast.parse(path.read_text(encoding="utf-8")).body:
                for node in ast.walk(part):
                    is_call = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
                    if is_call and node.value.id in ("np", "math") and node.attr in STRANGE:
                        yield file if file in DECISIONS else f"{file}:{getattr(part, 'name', '')}"


def test_no_written_number_comes_from_a_kernel_that_the_processor_chooses() -> None:
    assert sorted(set(strange_calls())) == sorted(DECISIONS)


def random(*shape: int) -> np.ndarray:
    return np.random.default_rng(7).normal(size=shape)


@pytest.mark.parametrize(
    ("a", "b"), [((3, 4), (4, 5)), ((6, 3, 4), (4, 5)), ((6, 3, 4), (6, 4, 5)), ((6, 4), (4,))]
)
def test_products(a: tuple[int, ...], b: tuple[int, ...]) -> None:
    left, right = random(*a), random(*b)

    np.testing.assert_allclose(times(left, right), left @ right, rtol=0.0, atol=1e-14)


def test_sums_and_lengths_of_columns() -> None:
    rows, weights = random(50, 4), random(50)

    np.testing.assert_allclose(combined(weights, rows), weights @ rows, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(lengths(rows), np.sqrt((rows**2).sum(axis=0)), rtol=1e-14)


def test_solutions_of_systems_that_need_pivots() -> None:
    """Elimination with pivots leaves a residual of n ulp times the sizes of matrix and solution."""
    matrices, right = random(5, 6, 6), random(5, 6, 2)
    matrices[:, 0, 0] = 0.0

    found = solved(matrices, right)

    bound = 6 * np.finfo(float).eps * np.abs(matrices).sum(axis=(1, 2)) * np.abs(found).max(axis=(1, 2))
    assert np.all(np.abs(matrices @ found - right).max(axis=(1, 2)) <= bound)
    np.testing.assert_allclose(times(matrices, inverse(matrices)), np.tile(np.eye(6), (5, 1, 1)), atol=1e-12)
    assert not np.isfinite(inverse(np.zeros((1, 2, 2)))).any()


def test_what_is_below_the_diagonal_of_a_triangle_is_not_read() -> None:
    triangle, right = np.triu(random(4, 4)) + 4.0 * np.eye(4), random(4, 3)

    np.testing.assert_allclose(
        triangle @ triangle_solved(triangle + np.tril(random(4, 4), -1), right), right, atol=1e-14
    )


@pytest.mark.parametrize(
    ("ours", "theirs"), [(sine, mpmath.sin), (cosine, mpmath.cos), (arcsine, mpmath.asin)]
)
def test_elementary_functions_are_correctly_rounded(ours: object, theirs: object) -> None:
    """All but one in a thousand, as a long double has 11 bits more than a double; skipped where it has none."""
    if np.finfo(np.longdouble).eps >= np.finfo(float).eps:
        pytest.skip("long doubles are doubles here")
    values = np.random.default_rng(3).uniform(-1.0, 1.0, 400)
    with mpmath.workdps(40):
        expected = [float(theirs(mpmath.mpf(value))) for value in values.tolist()]

    assert np.array_equal(ours(values), expected)
    assert isinstance(ours(0.5), float)
    assert ours(np.longdouble(0.5)).dtype == np.longdouble


def test_any_order_ends_with_its_block():
    a, b = np.random.default_rng(3).standard_normal((2, 40, 40))
    fixed = times(a, b)

    with in_any_order():
        assert np.array_equal(times(a, b), a @ b)

    assert np.array_equal(times(a, b), fixed)


def test_what_is_written_is_never_in_any_order():
    users = [path for folder in WRITTEN for path in (PACKAGE / folder).rglob("*.py")]

    assert [path.name for path in users if "in_any_order" in path.read_text(encoding="utf-8")] == []
