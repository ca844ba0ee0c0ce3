"""`make demo`'s last table: every function, its error against Pinocchio, and a plain word where nothing could be timed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from bundled import bundled_model
from unoptimised import without_optimisation

from psdmc.bench import demo
from psdmc.bench.rivals import psdmc_c
from psdmc.compiler import compile
from psdmc.functions import RECIPES

FUNCTIONS = tuple(name for name in psdmc_c.FUNCTIONS if not RECIPES[name].times_theta)


def test_errors_are_those_of_rounding():
    model = bundled_model("scara")

    with without_optimisation():
        found = demo.errors_against_pinocchio(model, compile(model, "factored", FUNCTIONS), FUNCTIONS)

    assert tuple(found) == FUNCTIONS
    assert max(found.values()) < 1e-9
    assert found["inverse_dynamics"] < 1e-12


@pytest.mark.slow
def test_the_table_without_a_cpp_compiler(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("CXX", "no-such-compiler")
    monkeypatch.setattr(demo, "SETTINGS", replace(demo.SETTINGS, rounds=1))
    said: list[str] = []

    with without_optimisation():
        text = demo.demo(bundled_model("two_link"), said.append)

    assert "p = 10 monomials, l = 4 base parameters" in text
    for name in FUNCTIONS:
        assert name.replace("_", " ") in text
    assert "not measured: Pinocchio: no C++ compiler found" in text
    assert said
