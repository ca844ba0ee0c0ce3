"""Searches that one lowering leaves to the next: the same PROGRAMs as a lowering that searches itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model

from psdmc.lower import kernels
from psdmc.lower.kernels import lower
from psdmc.lower.search import Search
from psdmc.program.text import show

FUNCTION = "forward_dynamics"


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The functions whose arrangement is searched; no lowering before has left anything."""
    found: list[str] = []
    best = Search.best

    def noted(self, recipe, *rest):
        found.append(recipe.name)
        return best(self, recipe, *rest)

    monkeypatch.setattr(Search, "best", noted)
    kernels._last.clear()
    return found


def programs(model, *names: str) -> list[str]:
    found = lower(model, functions=names)
    return [show(part) for name in names for part in (found[name].single, found[name].batch)]


def test_the_next_lowering_of_a_model_searches_nothing_again(searched: list[str]):
    model = bundled_model("scara")
    alone = programs(model, FUNCTION)
    first = list(searched)
    assert first

    again = programs(replace(model), FUNCTION)

    assert searched == first
    assert again == alone


def test_what_other_functions_left_changes_nothing(searched: list[str]):
    model = bundled_model("scara")
    alone = programs(model, FUNCTION)
    kernels._last.clear()
    programs(model, "inverse_dynamics", "mass_matrix", "regressor")

    assert programs(model, FUNCTION) == alone


def test_another_model_or_another_theta_b_is_searched_anew(searched: list[str]):
    model = bundled_model("scara")
    programs(model, FUNCTION)
    first = len(searched)
    other = replace(model, theta_b=np.where(np.arange(model.l) == 0, 0.0, model.theta_b))

    changed = programs(other, FUNCTION)
    assert len(searched) == 2 * first
    kernels._last.clear()
    assert programs(other, FUNCTION) == changed
    programs(model, FUNCTION)
    assert len(searched) == 4 * first
    assert len(kernels._last) == 1
