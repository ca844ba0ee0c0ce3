"""Faults planted in good logs are refused, named or harmless: docs/planted_faults.py, a few kinds of it on a small arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from slow_cases import slow_but_for

DOCS = Path(__file__).resolve().parents[3] / "docs"
KINDS = (
    "two joints swapped",
    "efforts of two joints swapped",
    "one joint of another robot",
    "effort clock drifts by 0.4 %",
    "ten gaps of 0.4 s interpolated",
    "torque in steps of 5 % of its range",
    "reduction ratio 10 % wrong",
    "zero position off by 2 degrees",
    "gravity tilted by 5 degrees",
    "tool forgotten",
    "torque of one joint negated",
    "torque of one joint 30 % too large",
    "positions in degrees",
    "torques in mN m",
    "torque 0.1 s late",
    "noise of 20 % on the torques",
    "torque cut off at 60 % of its peak",
    "encoder stuck for 2 s",
    "time goes back by 1 s",
)
REMAINING = {"one joint of another robot": "doubt"}
"""Of this arm: only the low R^2 is said, not its cause."""
QUICK = ("torque of one joint 30 % too large", "encoder stuck for 2 s")


@pytest.fixture(scope="module")
def planted():
    """The module of the campaign, the arm, its good calibration and the errors of that on held-out samples."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS))
        import planted_faults

        robot = planted_faults.two_link()
        base = planted_faults.calibrated(robot.model, robot.log)
        assert base.record is not None
        assert not base.refused
        yield planted_faults, robot, base, planted_faults.held_out_rmse(base.record, robot.log)


def test_every_kind_of_the_campaign_is_tried_here(planted):
    assert tuple(planted[0].FAULTS) == KINDS


@pytest.mark.parametrize("kind", slow_but_for(QUICK, KINDS))
def test_a_fault_is_refused_or_named_or_harmless(planted, kind: str):
    campaign, robot, base, good = planted

    word = campaign.tried(robot, kind, base, good)[0]

    assert word in ("refused", "named", "harmless", REMAINING.get(kind))


@pytest.mark.slow
def test_a_tilted_base_of_six_joints_is_named_with_its_angle(planted):
    campaign = planted[0]
    robot = campaign.virtual_denso(planted[1].log)

    found = campaign.planted(robot, campaign.TILTED)

    assert found.record is not None
    said = [ground for ground in found.record.verdict.doubted if ground.code == "log_error"]
    tilt = next(item for item in said[0].values["items"] if item["kind"] == "tilt")
    assert abs(tilt["value"] - np.radians(5.0)) < 3.0 * tilt["std"]


@pytest.mark.slow
def test_faults_of_motor_positions_are_refused_or_harmless(planted):
    campaign = planted[0]
    robot = campaign.elastic()
    base = campaign.calibrated(robot.model, robot.log)

    assert set(campaign.stiffness(base.record)) == {"shoulder", "elbow"}
    words = {fault: campaign.tried(robot, fault, base, None)[0] for fault in robot.faults}

    assert words.pop("gear ratio of the motor position 1 % wrong") == "harmless"
    assert set(words.values()) == {"refused"}
