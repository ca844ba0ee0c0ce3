"""Products behind a PROGRAM: written out they are what NumPy multiplies."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.program.cost import cost
from psdmc.program.interpret import interpret
from psdmc.program.products import LARGE, Product, in_loops, lines, written_out, zero_columns
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Tracer
from psdmc.target.presets import COSTS

N = 3
PRODUCT = Product("c", "a", "b")


def factors(zero: int) -> Program:
    """a and b as they are read, but for b's first `zero` columns; b is put out column by column."""
    tracer = Tracer()
    a, b = tracer.symbols("left", N * N), tracer.symbols("right", N * N)
    by_column = [(j, k) for j in range(N) for k in range(N)]
    right = [(Slot("b", index), b[k * N + j] if j >= zero else 0.0) for index, (j, k) in enumerate(by_column)]
    return tracer.finish([*((Slot("a", i), value) for i, value in enumerate(a)), *right])


@pytest.mark.parametrize("zero", range(N + 1))
def test_written_out_it_is_minus_the_product(zero: int) -> None:
    rng = np.random.default_rng(zero)
    a, b = rng.normal(size=(2, 5, N, N))
    given = {"left": a.reshape(5, -1), "right": b.reshape(5, -1)}
    found = interpret(written_out(factors(zero), (PRODUCT,)), given, {"a": N * N, "c": N * N})
    b[:, :, :zero] = 0.0
    np.testing.assert_allclose(found["c"].reshape(5, N, N), -a @ b, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(found["a"].reshape(5, N, N), a)


@pytest.mark.parametrize("zero", range(N + 1))
def test_columns_that_are_always_zero_are_counted_and_cost_nothing(zero: int) -> None:
    assert zero_columns(factors(zero), PRODUCT) == zero
    assert (
        cost(written_out(factors(zero), (PRODUCT,))).mul
        == lines(factors(zero), PRODUCT)
        == N * N * (N - zero)
    )


def test_without_products_a_program_stays_itself() -> None:
    program = factors(0)
    assert written_out(program, ()) is program


@pytest.mark.parametrize(("block", "expected"), [(4, False), (16, True)])
def test_sixteen_rows_are_loops_unless_they_are_four_fingers(block: int, expected: bool) -> None:
    """Blocks on the diagonal: 4 x 4^3 multiplications in lines, or 16^3."""
    n, tracer = 16, Tracer()
    values = [
        value if i // block == j // block else 0.0
        for (i, j), value in zip(np.ndindex(n, n), tracer.symbols("given", n * n), strict=True)
    ]
    program = tracer.finish([(Slot(name, k), value) for name in ("a", "b") for k, value in enumerate(values)])

    assert lines(program, PRODUCT) == n * block**2
    assert (n * block**2 > LARGE**3) is expected
    assert in_loops(program, (PRODUCT,), n, COSTS) is expected
