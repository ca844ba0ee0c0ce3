"""fuse_sums: early terms are added early, products by multiply-add, and values stay."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from psdmc.program.cost import cost
from psdmc.program.passes.fuse_sums import fuse_sums
from psdmc.program.program import Program, check
from psdmc.program.text import parse, show

Outputs = Callable[[Program], np.ndarray]


def test_what_arrives_late_is_added_last():
    before = parse("""
        a = load q[0]
        b = load q[1]
        s = sin a
        x = mul s b
        y = add x a
        z = sub y b
        out tau[0] = z
    """)

    assert show(fuse_sums(before)).splitlines() == [
        "t0 = load q[0]",
        "t1 = load q[1]",
        "t2 = sin t0",
        "t3 = mul t2 t1",
        "t4 = sub t0 t1",
        "t5 = add t3 t4",
        "out tau[0] = t5",
    ]


def test_terms_that_are_there_first_are_added_first_wherever_they_stand():
    before = parse("""
        a = load q[0]
        s = sin a
        b = load q[1]
        c = load q[2]
        x = add s b
        y = add x c
        out tau[0] = y
    """)

    assert show(fuse_sums(before)).splitlines()[4:] == [
        "t4 = add t2 t3",
        "t5 = add t1 t4",
        "out tau[0] = t5",
    ]


def test_two_products_and_a_number_take_two_multiply_adds():
    before = parse("""
        a = load q[0]
        b = load q[1]
        c = load q[2]
        x = mul a b
        y = mul b c
        s = add x y
        z = add s a
        out tau[0] = z
    """)

    after = fuse_sums(before)

    assert (cost(before).fused, cost(after).fused) == (1, 2)


def test_a_sum_that_something_else_needs_stays_whole():
    before = parse("""
        a = load q[0]
        b = load q[1]
        s = add a b
        z = sub s a
        out tau[0] = z
        out tau[1] = s
    """)

    assert show(fuse_sums(before)) == show(before)


def test_a_sum_of_subtracted_terms_keeps_its_sign(outputs: Outputs):
    before = parse("""
        a = load q[0]
        b = load q[1]
        c = load q[2]
        s = sin c
        x = sub s a
        y = sub x b
        out tau[0] = y
    """)

    np.testing.assert_allclose(outputs(fuse_sums(before)), outputs(before), rtol=1e-14)


def test_on_any_program_values_and_counts_stay_and_a_second_run_changes_nothing(
    some_program: Program, outputs: Outputs
):
    after = check(fuse_sums(some_program), after="fuse_sums")

    np.testing.assert_allclose(outputs(after), outputs(some_program), rtol=1e-9, atol=1e-9)
    assert cost(after).total == cost(some_program).total
    assert fuse_sums(after) == after
