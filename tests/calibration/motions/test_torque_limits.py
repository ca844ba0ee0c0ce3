"""Planned motions keep torque limits by Pinocchio's reckoning, and the search finds others where these are tight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arms import pinocchio_of, torques, urdf

from psdmc.calibration.campaign_plan import CampaignOptions, plan_campaign
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.motions.allowed import GivenLimits
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions
from psdmc.compiler import derive
from psdmc.errors import InputError

EFFORT = 50.0
OPTIONS = CampaignOptions(
    sweep=SweepOptions(seconds=15.0, period=4e-3),
    sines=SineOptions(smallest=1e-2, ratio=4.0, period=4e-3),
    excite=ExciteOptions(duration=4.0, samples=50, evaluations=100, random=20, torque_margin=0.5),
    load=Load(2.0, (0.0, 0.05, 0.4)),
    limits=GivenLimits(acceleration=12.0),
    gravity_runs=1,
    repeats=1,
)


def planned(folder: Path, options: CampaignOptions, effort: float = EFFORT):
    file = folder / "crane.urdf"
    file.write_text(urdf(effort, shapes=False), encoding="utf-8")
    model = derive(file)
    return plan_campaign(model, ChainRegressor(model), options)


def test_all_runs_keep_their_share_of_the_torque_limits(tmp_path: Path):
    bare = replace(OPTIONS, excite=replace(OPTIONS.excite, torque_margin=1.0))
    robot, _ = pinocchio_of(tmp_path, urdf(1e6))

    free, kept = planned(tmp_path, bare, 1e6), planned(tmp_path, OPTIONS)

    def largest(plan) -> float:
        return max(np.abs(torques(robot, x.motion.q, x.motion.qd, x.motion.qdd)).max() for x in plan.runs)

    assert largest(kept) <= 0.5 * EFFORT
    assert largest(free) > 0.5 * EFFORT
    assert largest(kept) > 0.4 * EFFORT
    assert any("at most 50% of the limits" in line for line in kept.looked)


def test_an_arm_that_cannot_carry_itself_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"no .* is allowed.*lift: torque .* beyond 50% of 2"):
        planned(tmp_path, replace(OPTIONS, load=None), 2.0)


def test_the_weight_of_the_load_counts(tmp_path: Path):
    """30 kg: what the arm alone may do it may not do with the load."""
    with pytest.raises(InputError, match=r"no motor sweep of joint 'lift' is allowed.*torque"):
        planned(tmp_path, replace(OPTIONS, load=Load(30.0, (0.0, 0.05, 0.4))))


def test_unknown_parameters_and_limits_are_said(tmp_path: Path):
    one = replace(OPTIONS, one_log=True)
    file = tmp_path / "crane.urdf"
    file.write_text(urdf(0.0, shapes=False), encoding="utf-8")
    model = derive(file)

    without_limits = plan_campaign(model, ChainRegressor(model), one)
    given = replace(one, limits=GivenLimits(acceleration=12.0, efforts={"lift": 70.0}))
    partly = plan_campaign(model, ChainRegressor(model), given)
    unknown = plan_campaign(replace(model, theta_b=None), ChainRegressor(model), given)

    assert "not checked: torques, no joint has an effort limit (--effort JOINT=NM)" in without_limits.looked
    assert any("'turn', 'bend' have no limit" in line for line in partly.looked)
    assert "not checked: torques, theta_b is unknown" in unknown.looked
