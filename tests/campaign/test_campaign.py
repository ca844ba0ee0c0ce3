"""The short form of `make campaign`: some random robots of each style; and the campaign finds what is wrong."""

from __future__ import annotations

import math

import pytest
from campaign_measure import EXPANDED_JOINTS, failures, measured
from campaign_robots import LARGEST, STYLES, TILTS, random_robot
from campaign_run import outcome, report, summary

SEEDS = range(40)
STATES = 40


@pytest.mark.parametrize("seed", [seed for seed in SEEDS if len(random_robot(seed).joints) < EXPANDED_JOINTS])
def test_a_random_robot(seed: int) -> None:
    assert failures(measured(seed, STATES, lowered=False)) == {}


@pytest.mark.parametrize("seed", [453, 989])
def test_robots_that_the_campaign_found(seed: int) -> None:
    """989: a column of size 1e-9 as a pivot, E and P off by 5e-11."""
    assert failures(measured(seed, STATES, lowered=False)) == {}


def test_a_robot_whose_carriers_the_campaign_found_wrong(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """2035: 25 carriers by singular values where there are 24, and a PROGRAM off by 2.5e-10."""
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr("campaign_measure.WHAT_IS_COMPILED", ())
    assert failures(measured(2035, STATES, lowered=True)) == {}


def test_a_random_robot_lowered_and_compiled(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path))
    seed = next(seed for seed in SEEDS if len(random_robot(seed).joints) == 2)
    errors = measured(seed, STATES, lowered=True)
    assert failures(errors) == {}
    assert any("float32" in what for what in errors)


def test_robots_are_of_all_kinds() -> None:
    robots = [random_robot(seed) for seed in range(300)]
    assert {robot.style for robot in robots} == set(STYLES)
    assert {len(robot.joints) for robot in robots} == set(range(1, LARGEST + 1))
    tilts = [tilt for robot in robots for tilt in robot.tilts]
    assert min(tilts) < 10 * TILTS[0]
    assert max(tilts) > TILTS[1] / 10
    text = "".join(robot.text for robot in robots)
    assert all(f"type='{kind}'" in text for kind in ("revolute", "continuous", "prismatic", "fixed"))


def test_a_seed_is_a_robot() -> None:
    assert random_robot(7).text == random_robot(7).text != random_robot(8).text


def test_what_does_not_pass_is_named() -> None:
    errors = {"snap 0, E and P": 2e-11, "snap 0, C auto float32 inline": 1e-5, "snapped, E and P": math.nan}
    assert list(failures(errors)) == ["snap 0, E and P", "snapped, E and P"]


def test_what_psdmc_raises_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(seed: int, states: int, *, lowered: bool) -> dict[str, float]:
        raise ValueError("broken")

    good = outcome(3, 5, False)
    monkeypatch.setattr("campaign_run.measured", broken)
    result = summary([good, outcome(4, 5, False)], 5, 1.0)
    assert result["raised"] == {4: "ValueError: broken"}
    assert "seed 4 raised ValueError: broken" in report(result)
    assert result["worst"]["snap 0, base parameters"]["worst"][0][1] == 3
