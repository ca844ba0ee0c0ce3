"""What `make test` leaves out is marked, and CI runs it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from slow_cases import slow_but_for

ROOT = Path(__file__).parent.parent


def test_only_the_quick_cases_are_not_slow() -> None:
    one, two = slow_but_for([(1, "a")], [(1, "a"), (2, "b")], spread=True)

    assert (one.values, list(one.marks)) == ((1, "a"), [])
    assert (two.values, [mark.name for mark in two.marks]) == ((2, "b"), ["slow"])
    assert slow_but_for(["x"], ["x"])[0].values == ("x",)


def test_a_quick_case_that_is_none_is_said() -> None:
    with pytest.raises(ValueError, match="'c' is no case"):
        slow_but_for(["c"], ["a", "b"])


def test_ci_runs_all_that_make_test_leaves_out() -> None:
    """Each commit runs one tenth of the longer tests."""
    recipes = (ROOT / "Makefile").read_text(encoding="utf-8")
    script = (ROOT / ".ci/run").read_text(encoding="utf-8")
    called = re.findall(r'^ *(?:[\d*]\) )?(?:"\$\{bare\[@\]\}" )?make (\S+)', script, re.M)

    assert {"demo", "test", "test-machines", "test-slow"} <= set(called)
    assert called.index("test") < called.index("test-slow")
    assert "-m 'not slow' tests\n" in recipes
    assert "-m slow $(SLOW)\n" in recipes
    assert "SLOW ?= tests\n" in recipes
    assert {"test-demo", "test-accuracy", "test-lowest"} <= set(called)
    assert 'SLOW="tests --part $tenth/8"' in script
