"""Chains of one to five joints, turning and sliding about any axes: MODEL and PROGRAM on all, each by one of the two
lowerings; C on some. `make test-accuracy` takes two hundred, and C on ten; `make test` thirty, and C on three."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from answers import Questions, compiled_answers, errors, numpy_answers, program_answers, too_large
from hypothesis import given, settings
from hypothesis import strategies as st
from robots_at_hand import drawn

from psdmc.compiler import compile
from psdmc.functions import DEFAULT
from psdmc.lower import kernels, search
from psdmc.lower.kernels import EXPANDED_LIMIT, Lowering, lower
from psdmc.toolchain import compile as toolchain
from psdmc.toolchain.compiler_command import find_compiler

WHOLE = os.environ.get("PSDMC_ACCURACY") == "whole"
CHAINS = {1: 50, 2: 50, 3: 50, 4: 30, 5: 20} if WHOLE else {1: 8, 2: 8, 3: 8, 4: 4, 5: 2}
"""How many chains of each length."""
KINDS = ["R", "P", "RR", "PR", "RP", "RPR", "PRR", "RRPR", "RRRP", "RPRRP"]
COMPILED = list(enumerate(KINDS, start=100))[:: 1 if WHOLE else 4]
"""Seed and joints of those in C."""
STATES = 30
BUDGET = 12
"""Programs that the search for cheap arrangements may trace: whichever it takes must be right, and full searches take
seconds a chain."""


@pytest.fixture(autouse=True, scope="module")
def short_search():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "Search", partial(search.Search, budget=BUDGET))
        yield


@pytest.mark.parametrize(("length", "chains"), CHAINS.items())
def test_model_and_program(length: int, chains: int):
    @given(
        seed=st.integers(0, 10**6),
        kinds=st.text("RP", min_size=length, max_size=length),
        tidy=st.booleans(),
        function=st.sampled_from(DEFAULT[1:]),
        form=st.sampled_from(["factored", "expanded"]),
    )
    @settings(max_examples=chains, deadline=None)
    def check(seed: int, kinds: str, tidy: bool, function: str, form: Lowering):
        robot = drawn(seed, kinds, tidy=tidy)
        questions = Questions(robot, STATES)
        is_short = robot.model.p is not None and robot.model.p <= EXPANDED_LIMIT
        lowered = lower(robot.model, form if is_short else "factored", [DEFAULT[0], function])

        assert not too_large(errors(questions, numpy_answers(robot.model, questions)))
        assert not too_large(errors(questions, program_answers(lowered, robot.model, questions)))

    check()


@pytest.mark.parametrize(("seed", "kinds"), COMPILED)
def test_compiled_without_optimisation(
    seed: int, kinds: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    unoptimised = replace(find_compiler(), flags=("-O0", "-fPIC"))
    monkeypatch.setattr(toolchain, "find_compiler", lambda target: unoptimised)
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path))
    robot = drawn(seed, kinds)
    questions = Questions(robot, STATES)

    found = errors(questions, compiled_answers(compile(robot.model), robot.model, questions))

    assert not too_large(found)
