"""Counts gate: what grew fails, what fell passes, what cannot be compared is said."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest

from psdmc.bench import gate
from psdmc.bench.case import DIFFERENTIATED, Case
from psdmc.bench.cases import EXAMPLES, standard_chains
from psdmc.bench.gate import BASELINE, Baseline, compare, count
from psdmc.bench.rivals import psdmc_c
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.program.program import Instr, Op, Program

WHOLE = os.environ.get("PSDMC_ACCURACY") == "whole"

OPERATIONS = {"inverse_dynamics": {"mul": 225, "add": 222}}

ONE = {"KR6": {"inverse_dynamics": {"mul": 225, "add": 222, "instructions state": 885.16}}}


def baseline(**changed: float) -> Baseline:
    named = {key.replace("_", " "): value for key, value in changed.items()}
    return Baseline("gcc 12", {"KR6": {"inverse_dynamics": {**ONE["KR6"]["inverse_dynamics"], **named}}})


def test_equal_counts_pass():
    assert compare(baseline(), baseline()) == ("counts are those of the baseline", True)


def test_one_more_multiplication_fails():
    text, passed = compare(baseline(), baseline(mul=226))

    assert not passed
    assert text.splitlines()[0] == "KR6 inverse_dynamics: mul 225 -> 226  GREW"


def test_fewer_operations_pass_and_are_said():
    text, passed = compare(baseline(), baseline(add=221))

    assert passed
    assert text.splitlines()[0] == "KR6 inverse_dynamics: add 222 -> 221  fell"


def test_instructions_may_grow_by_their_slack_and_no_more():
    text, passed = compare(baseline(), baseline(instructions_state=886.0))
    assert passed
    assert text.splitlines()[0].endswith("-> 886  grew by less than counts")
    assert not compare(baseline(), baseline(instructions_state=888.0))[1]


def test_another_compilers_instructions_are_not_compared():
    text, passed = compare(baseline(), replace(baseline(instructions_state=2000.0), compiler="clang 15"))

    assert passed
    assert "not compared" in text


def test_operations_gate_under_any_compiler():
    assert not compare(baseline(), replace(baseline(mul=226), compiler="clang 15"))[1]


def test_missing_valgrind_is_said():
    after = Baseline("gcc 12", {"KR6": OPERATIONS}, {"KR6": "valgrind was not found"})

    text, passed = compare(baseline(), after)

    assert passed
    assert "instructions were not counted: valgrind was not found" in text


def test_a_robot_without_instruction_counts_is_named_and_the_others_are_compared():
    grown = baseline(instructions_state=2000.0).counts
    after = Baseline("gcc 12", {"talos": OPERATIONS, **grown}, {"talos": "valgrind was killed by SIGILL"})
    before = Baseline("gcc 12", {"talos": {**ONE["KR6"]}, **ONE})

    text, passed = compare(before, after)

    assert not passed
    assert "KR6 inverse_dynamics: instructions state 885.16 -> 2000  GREW" in text
    assert "talos: instructions were not counted: valgrind was killed by SIGILL" in text


def test_saving_keeps_instruction_counts_of_a_robot_that_could_not_be_counted(tmp_path, monkeypatch):
    path = tmp_path / "b.json"
    path.write_text(baseline().to_json())
    after = Baseline("gcc 12", {"KR6": {"inverse_dynamics": {"mul": 220}}}, {"KR6": "killed by SIGILL"})
    monkeypatch.setattr(gate, "_counted", lambda names: after)
    monkeypatch.setattr("sys.argv", ["gate", "save", "--baseline", str(path)])

    assert gate.main() == 0
    kept = Baseline.read(path).counts["KR6"]["inverse_dynamics"]
    assert kept == {"mul": 220, "instructions state": 885.16}


def test_a_function_that_the_baseline_lacks_fails():
    after = Baseline("gcc 12", {"KR6": {**ONE["KR6"], "gravity": {"mul": 1}}})

    assert not compare(baseline(), after)[1]


def test_baseline_reads_what_it_wrote(tmp_path):
    (tmp_path / "b.json").write_text(baseline().to_json())

    assert Baseline.read(tmp_path / "b.json") == baseline()


@pytest.mark.parametrize("text", [None, "{", "[]", '{"schema": 1}'])
def test_a_missing_or_foreign_baseline_is_one_clear_error(tmp_path, text):
    path = tmp_path / "b.json"
    if text is not None:
        path.write_text(text)

    with pytest.raises(InputError, match=r"b\.json"):
        Baseline.read(path)


def with_one_more_multiplication(program: Program) -> Program:
    """The same outputs, the first of them squared beforehand for nothing."""
    (slot, index), *others = program.outputs
    wasted = Instr(Op.MUL, (index, index))
    last = len(program.body)
    body = (*program.body, wasted, Instr(Op.DIV, (last, index)))
    return Program(body, ((slot, last + 1), *others))


def test_an_extra_multiplication_in_the_code_fails_the_gate(two_link, monkeypatch):
    before = count([two_link], with_instructions=False)
    kernels = psdmc_c.kernels_of(two_link.model, "factored", psdmc_c.FUNCTIONS)
    worse = {n: replace(k, single=with_one_more_multiplication(k.single)) for n, k in kernels.items()}
    monkeypatch.setattr(psdmc_c, "kernels_of", lambda *given: worse)

    text, passed = compare(before, count([two_link], with_instructions=False))

    assert not passed
    assert "two-link inverse_dynamics: mul" in text


def committed() -> Baseline:
    return Baseline.read(EXAMPLES.parents[1] / BASELINE)


def case_of(name: str) -> Case:
    """Lowered the same with or without E and P, and derived sooner without."""
    return Case(name, derive_model(standard_chains()[name](), expand=False))


def test_the_committed_baseline_names_every_standard_robot_and_function():
    counts = committed().counts

    assert list(counts) == list(standard_chains())
    for robot, functions in counts.items():
        left_out = DIFFERENTIATED if robot == "talos" else ("no function",)
        assert list(functions) == [name for name in psdmc_c.FUNCTIONS if not name.endswith(left_out)]


@pytest.mark.parametrize("name", ["KR6", *(["UR5", "Panda", "generic 6R", "solo12"] if WHOLE else [])])
def test_no_operation_more_than_the_committed_baseline(name):
    """A wrist; `make test-accuracy` takes parallel axes, seven joints, oblique axes and a quadruped too, whose operations
    test_floating_robots.py bounds, `make bench-compare` every standard robot."""
    text, passed = compare(committed(), count([case_of(name)], with_instructions=False))

    assert passed, text


@pytest.mark.skipif(not WHOLE, reason="make test-accuracy takes it")
@pytest.mark.needs("valgrind")
def test_no_instruction_more_than_the_committed_baseline():
    text, passed = compare(committed(), count([case_of("KR6")]))

    assert passed, text
