"""The verdict on logs of a virtual arm, good ones and such as were made wrong: what a user must be told first."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import psdmc
from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.physical import NotPhysical
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.plant.spoiled import ALL, MOVED, decimated, noise_only, scaled, swapped, turned
from psdmc.model.calibrated import NOT_USABLE_STATUS, Verdict
from psdmc.model.grounds import listed

CONSTANTS = (12.0, 5.0)

WRONG = {
    "negated": (lambda log: scaled(log, -1.0), "the effort of every joint has the opposite sign"),
    "kN m": (lambda log: scaled(log, 1e-3), "kN m"),
    "mN m": (lambda log: scaled(log, 1e3), "mN m"),
    "amperes": (lambda log: scaled(log, 1.0 / np.array(CONSTANTS)), "amperes in an effort column"),
    "effort turned": (lambda log: turned(log, 1, ["effort"]), "effort of elbow has the opposite sign"),
    "position turned": (lambda log: turned(log, 0, MOVED), "position of shoulder has the opposite sign"),
    "joint turned": (
        lambda log: turned(log, 0, ALL),
        "position and effort of shoulder have the opposite sign",
    ),
    "efforts swapped": (
        lambda log: swapped(log, 0, 1, ["effort"]),
        "shoulder and elbow look swapped (effort)",
    ),
    "positions swapped": (
        lambda log: swapped(log, 0, 1, MOVED),
        "shoulder and elbow look swapped (position)",
    ),
    "joints swapped": (
        lambda log: swapped(log, 0, 1, ALL),
        "shoulder and elbow look swapped (position and effort)",
    ),
}


def verdict_on(arm, log: Log, known: bool = True) -> Verdict:
    model = arm.model if known else arm.unknown
    record = calibrate_logs(model, [log], CalibrateOptions(), arm.regressor, None, lambda step: None)
    assert record.verdict is not None
    return record.verdict


@pytest.mark.parametrize("known", [True, False])
def test_a_good_log_is_usable(arm, plant_log, known: bool):
    found = verdict_on(arm, plant_log, known)

    assert found.usable
    assert found.exit_status == 0
    assert found.reasons == ()
    assert found.suspects == ()
    assert found.lines()[0] in ("verdict: usable", "verdict: usable, with doubts")


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_log_is_not_usable_and_the_cause_is_named(arm, plant_log, kind: str):
    spoil, words = WRONG[kind]

    found = verdict_on(arm, spoil(plant_log))

    assert found.word == "not usable"
    assert found.exit_status == NOT_USABLE_STATUS == 6
    assert any(words in suspect for suspect in found.suspects)


@pytest.mark.parametrize("kind", ["negated", "effort turned", "efforts swapped", "positions swapped"])
def test_the_same_without_parameters_in_the_file(arm, plant_log, kind: str):
    spoil, words = WRONG[kind]

    found = verdict_on(arm, spoil(plant_log), known=False)

    assert not found.usable
    assert any(words in suspect for suspect in found.suspects)


def test_noise_is_not_usable(arm, plant_log):
    for known in (True, False):
        found = verdict_on(arm, noise_only(plant_log), known)

        assert not found.usable
        assert found.suspects == ()


def test_a_fit_that_no_body_is_near_is_not_usable_and_says_so(arm, plant_log, monkeypatch):
    def fails(*_: object) -> None:
        raise NotPhysical("clarabel failed")

    monkeypatch.setattr(sys.modules["psdmc.calibration.calibrate"], "nearest_physical", fails)

    found = verdict_on(arm, plant_log)

    assert not found.usable
    assert found.reasons == ("no mass distribution of a real robot is near the fit (clarabel failed)",)


def test_too_few_samples_are_not_usable_however_good_the_fit(arm, plant_log):
    found = verdict_on(arm, plant_log.between(0.0, 3.5))

    assert not found.usable
    assert "independent samples for" in found.reasons[0]
    assert found.samples_per_unknown < 8.0


def test_rows_between_samples_are_no_new_samples(arm, plant_log):
    every, third = (verdict_on(arm, log) for log in (plant_log, decimated(plant_log, 3)))

    assert third.usable
    assert third.samples_per_unknown == pytest.approx(every.samples_per_unknown, rel=0.15)


def test_a_joint_that_hardly_moves_is_a_doubt(arm, plant_log):
    # the elbow rests: its torque holds and follows what the shoulder does
    still = replace(plant_log, position=plant_log.position * [1.0, 1e-3] + [0.0, 0.3])
    tau = arm.regressor.regressor(still.position, *_rates(still)) @ arm.model.theta_b
    qd = _rates(still)[0]
    log = replace(still, effort=tau + np.tanh(qd / 0.03) + qd)

    found = verdict_on(arm, log)

    assert found.usable
    assert any("elbow hardly move" in doubt for doubt in found.doubts)


def _rates(log: Log) -> tuple[np.ndarray, np.ndarray]:
    qd = np.gradient(log.position, log.period, axis=0)
    return qd, np.gradient(qd, log.period, axis=0)


def test_the_figures_are_those_of_the_record(arm, plant_log):
    record = calibrate_logs(
        arm.model, [plant_log], CalibrateOptions(), arm.regressor, None, lambda step: None
    )
    assert record.verdict is not None

    for joint in record.verdict.joints:
        both = record.steps[-1].joints[joint.joint]
        assert (joint.r2, joint.rmse) == (both.held_out.r2, both.held_out.rmse)
        assert joint.gain == pytest.approx(1.0, abs=0.05)
        assert joint.visible


def test_the_model_file_and_the_numbers_carry_the_verdict_first(arm, plant_log):
    record = calibrate_logs(
        arm.model, [plant_log], CalibrateOptions(), arm.regressor, None, lambda step: None
    )
    assert record.verdict is not None

    assert next(iter(record.as_json())) == "verdict"
    assert record.as_json()["verdict"]["verdict"] == record.verdict.word
    assert record.model.calibrated is not None
    assert record.model.calibrated.verdict == record.verdict


def test_python_says_the_same(arm, plant_log, tmp_path):
    good, bad = tmp_path / "good.csv", tmp_path / "bad.csv"
    write_log(plant_log, good)
    write_log(scaled(plant_log, -1.0), bad)

    assert psdmc.calibrate(arm.model, good).verdict.usable
    found = psdmc.calibrate(arm.model, bad)

    assert not found.verdict.usable
    assert found.verdict.suspects
    assert found.model.theta_b is not None


def test_the_package_of_that_name_stays_importable():
    from psdmc.calibration.logs.log import Log as imported

    assert imported is Log
    assert callable(psdmc.calibrate)


def test_names_are_listed():
    assert [listed(names) for names in ([], ["a"], ["a", "b"], ["a", "b", "c"])] == [
        "",
        "a",
        "a and b",
        "a, b and c",
    ]
