"""The neutral position: Pinocchio's."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, bench
from wide_robots import KINDS, is_pinocchios, wide_robot

from psdmc.functions import DEFAULT, default_of
from psdmc.robot.joints import FREE


@pytest.mark.parametrize("name", KINDS)
def test_it_is_pinocchios(name: str) -> None:
    is_pinocchios("neutral", name, in_c=name == "free")


def test_a_chains_is_zero_and_takes_no_states() -> None:
    own = bench(ARM)
    found = own.robot.neutral()
    assert found.shape == (own.model.n,)
    assert not found.any()


def test_robots_that_need_it_have_it_without_asking() -> None:
    """And what moves on the manifold; chains' packages stay as they were."""
    assert default_of(bench(ARM).model.mechanism) == DEFAULT
    more = set(default_of(wide_robot("free").model.mechanism)) - set(DEFAULT)
    assert more == {"neutral", "integrate", "difference"}
    np.testing.assert_array_equal(wide_robot("free").compiled("neutral").neutral()[:7], FREE.neutral)
