"""Instruction counts, on contestants that differ by a thousand instructions."""

from __future__ import annotations

import pytest
from tiny_contestants import tiny

from psdmc.bench.measure import instructions


@pytest.mark.needs("valgrind")
def test_a_thousand_more_instructions_are_counted_as_such(two_link):
    few, many = tiny("few"), tiny("many")

    found = instructions([few, many], two_link.chain)

    difference = found[str(many.library), "many"] - found[str(few.library), "few"]
    assert difference == pytest.approx(1000.0, abs=0.5)
    assert 10.0 < found[str(few.library), "few"] < 60.0
