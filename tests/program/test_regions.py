"""Functions of loops and calls: what `run` makes of them, on numbers, on arrays of states and on symbols."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from region_functions import MATRICES, doubled, multiplied

from psdmc.errors import InternalError
from psdmc.program.interpret import interpret
from psdmc.program.program import Slot
from psdmc.program.regions import (
    Call,
    Column,
    For,
    Regions,
    Slice,
    Straight,
    drop_unread,
    read_late,
    run,
    straight,
)
from psdmc.program.text import parse, show
from psdmc.program.trace import Tracer

N, M = 3, 2


def test_nested_loops_over_slices_multiply_matrices() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(N, M)), rng.normal(size=(M, N))
    found, pivots = run(multiplied(N, M), {"a": a.ravel(), "b": b.ravel()}, {"c": N * N}, doubled)
    np.testing.assert_allclose(np.reshape(found["c"], (N, N)), a @ b, rtol=1e-14)
    assert pivots == []


def test_on_arrays_they_run_state_by_state_and_on_symbols_they_are_one_straight_line() -> None:
    rng = np.random.default_rng(2)
    given = {"a": rng.normal(size=(5, N * M)), "b": rng.normal(size=(5, N * M))}
    found, _ = run(multiplied(N, M), {name: list(x.T) for name, x in given.items()}, {"c": N * N}, doubled)
    tracer = Tracer()
    symbols = {name: tracer.symbols(name, N * M) for name in given}
    written, _ = run(multiplied(N, M), symbols, {"c": N * N}, doubled)
    whole = tracer.finish([(Slot("c", k), value) for k, value in enumerate(written["c"])])
    assert sum(bool(instr.args) for instr in whole) == N * N * (2 * M - 1)
    np.testing.assert_array_equal(np.transpose(found["c"]), interpret(whole, given, {"c": N * N})["c"])


def test_a_call_takes_arrays_from_an_entry_on_and_numbers_its_pivots_on() -> None:
    call = Call("double", (("a", 1),), (("c", 1),), pivots=1)
    fill = straight(lambda read: {"c": Column(read("a", 1))})
    found, pivots = run(Regions({}, (fill, call, call)), {"a": [1.0, 2.0, 3.0]}, {"c": 3}, doubled)
    assert found["c"] == [1.0, 4.0, 6.0]
    assert pivots == [2.0, 2.0]
    again = Call("double", (("a", 1),), (("c", 1),), pivots=1, again=True)
    assert run(Regions({}, (fill, call, again)), {"a": [1.0, 2.0, 3.0]}, {"c": 3}, doubled)[1] == [2.0]


def test_a_straight_line_reads_before_it_writes() -> None:
    swap = Straight(parse("x = load c[0]\ny = load c[1]\nout c[0] = y\nout c[1] = x"))
    fill = straight(lambda read: {"c": Column(read("a", 2))})
    found, _ = run(Regions({}, (fill, swap)), {"a": [1.0, 2.0]}, {"c": 2}, doubled)
    assert found["c"] == [2.0, 1.0]


def test_what_was_never_written_cannot_be_read() -> None:
    body = Regions({"own": 1}, (straight(lambda read: {"c": Column(read("own", 1))}),))
    with pytest.raises(InternalError, match=r"own\[0\] is read before it is written"):
        run(body, {}, {"c": 1}, doubled)


def test_constants_move_on_with_the_rounds() -> None:
    add = straight(lambda read: {"c": Column([read("c", 1)[0] * read("weight_k", 1)[0]])})
    body = (straight(lambda read: {"c": Column([1.0])}), For(3, (Slice("weight_k", "weight"),), (add,)))
    assert run(Regions({}, body, {"weight": (2.0, 3.0, 5.0)}), {}, {"c": 1}, doubled)[0]["c"] == [30.0]


def test_what_nothing_reads_is_dropped_with_its_slices_and_loops() -> None:
    """`left` is read by what fills `lost` alone, and `lost` by nothing."""
    both = Straight(parse("x = load a_k[0]\ny = neg x\nout c_k[0] = y\nout lost_k[0] = x"))
    slices = (Slice("a_k", "a"), Slice("c_k", "c"), Slice("lost_k", "lost"), Slice("unused", "a"))
    fill = straight(lambda read: {"left": Column(read("a", 1))})
    more = For(2, (Slice("lost_k", "lost"),), (straight(lambda read: {"lost_k": Column(read("left", 1))}),))
    after = drop_unread(Regions({"left": 1, "lost": 2}, (fill, For(2, slices, (both,)), more)))
    (loop,) = after.regions
    assert isinstance(loop, For)
    assert [each.name for each in loop.slices] == ["a_k", "c_k"]
    (line,) = loop.regions
    assert isinstance(line, Straight)
    assert show(line.program) == "t0 = load a_k[0]\nt1 = neg t0\nout c_k[0] = t1"
    assert after.arrays == {}
    assert drop_unread(after) == after


@pytest.mark.parametrize(("rows", "columns"), MATRICES)
def test_dropping_keeps_outputs(rows: int, columns: int) -> None:
    body, size = multiplied(rows, columns), rows * columns
    idle = For(size, (Slice("entry", "idle"),), (straight(lambda read: {"entry": Column([1.0])}),))
    more = replace(body, arrays={**body.arrays, "idle": size}, regions=(idle, *body.regions))
    assert drop_unread(more) == drop_unread(body)
    given = {name: list(np.random.default_rng(3).normal(size=size)) for name in ("a", "b")}
    outputs = {"c": rows * rows}
    assert run(drop_unread(more), given, outputs, doubled) == run(body, given, outputs, doubled)


def test_inputs_that_are_read_after_an_output_was_written() -> None:
    """A call writes the output y; then a loop reads a through a slice, and a second call reads c and the parameters."""
    first = Call("f", (("a", 0), ("b", 0)), (("y", 0),))
    loop = For(2, (Slice("part", "a"),), (Straight(parse("x = load part[0]\nout work[0] = x")),))
    second = Call("g", (("c", 0),), (("z", 0),))
    inputs, outputs = ("a", "b", "c", "theta_b"), ("y", "z")
    body = Regions({"work": 1}, (first, loop, second))
    assert read_late(body, inputs, outputs, "theta_b") == ("a", "c", "theta_b")
    assert read_late(Regions({"work": 1}, (loop, first)), inputs, outputs, "") == ()
    stores = For(
        2, (Slice("part", "a"), Slice("end", "y")), (Straight(parse("x = load part[0]\nout end[0] = x")),)
    )
    assert read_late(Regions({}, (stores,)), inputs, outputs, "") == ("a",)
