"""On which scale `check` compares each output of a function that puts out several."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import psdmc
from psdmc.verification import functions
from psdmc.verification.check import CheckRow, check_model
from psdmc.verification.functions import TORQUE_LIMIT, _errors

FAST = Path(__file__).parents[1] / "fuzz" / "corpus" / "mjcf" / "ratio-of-thousands.xml"
"""A joint that turns 1,500 times as fast as another one slides: Pinocchio's values lose ten digits."""


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
    errors, _ = _errors(
        recipe, None, SimpleNamespace(has_mimic_joints=False, free=None), {}, np.zeros(0), 1e-9
    )
    return max(errors.values())


def test_a_small_output_is_not_hidden_behind_a_large_one():
    """Positions of a robot of 10 nm, beside rotations of one."""
    assert error_of(
        {"position": 1.1e-8, "rotation": 1.0}, {"position": 1e-8, "rotation": 1.0}
    ) == pytest.approx(0.1)


def test_what_is_rounding_is_compared_on_the_functions_scale():
    assert error_of({"dqd": 3e-15, "dq": 10.0}, {"dqd": -1e-15, "dq": 10.0}) == pytest.approx(4e-15 / 1e-3)


def test_an_output_that_should_be_rounding_and_is_not_is_seen():
    assert error_of({"dqd": 1e-12, "dq": 10.0}, {"dqd": 1e-15, "dq": 10.0}) > 9e-10


def row_of_the_fast_joint() -> CheckRow:
    rows = check_model(psdmc.derive(FAST))
    return next(row for row in rows if row.name == "derivatives of the centre of mass's acceleration")


def test_what_pinocchio_loses_by_rounded_rotations_is_no_error():
    found = row_of_the_fast_joint()

    assert TORQUE_LIMIT < found.error <= found.limit
    assert found.remark == "the limit is 10 times the rounding error of Pinocchio's values"


def test_an_error_is_not_judged_by_values_that_rounding_changes_too_much(monkeypatch: pytest.MonkeyPatch):
    kept = functions._rounding
    monkeypatch.setattr(
        functions, "_rounding", lambda *given: {name: 1e4 * x for name, x in kept(*given).items()}
    )

    found = row_of_the_fast_joint()

    assert found.limit is None
    assert found.remark == "not compared: rounding changes Pinocchio's values too much"


def test_more_than_pinocchio_loses_is_an_error(monkeypatch: pytest.MonkeyPatch):
    def off(*given: object) -> tuple[dict[str, float], dict[str, float]]:
        errors, scales = _errors(*given)
        return {name: error + 1e-6 for name, error in errors.items()}, scales

    monkeypatch.setattr(functions, "_errors", off)

    assert not row_of_the_fast_joint().passed


def test_values_that_are_no_numbers_are_an_error(monkeypatch: pytest.MonkeyPatch):
    def none(*given: object) -> tuple[dict[str, float], dict[str, float]]:
        errors, scales = _errors(*given)
        return errors | {list(errors)[-1]: np.nan}, scales

    monkeypatch.setattr(functions, "_errors", none)

    assert not row_of_the_fast_joint().passed
