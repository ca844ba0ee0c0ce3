"""On which scale `check` compares each output of a function that puts out several."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from psdmc.verification.functions import _error


def error_of(found: dict[str, float], expected: dict[str, float]) -> float:
    """Of a function whose outputs are one number each, by name."""
    recipe = SimpleNamespace(
        pinocchio=lambda robot, given: {name: np.array(value) for name, value in expected.items()},
        reference=lambda robot, given: {name: np.array(value) for name, value in found.items()},
        times_theta=False,
        gradient=None,
        beside=None,
        packs=None,
    )
    return _error(recipe, None, SimpleNamespace(follows=False, free=None), {}, np.zeros(0), 1e-9)


def test_a_small_output_is_not_hidden_behind_a_large_one():
    """Positions of a robot of 10 nm, beside rotations of one."""
    assert error_of(
        {"position": 1.1e-8, "rotation": 1.0}, {"position": 1e-8, "rotation": 1.0}
    ) == pytest.approx(0.1)


def test_what_is_rounding_is_compared_on_the_functions_scale():
    assert error_of({"dqd": 3e-15, "dq": 10.0}, {"dqd": -1e-15, "dq": 10.0}) == pytest.approx(4e-15 / 1e-3)


def test_an_output_that_should_be_rounding_and_is_not_is_seen():
    assert error_of({"dqd": 1e-12, "dq": 10.0}, {"dqd": 1e-15, "dq": 10.0}) > 9e-10
