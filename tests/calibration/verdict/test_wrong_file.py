"""An odd gain of one joint: a wrong robot file does not make a log unusable, and a wrong scale of the log does.

The virtual arm's elbow carries less than its file says: the centre of mass is 50 mm from the axis, not 400 mm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from calibration.conftest import PLANT, ROBOT, Arm, plant_log_of

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.plant.spoiled import scaled
from psdmc.calibration.verdict.evidence import Evidence, Motion, evidence_of
from psdmc.calibration.verdict.log_errors import effort_scale
from psdmc.derivation.derive import derive_model
from psdmc.model.calibrated import Verdict
from psdmc.model.grounds import Ground
from psdmc.robot.load import load_robot

SHOULDER, ELBOW = 0, 1
SCALE = 0.023
"""Of an effort in the wrong unit: the inverse of a torque constant of 43 N m/A."""
RANGE = (0.2, 5.0)
"""Gains that a verdict accepts."""


def light_arm(folder: Path, com: float, drive: float = 0.1, inertia: float = 0.03) -> Arm:
    """An arm whose elbow has its centre of mass here, m along the link; its axis is at -0.3 m. The inertias of its drive and
    of its link are in kg m^2."""
    robot = ROBOT.replace("com = [-0.1, -0.01, 0.0]", f"com = [{com}, 0.0, 0.0]").replace(
        "mass = 2.0", "mass = 6.0"
    )
    robot = robot.replace("drive_inertia = 0.1", f"drive_inertia = {drive}").replace(
        "zz = 0.03", f"zz = {inertia}"
    )
    robot = robot.replace("xx = 0.01, yy = 0.03", f"xx = {inertia}, yy = {inertia}")
    (folder / "two_link.toml").write_text(robot, encoding="utf-8")
    (folder / "plant.toml").write_text(PLANT, encoding="utf-8")
    model = derive_model(load_robot(folder / "two_link.toml", drive_inertia=True).chain)
    return Arm(folder, folder / "plant.toml", model)


@pytest.fixture(scope="module")
def wrong(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    return light_arm(tmp_path_factory.mktemp("wrong"), 0.1)


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    return light_arm(tmp_path_factory.mktemp("right"), -0.25)


@pytest.fixture(scope="module")
def good_log(right: Arm) -> Log:
    return plant_log_of(right.plant)


def evidence(arm: Arm, log: Log) -> Evidence:
    return evidence_of(arm.model, arm.regressor, [Motion(log)], Motors.torques(2), FilterOptions(cutoff=8.0))


def verdict_on(arm: Arm, log: Log) -> Verdict:
    record = calibrate_logs(arm.model, [log], CalibrateOptions(), arm.regressor, None, lambda _: None)
    assert record.verdict is not None
    return record.verdict


def codes(grounds: Iterable[Ground]) -> list[str]:
    return [ground.code for ground in grounds]


def test_a_file_that_is_wrong_at_one_joint_is_a_doubt_that_names_the_joint(wrong, good_log):
    found = verdict_on(wrong, good_log)

    assert found.usable
    said = next(ground for ground in found.doubted if ground.code == "wrong_file")
    item = said.values["items"][0]
    assert item["joint"] == "elbow"
    assert item["gain"] < RANGE[0]
    assert abs(item["scale"] - 1.0) < 3.0 * item["scale_std"]
    assert "the robot file is wrong there, or lacks a load, but the unit of the log is right" in said.words


def test_with_the_right_file_the_same_log_has_no_doubt_about_gains(right, good_log):
    found = verdict_on(right, good_log)

    assert found.usable
    assert not {"wrong_file", "odd_gains"} & set(codes(found.doubted))


@pytest.mark.parametrize("file", ["right", "wrong"])
def test_an_effort_of_the_wrong_scale_is_refused(request, good_log, file: str):
    found = verdict_on(request.getfixturevalue(file), scaled(good_log, [1.0, SCALE]))

    assert not found.usable
    assert "wrong_gains" in codes(found.against)
    assert "wrong_file" not in codes(found.doubted)


def test_a_log_in_another_unit_is_refused_even_if_the_wrong_file_makes_one_gain_look_right(wrong, good_log):
    found = verdict_on(wrong, scaled(good_log, 10.0))

    assert not found.usable
    assert "wrong_gains" in codes(found.against)


@pytest.mark.parametrize("file", ["right", "wrong"])
@pytest.mark.parametrize("factor", [43.0, 100.0])
def test_an_effort_so_large_that_the_file_s_torque_is_hidden_beside_it_is_refused(
    request, good_log, file: str, factor: float
):
    found = verdict_on(request.getfixturevalue(file), scaled(good_log, [1.0, factor]))

    assert not found.joints[ELBOW].visible
    assert "wrong_gains" in codes(found.against)


def test_a_joint_whose_scale_nothing_shows_is_a_doubt_and_no_reason(tmp_path):
    """The elbow's mass is on its axis: friction is nearly all of its torque."""
    arm = light_arm(tmp_path, -0.3, 1e-3, 1e-3)

    found = verdict_on(arm, plant_log_of(arm.plant))

    said = next(ground for ground in found.doubted if ground.code == "unjudged_scale")
    assert found.usable
    assert [item["joint"] for item in said.values["items"]] == ["elbow"]
    assert "the scale of the effort of joint(s) elbow is not judged" in said.words


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_the_other_joint_shows_the_scale_of_an_effort(right, good_log, factor: float):
    # a file with no parameters at all: the scale follows from the log alone
    unknown = replace(right, model=right.unknown)

    found = effort_scale(evidence(unknown, scaled(good_log, [1.0, factor])), ELBOW, [SHOULDER], *RANGE)

    assert found is not None
    assert abs(found.value - factor) < 3.0 * found.std < factor


@pytest.mark.parametrize("factor", [SCALE, -1.0, 20.0])
def test_a_scale_outside_the_range_is_likelier_than_all_inside(right, good_log, factor: float):
    found = effort_scale(evidence(right, scaled(good_log, [1.0, factor])), ELBOW, [SHOULDER], *RANGE)

    assert found is not None
    assert min(found.over_less, found.over_more) < -10.0
