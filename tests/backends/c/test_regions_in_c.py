"""The C of loops and calls against `run`: one state, rows and lanes, and a call that fails."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from direct import Direct, shared_library
from region_functions import MATRICES, multiplied
from small import kernel, pendulum_info

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions
from psdmc.program.kernel import Kernel
from psdmc.program.program import Program
from psdmc.program.regions import Call, Column, For, Region, Regions, Slice, run, straight
from psdmc.program.signature import Quantity, Signature, Structure, SymmetricMatrix

WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-pedantic", "-Werror"]
NOTHING = Program((), ())


def package(
    inputs: dict[str, int], outputs: dict[str, int], body: Regions, pivots: int = 0, real: str = "float64"
) -> PackageView:
    quantities = [
        tuple(Quantity(name, (str(size),)) for name, size in each.items()) for each in (inputs, outputs)
    ]
    matrix = SymmetricMatrix("any", Structure.DENSE, (str(pivots),), "which", "it fails")
    function = Signature(
        "trial", 1000, "regions", *quantities, theta=False, factorises=(matrix,) if pivots else ()
    )
    kernels = {
        "forward_dynamics": kernel("forward_dynamics", CALLED),
        "trial": Kernel(function, False, NOTHING, NOTHING, "factored", regions=body),
    }
    return package_view(pendulum_info(), kernels, EmitOptions(real=real))  # type: ignore[arg-type]


CALLED = """
    q = load q[0]
    t = load tau[0]
    w = load qd[0]
    a = div t q
    b = add a w
    out pivot[0] = q
    out qdd[0] = b
"""


@pytest.mark.parametrize(("rows", "columns"), MATRICES)
@pytest.mark.parametrize("real", ["float64", "float32"])
def test_matrices_are_multiplied_in_all_forms(rows: int, columns: int, real: str, tmp_path: Path) -> None:
    size, out = rows * columns, rows * rows
    made = package({"a": size, "b": size}, {"c": out}, multiplied(rows, columns), real=real)
    call = Direct(made, shared_library(made, tmp_path, ["-O1", *WARNINGS]))
    count, lanes, rng = 11, made.lanes, np.random.default_rng(4)
    a, b = rng.normal(size=(2, count, size)).astype(real)
    given = {"a": list(a.astype(float).T), "b": list(b.astype(float).T)}
    wanted = np.transpose(run(multiplied(rows, columns), given, {"c": out}, _none)[0]["c"])
    close = {"rtol": 1e-5, "atol": 1e-5} if real == "float32" else {"rtol": 1e-13, "atol": 1e-13}
    one, many = np.zeros(out, real), np.zeros((count, out), real)
    call("trial", a[2], b[2], one)
    call("trial_batch", count, a, b, many)
    np.testing.assert_allclose(one, wanted[2], **close)
    np.testing.assert_allclose(many, wanted, **close)
    blocks = -(-count // lanes)
    laid = []
    for array in (a, b):
        padded = np.zeros((blocks * lanes, size), real)
        padded[:count] = array
        laid.append(np.ascontiguousarray(padded.reshape(blocks, lanes, size).transpose(0, 2, 1)))
    by_lane = np.zeros((blocks, out, lanes), real)
    call("trial_batch_soa", count, *laid, by_lane)
    np.testing.assert_allclose(by_lane.transpose(0, 2, 1).reshape(-1, out)[:count], wanted, **close)


def _none(function: str, given: list[list[float]]) -> tuple[list[list[float]], list[float]]:
    raise AssertionError(function)


def test_the_first_call_that_fails_says_where_and_spoils_the_outputs(tmp_path: Path) -> None:
    """Three calls, whose pivots are the entries of q."""
    called = Call("forward_dynamics", (("q_k", 0), ("qd", 0), ("tau", 0)), (("c_k", 0),), pivots=1)
    calls = For(3, (Slice("q_k", "q"), Slice("c_k", "c")), (called,))
    made = package({"q": 3, "qd": 1, "tau": 1}, {"c": 3}, Regions({}, (calls,)), pivots=3)
    call = Direct(made, shared_library(made, tmp_path, ["-O1", *WARNINGS]))
    qd, tau, c = np.array([0.5]), np.array([6.0]), np.zeros(3)
    assert call("trial", np.array([1.0, 2.0, 3.0]), qd, tau, c) == 0
    np.testing.assert_allclose(c, [6.5, 3.5, 2.5])
    assert call("trial", np.array([1.0, -2.0, -3.0]), qd, tau, c) == 2
    assert np.all(np.isnan(c))


def test_a_call_whose_pivots_are_the_first_ones_again(tmp_path: Path) -> None:
    """It fails with their numbers, wherever it stands, and a call after it goes on where the others were."""
    places = ("qd", 0), ("tau", 0)
    calls = (
        Call("forward_dynamics", (("q", 0), *places), (("c", 0),), pivots=1),
        Call("forward_dynamics", (("q", 1), *places), (("c", 1),), pivots=1, again=True),
        Call("forward_dynamics", (("q", 2), *places), (("c", 2),), pivots=1),
    )
    made = package({"q": 3, "qd": 1, "tau": 1}, {"c": 3}, Regions({}, calls), pivots=2)
    call = Direct(made, shared_library(made, tmp_path, ["-O1", *WARNINGS]))
    qd, tau, c = np.array([0.5]), np.array([6.0]), np.zeros(3)
    for bad, status in ((None, 0), (0, 1), (1, 1), (2, 2)):
        q = np.ones(3)
        if bad is not None:
            q[bad] = -1.0
        assert call("trial", q, qd, tau, c) == status
        assert np.isnan(c).all() == (bad is not None)


def test_roots_in_a_region_bring_their_header(tmp_path: Path) -> None:
    regions: tuple[Region, ...] = (straight(lambda read: {"c": Column([read("a", 1)[0].root()])}),)
    made = package({"a": 1}, {"c": 1}, Regions({}, regions))
    call = Direct(made, shared_library(made, tmp_path, ["-O1", *WARNINGS]))
    c = np.zeros(1)
    call("trial", np.array([9.0]), c)
    assert c == 3.0
