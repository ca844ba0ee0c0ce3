"""Cold calls find nothing in the caches; sizes of machine code are those of the functions."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from made_up_bench import made_up_result
from tiny_contestants import tiny

from psdmc.bench.case import Case
from psdmc.bench.contestant import Runner
from psdmc.bench.measure import CALLS, LEAST, MOST, code_bytes, code_sizes, swept_memory
from psdmc.bench.results import BenchResult, as_text
from psdmc.bench.run import Settings, run
from psdmc.bench.states import States
from psdmc.report.bench_page import page

COLDER = 3.0
"""Times that a walk from line to line of memory takes longer from memory than from L2, at least: ten is usual."""

needs_nm = pytest.mark.skipif(shutil.which("nm") is None, reason="needs nm")


@pytest.mark.needs("g++")
def test_a_walk_through_memory_takes_longer_cold(two_link: Case) -> None:
    walk = Runner(tiny("walk"), States.random(two_link.chain, 1024, seed=1))
    kept, swept = (walk.cold(CALLS, memory) for memory in (np.ones(8), swept_memory()))

    assert len(swept) == CALLS
    assert np.median(swept) > COLDER * np.median(kept)


def test_what_is_swept_is_larger_than_the_caches_within_bounds() -> None:
    assert LEAST <= swept_memory().nbytes <= MOST


@pytest.mark.needs("g++")
@needs_nm
def test_a_thousand_more_instructions_are_a_thousand_more_bytes(two_link: Case) -> None:
    sizes = code_sizes(tiny("few").library)
    loops = [sizes[f"{name}_cold"] for name in ("few", "many")]
    assert loops[1] - loops[0] == pytest.approx(1000, abs=32)


def test_parts_are_added_and_what_is_unknown_is_none() -> None:
    sizes = {"f": 10, "f_part_0": 5, "f_part_1": 6, "g": 100}
    assert code_bytes(sizes, lambda name: name.startswith("f")) == 21
    assert code_bytes(sizes, lambda name: name == "h") is None


@needs_nm
@pytest.mark.slow
def test_a_run_has_both_where_one_state_is_a_call(two_link: Case) -> None:
    settings = Settings(rounds=1, states=2048, rivals=("psdmc factored",), functions=("gravity",), cold=True)
    result = run([two_link], settings)
    found = {m.layout: m for m in result.cases[0].measurements}

    one = found["state"]
    assert one.times.cold is not None
    assert one.times.cold.median > 0.0
    assert one.code_bytes is not None
    assert 20 < one.code_bytes < 20_000
    assert found["rows"].times.cold is None
    assert found["rows"].code_bytes is None
    assert BenchResult.from_json(result.to_json()) == result


def test_table_and_page_show_both() -> None:
    result = made_up_result()
    assert "cold 1000  code 12.3 KB" in as_text(result)
    assert "<td>1,000</td><td>12.3</td>" in page(result)
