"""Each pass: a text before and after, and what it promises on random PROGRAMs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from random_programs import SEEDS, random_program

from psdmc.errors import InternalError
from psdmc.program import pipeline
from psdmc.program.cost import cost
from psdmc.program.passes.absorb_negations import absorb_negations
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.passes.factor_common import factor_common
from psdmc.program.passes.fold_constants import fold_constants
from psdmc.program.passes.free_registers import free_registers
from psdmc.program.passes.fuse_sums import fuse_sums
from psdmc.program.passes.merge_duplicates import merge_duplicates
from psdmc.program.passes.schedule import live_values, schedule
from psdmc.program.pipeline import optimize
from psdmc.program.program import Instr, Op, Program, Slot, check
from psdmc.program.text import parse, show

Outputs = Callable[[Program], np.ndarray]
EXACT = (drop_unused, merge_duplicates, fold_constants, absorb_negations, schedule, free_registers)
LOADS = "a = load q[0]\nb = load q[1]\nc = load q[2]\nd = load qd[0]\n"


def lines(program: Program) -> list[str]:
    return show(program).splitlines()


@pytest.mark.parametrize("apply", EXACT, ids=lambda apply: apply.__name__)
def test_a_pass_keeps_outputs_bit_for_bit(apply: pipeline.Pass, some_program: Program, outputs: Outputs):
    after = check(apply(some_program), after=apply.__name__)

    np.testing.assert_array_equal(outputs(after), outputs(some_program))
    assert [slot for slot, _ in after.outputs] == [slot for slot, _ in some_program.outputs]


@pytest.mark.parametrize("apply", EXACT, ids=lambda apply: apply.__name__)
def test_the_random_programs_have_what_a_pass_changes(apply: pipeline.Pass):
    assert sum(apply(program) != program for program in map(random_program, SEEDS)) >= 5


@pytest.mark.parametrize("apply", EXACT, ids=lambda apply: apply.__name__)
def test_a_pass_run_twice_changes_nothing(apply: pipeline.Pass, some_program: Program):
    once = apply(some_program)

    assert apply(once) == once


@pytest.mark.parametrize("apply", [factor_common, fuse_sums, optimize], ids=lambda apply: apply.__name__)
def test_what_reorders_costs_no_more_when_it_is_run_again(apply: pipeline.Pass, some_program: Program):
    once = drop_unused(apply(some_program))
    again = drop_unused(apply(once))

    assert cost(again).total <= cost(once).total
    assert len(again) <= len(once)


def test_what_no_output_needs_is_dropped():
    before = parse(LOADS + "x = mul a b\ny = sin c\nz = neg y\nout tau[0] = x")

    assert lines(drop_unused(before)) == [
        "t0 = load q[0]",
        "t1 = load q[1]",
        "t2 = mul t0 t1",
        "out tau[0] = t2",
    ]


def test_after_dropping_everything_is_needed(some_program: Program):
    assert all(count > 0 for count in drop_unused(some_program).uses())


def test_a_product_and_its_mirror_image_are_computed_once():
    before = parse("""
        a = load q[0]
        b = load qd[0]
        x = mul a b
        y = mul b a
        z = add x y
        out tau[0] = z
    """)

    assert lines(merge_duplicates(before)) == [
        "t0 = load q[0]",
        "t1 = load qd[0]",
        "t2 = mul t0 t1",
        "t3 = add t2 t2",
        "out tau[0] = t3",
    ]


def test_after_merging_no_two_instructions_are_equal(some_program: Program):
    after = merge_duplicates(some_program)

    assert len({instr.canonical(range(len(after))) for instr in after}) == len(after)


def test_operations_on_constants_become_constants():
    before = parse("""
        a = load q[0]
        zero = const 0.0
        one = const 1.0
        half = const 0.5
        two = div one half
        x = mul a one
        y = add x zero
        z = mul two y
        w = mul z zero
        v = sub z w
        out tau[0] = v
    """)

    assert lines(drop_unused(fold_constants(before))) == [
        "t0 = load q[0]",
        "t1 = const 2.0",
        "t2 = mul t1 t0",
        "out tau[0] = t2",
    ]


def test_a_division_of_constants_by_zero_is_left_alone():
    before = parse("a = const 1.0\nz = const 0.0\nx = div a z\nout tau[0] = x")

    assert fold_constants(before) == before


def test_signs_go_into_the_operations_around_them():
    before = parse(
        LOADS
        + """
        na = neg a
        x = add na b
        nx = neg x
        k = const 3.0
        kc = mul k c
        nkc = neg kc
        y = sub nx nkc
        p = mul d na
        np = neg p
        z = mul np na
        out tau[0] = y
        out tau[1] = z
    """
    )

    # -(b - a) is a - b; two minus signs of a product cancel; 3 c is subtracted with its sign changed twice
    assert lines(absorb_negations(before)) == [
        "t0 = load q[0]",
        "t1 = load q[1]",
        "t2 = load q[2]",
        "t3 = load qd[0]",
        "t4 = neg t0",
        "t5 = sub t0 t1",
        "t6 = const 3.0",
        "t7 = mul t6 t2",
        "t8 = add t5 t7",
        "t9 = mul t3 t4",
        "t10 = mul t9 t0",
        "out tau[0] = t8",
        "out tau[1] = t10",
    ]


def test_absorbing_signs_never_costs_an_operation(some_program: Program):
    def operations(program: Program) -> int:
        return sum(bool(instr.args) for instr in program)

    assert operations(absorb_negations(some_program)) <= operations(drop_unused(some_program))


def test_a_common_factor_is_taken_out_of_a_chain_of_sums():
    before = parse(
        LOADS
        + """
        ab = mul a b
        ac = mul a c
        bd = mul b d
        s = add ab bd
        t = sub s ac
        out tau[0] = t
    """
    )

    # a b + b d - a c: a and b are in two products each, a comes first
    assert lines(factor_common(before)) == [
        "t0 = load q[0]",
        "t1 = load q[1]",
        "t2 = load q[2]",
        "t3 = load qd[0]",
        "t4 = sub t1 t2",
        "t5 = mul t0 t4",
        "t6 = mul t1 t3",
        "t7 = add t5 t6",
        "out tau[0] = t7",
    ]


def test_factors_are_taken_out_of_brackets_and_long_products():
    before = parse(
        LOADS
        + """
        ab = mul a b
        abc = mul ab c
        da = mul d a
        dab = mul da b
        ac = mul a c
        s = add abc dab
        t = sub s ac
        out tau[0] = t
    """
    )

    after = factor_common(before)

    # a (b (c + d) - c)
    assert (cost(before).mul, cost(after).mul, cost(after).add) == (5, 2, 2)


def test_a_product_that_something_else_needs_is_no_part_of_the_sum():
    before = parse(LOADS + "x = mul a b\ny = mul a c\ns = add x y\nout tau[0] = s\nout tau[1] = x")

    assert factor_common(before) == drop_unused(before)


def test_a_factor_that_stands_alone_in_the_sum_is_not_taken_out():
    before = parse(LOADS + "x = mul a b\ny = mul a c\ns = add x a\nt = add s y\nu = add t d\nout tau[0] = u")

    after = factor_common(before)

    # a (b + c) + a + d
    assert (cost(after).mul, cost(after).add) == (1, 3)
    assert lines(after)[4:6] == ["t4 = add t1 t2", "t5 = mul t0 t4"]


def test_products_that_are_subtracted_keep_their_sign(outputs: Outputs):
    before = parse(LOADS + "x = mul a b\ny = mul a c\nz = sub d x\nw = sub z y\nout tau[0] = w")

    after = factor_common(before)

    assert cost(after).mul == 1
    np.testing.assert_allclose(outputs(after), outputs(before), rtol=1e-14, atol=1e-15)


def test_what_a_sum_adds_and_subtracts_is_left_out():
    before = parse(
        LOADS
        + """
        x = mul a b
        y = sub c d
        z = sub y x
        s = add x z
        out tau[0] = s
    """
    )

    assert lines(factor_common(before)) == [
        "t0 = load q[2]",
        "t1 = load qd[0]",
        "t2 = sub t0 t1",
        "out tau[0] = t2",
    ]


def test_a_sum_that_is_left_with_a_minus_alone_stays_as_it_is(outputs: Outputs):
    before = parse(LOADS + "x = sub a b\ny = sub x a\nz = sub y c\nout tau[0] = y\nout tau[1] = z")

    np.testing.assert_array_equal(outputs(factor_common(before)), outputs(before))


def test_factoring_keeps_outputs_up_to_rounding_and_saves(some_program: Program, outputs: Outputs):
    after = check(factor_common(some_program), after="factor_common")

    np.testing.assert_allclose(outputs(after), outputs(some_program), rtol=1e-11, atol=1e-11)
    kept = drop_unused(some_program)
    assert cost(after).mul <= cost(kept).mul
    assert cost(after).add <= cost(kept).add


def test_scheduling_computes_values_where_they_are_used():
    before = parse(
        LOADS
        + """
        x = mul a b
        y = mul c d
        u = sin x
        v = sin y
        out tau[0] = u
        out tau[1] = v
    """
    )

    after = schedule(before)

    assert [instr.op for instr in after if instr.args] == [Op.MUL, Op.SIN, Op.MUL, Op.SIN]
    assert (live_values(before), live_values(after)) == (4, 2)


def test_values_are_read_for_the_last_time_soon_whatever_output_needs_them():
    before = parse(
        LOADS
        + """
        x = mul a b
        y = mul c d
        u = sub x y
        v = mul u u
        w = cos v
        first = sin x
        second = sin y
        out tau[0] = w
        out tau[1] = first
        out tau[2] = second
    """
    )

    after = free_registers(before)

    expected = [Op.MUL, Op.SIN, Op.MUL, Op.SUB, Op.SIN, Op.MUL, Op.COS]
    assert [instr.op for instr in after if instr.args] == expected
    assert schedule(before) == before
    assert (live_values(before), live_values(after)) == (5 + 5 + 1 + 1, 3 + 2 + 2 + 1)


@pytest.mark.parametrize("order", [schedule, free_registers], ids=lambda apply: apply.__name__)
def test_scheduling_never_holds_more_values(order: pipeline.Pass, some_program: Program):
    before = drop_unused(some_program)
    after = order(before)

    assert live_values(after) <= live_values(before)
    assert sorted(i.op for i in after) == sorted(i.op for i in before)


def test_optimizing_saves_and_keeps_outputs_up_to_rounding(some_program: Program, outputs: Outputs):
    after = optimize(some_program)

    np.testing.assert_allclose(outputs(after), outputs(some_program), rtol=1e-11, atol=1e-11)
    assert cost(after).total <= cost(drop_unused(some_program)).total


@pytest.mark.parametrize(("long", "rounds"), [(201, 1), (203, 10)])
def test_a_long_program_ends_with_a_round_that_saves_little(
    monkeypatch: pytest.MonkeyPatch, long: int, rounds: int
) -> None:
    """A round that saves one operation of 200: the last one of a long PROGRAM, one of LONGEST of a short one."""

    def save_one(program: Program) -> Program:
        return Program(program.body[:-1], program.outputs[:-1])

    sums = [Instr(Op.ADD, (0, 1)), *(Instr(Op.ADD, (1, k)) for k in range(2, 201))]
    body = (Instr(Op.LOAD, slot=Slot("q", 0)), Instr(Op.LOAD, slot=Slot("q", 1)), *sums)
    program = Program(body, tuple((Slot("tau", k), k) for k in range(202)))
    monkeypatch.setattr(pipeline, "ROUND", (save_one,))
    monkeypatch.setattr(pipeline, "LONG", long)

    assert cost(pipeline.shortened(program)).add == 200 - rounds


def test_the_pipeline_names_the_pass_that_broke_a_rule(monkeypatch: pytest.MonkeyPatch):
    def lose_everything(program: Program) -> Program:
        return Program((), program.outputs)

    monkeypatch.setattr(pipeline, "last_for_one_state", lambda costs: (lose_everything,))

    with pytest.raises(InternalError, match="after lose_everything: an output is not defined"):
        optimize(parse("a = load q[0]\nout tau[0] = a"))


def test_two_common_factors_leave_one_bracket(outputs: Outputs):
    """a b c + b a qd0 is a b (c + qd0): the inner sum of the first factor is a product again."""
    before = parse(LOADS + "u = mul a b\nv = mul u c\nw = mul b a\nx = mul w d\ny = add v x\nout tau[0] = y")

    after = drop_unused(factor_common(before))

    assert (cost(after).mul, cost(after).add) == (2, 1)
    np.testing.assert_allclose(outputs(after)[:, 0], outputs(before)[:, 0], rtol=1e-14, atol=1e-15)
