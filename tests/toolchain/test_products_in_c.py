"""Products of matrices behind a PROGRAM in C: loops for one state, lines for lanes, at every width and odd size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from direct import Direct, all_expected, shared_library, states
from slow_cases import slow_but_for
from test_odd_sizes import INFO

from psdmc.backends.c.back_end import library_files
from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions
from psdmc.program.kernel import Kernel
from psdmc.program.products import Product, written_out
from psdmc.program.program import Slot
from psdmc.program.signature import Quantity, Signature
from psdmc.program.trace import Tracer
from psdmc.target.presets import preset

SQUARE = ("nv", "nv")
COUNT = 11
FUNCTION = Signature(
    "products", 1, "- left right, twice",
    (Quantity("left", SQUARE), Quantity("right", SQUARE)),
    (Quantity("square", SQUARE), Quantity("cut", SQUARE), Quantity("all", SQUARE)),
    theta=False,
    products=(Product("cut", "square", "one"), Product("all", "square", "other")),
)  # fmt: skip


def kernel(n: int, zero: int) -> Kernel:
    """cut = - left right without right's first `zero` columns, all = - left right."""
    tracer = Tracer()
    left, right = tracer.symbols("left", n * n), tracer.symbols("right", n * n)
    columns = [right[k * n + j] for j in range(n) for k in range(n)]
    cut = [0.0 if index < zero * n else value for index, value in enumerate(columns)]
    values = {"one": cut, "other": columns, "square": left}
    outputs = [(Slot(name, i), value) for name, entries in values.items() for i, value in enumerate(entries)]
    before = tracer.finish(outputs)
    whole = written_out(before, FUNCTION.products)
    return Kernel(FUNCTION, False, whole, whole, "factored", before)


FLAGS = ("-march=native", "-g0", "-Dpendulum_NO_VECTORS")
FORMS = [
    (n, zero, real, flag)
    for n, zero in ((4, 0), (6, 2), (7, 1), (9, 5))
    for real in ("float64", "float32")
    for flag in FLAGS
]
QUICK = [
    (4, 0, "float64", FLAGS[0]),
    (6, 2, "float32", FLAGS[1]),
    (7, 1, "float64", FLAGS[2]),
    (9, 5, "float32", FLAGS[0]),
]
"""Each size, precision and kind of vector once."""


@pytest.mark.parametrize(("n", "zero", "real", "flag"), slow_but_for(QUICK, FORMS, spread=True))
def test_all_forms_multiply(n: int, zero: int, real: str, flag: str, tmp_path: Path) -> None:
    info = replace(INFO, joints=INFO.joints * n)
    made = kernel(n, zero)
    package = package_view(info, {"products": made}, EmitOptions(real=real))  # type: ignore[arg-type]
    optimised = "-O1" if flag == "-march=native" else "-O0"
    call = Direct(package, shared_library(package, tmp_path, [optimised, "-Wall", "-Werror", flag]))
    given = states(made, COUNT, n, 1)
    wanted = list(all_expected(made, given, n, 1).values())
    rows = [np.ascontiguousarray(given[name], real) for name in ("left", "right")]
    close = {"rtol": 1e-4, "atol": 1e-4} if real == "float32" else {"rtol": 1e-12, "atol": 1e-12}

    one = [np.full(n * n + 1, 99.0, real) for _ in wanted]
    call("products", *(array[3] for array in rows), *one)
    many = [np.full((COUNT + 1, n * n), 99.0, real) for _ in wanted]
    call("products_batch", COUNT, *rows, *many)
    lanes = package.lanes
    blocks = [np.zeros((-(-COUNT // lanes) * lanes, n * n), real) for _ in rows]
    for block, array in zip(blocks, rows, strict=True):
        block[:COUNT] = array
    laid = [
        np.ascontiguousarray(block.reshape(-1, lanes, n * n).transpose(0, 2, 1).reshape(-1))
        for block in blocks
    ]
    by_lane = [np.full(laid[0].size + 1, 99.0, real) for _ in wanted]
    call("products_batch_soa", COUNT, *laid, *by_lane)
    for k, values in enumerate(wanted):
        np.testing.assert_allclose(one[k][:-1], values[3], **close)
        np.testing.assert_allclose(many[k][:-1], values, **close)
        back = by_lane[k][:-1].reshape(-1, n * n, lanes).transpose(0, 2, 1).reshape(-1, n * n)
        np.testing.assert_allclose(back[:COUNT], values, **close)
        assert {one[k][-1], *many[k][-1], by_lane[k][-1]} == {99.0}


@pytest.mark.parametrize(("left", "right"), [(False, True), (True, False), (True, True)])
def test_an_output_may_lie_where_an_input_was(left: bool, right: bool, tmp_path: Path) -> None:
    made, n = kernel(6, 0), 6
    package = package_view(replace(INFO, joints=INFO.joints * n), {"products": made}, EmitOptions())
    call = Direct(package, shared_library(package, tmp_path, ["-O2"]))
    given = states(made, 1, n, 1)
    a, b = given["left"][0].copy(), given["right"][0].copy()
    out = [np.empty(n * n), b if right else np.empty(n * n), a if left else np.empty(n * n)]
    wanted = [values[0] for values in all_expected(made, given, n, 1).values()]
    call("products", a, b, *out)
    for found, expected in zip(out, wanted, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_small_targets_have_the_loop_alone() -> None:
    info = replace(INFO, joints=INFO.joints * 6)
    package = package_view(info, {"products": kernel(6, 1)}, EmitOptions(target=preset("cortex-m7")))
    text = library_files(package)["src/products.h"]
    assert "minus_product(" in text
    assert "PRODUCT_LINES" not in text
