"""Exchanges weighed in the branches that they change: the joints of these, and the score that a whole trace gives."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from limbed import limbed

from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.lower.branches import around
from psdmc.lower.search import Search
from psdmc.program.cost import SINGLE

LARGEST_MISS = 6.0
"""Operations of some 800."""

PARENTS = (-1, 0, 1, 0, 3, 4, 4)
"""A root with a limb of two joints, and a trunk that carries two limbs of one."""

TRIED = 40
"""Exchanges of which each is traced whole."""


@pytest.mark.parametrize(
    ("changed", "kept"),
    [
        ([2], (0, 1, 2)),
        ([1], (0, 1, 2)),
        ([6], (0, 3, 4, 6)),
        ([3], (0, 3, 4, 5)),
        ([1, 5], (0, 1, 2, 3, 4, 5)),
        ([0], (0, 1, 2)),
    ],
)
def test_a_limb_with_all_that_carries_it(changed: list[int], kept: tuple[int, ...]) -> None:
    frames = [SimpleNamespace(parent=parent) for parent in PARENTS]
    assert around(frames, changed) == kept  # type: ignore[arg-type]


@pytest.mark.parametrize("function", ["inverse_dynamics", "mass_matrix"])
def test_the_expected_score_is_that_of_the_whole(function: str) -> None:
    """Three exchanges in four to an operation, all to a few."""
    model = derive_model(limbed(2, "FR", [(1, "RRR", 2), (0, "RRRR", 2)]).mechanism(), expand=False)
    search, recipe = Search(model.mechanism, model.representative, model.theta_b), RECIPES[function]
    found = next(search.starts(search.geometry.feet[0]))
    told = [each for each in search._exchanges(found) if search.branches.changed(recipe, found, each)]
    expected = search._expected(recipe, SINGLE, found)
    step = max(1, len(told) // TRIED)

    missed = [abs(expected(each) - SINGLE.weight(search.cost(recipe, each))) for each in told[::step]]

    assert len(missed) >= TRIED / 2
    assert sum(miss > 1.0 for miss in missed) <= 0.25 * len(missed), sorted(missed)
    assert max(missed) <= LARGEST_MISS, sorted(missed)[-8:]
