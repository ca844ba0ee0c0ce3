"""Efforts that are cut off, and efforts that come late: refused, where the same log as recorded is accepted."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from calibration.conftest import smooth_log
from scipy.interpolate import CubicSpline
from test_verdict import verdict_on

import psdmc
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.logs.log_survey import Saturated, surveyed
from psdmc.calibration.plant.spoiled import clipped, late
from psdmc.calibration.verdict.findings import Findings
from psdmc.calibration.verdict.judge import doubts
from psdmc.model.grounds import Delay
from psdmc.model.store import save


def saturated(log: Log) -> tuple[Saturated, ...]:
    return surveyed(log, CheckOptions().saturated_share).saturated


def later(log: Log, seconds: float) -> Log:
    """The log whose effort comes so many seconds late, by a cubic between its rows."""
    curve = CubicSpline(log.time, log.effort)
    inside = (log.time > log.time[0] + abs(seconds)) & (log.time < log.time[-1] - abs(seconds))
    found = log.at(inside)
    return replace(found, effort=curve(found.time - seconds))


def test_torque_clipped_at_forty_per_cent_of_its_peak_is_refused(arm, plant_log):
    found = verdict_on(arm, clipped(plant_log, 0.4))

    assert not found.usable
    assert re.fullmatch(
        r"the effort is cut off at a limit: joint shoulder at -?[\d.]+ N m in \d+%, elbow at -?[\d.]+ N m in \d+% of the "
        r"rows in which it moves: record slower motions or smaller loads, or raise the limit of the drive or the sensor",
        found.reasons[0],
    )


def test_torque_that_comes_25_rows_late_is_refused_with_the_delay(arm, plant_log):
    """The plant's own delay of 1 ms, and what its bristles add to it, are in both."""
    as_recorded = verdict_on(arm, plant_log)
    found = verdict_on(arm, late(plant_log, 25))

    (delay,), (own,) = found.delays, as_recorded.delays
    assert as_recorded.usable
    assert not any("is logged" in line for line in as_recorded.lines())
    assert not found.usable
    assert found.reasons[0] == (
        f"plant: the torque is logged {delay.words} than the motion it belongs to: set `delay = {delay.size}` of [effort] "
        "in a log description (psdmc calibrate --describe), or add it to the delay there"
    )
    assert delay.value - own.value == pytest.approx(0.25, abs=3 * np.hypot(delay.std, own.std))
    assert delay.std < 0.01
    assert [delay.log for delay in found.delays] == ["plant"]
    assert found.against[0].code == "late"


def test_the_delay_it_names_written_into_a_description_makes_the_log_usable(arm, tmp_path: Path):
    log = smooth_log(arm)
    save(arm.model, tmp_path / "arm.npz")
    write_log(late(log, 25), tmp_path / "late.csv")
    refused = psdmc.calibrate(tmp_path / "arm.npz", tmp_path / "late.csv")
    assert refused.verdict is not None
    (typed,) = re.findall(r"set `(delay = .*?)` of \[effort\]", refused.verdict.reasons[0])
    text = f'[[log]]\nfile = "late.csv"\n[effort]\n{typed}\n'
    (tmp_path / "log.toml").write_text(text, encoding="utf-8")

    mended = psdmc.calibrate(tmp_path / "arm.npz", tmp_path / "log.toml")

    assert not refused.verdict.usable
    assert mended.verdict is not None
    assert mended.verdict.usable
    assert abs(mended.verdict.delays[0].value) < 1e-3


@pytest.mark.parametrize("seconds", [-0.1, -0.0016, 0.0, 0.0016, 0.1])
def test_the_delay_is_found_to_parts_of_a_row_either_way(arm, seconds: float):
    """Rows are 4 ms apart, and the friction is the fit's own."""
    found = verdict_on(arm, later(smooth_log(arm), seconds))

    (delay,) = found.delays
    assert delay.value == pytest.approx(seconds, abs=max(3 * delay.std, 1e-4))
    assert delay.std < 1e-3
    assert found.usable == (abs(seconds) < 0.01)
    if seconds < -0.01:
        assert re.search(
            r" s earlier than the motion it belongs to: set `delay = 0\.\d+` of \[position\] and \[velocity\]",
            found.reasons[0],
        )


def test_delays_are_each_logs_own_whatever_its_rate(arm):
    from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs

    logs = [
        replace(smooth_log(arm, 16.0, rate, seed=seed), name=name)
        for seed, (name, rate) in enumerate((("slow", 100.0), ("fast", 500.0)))
    ]
    logs[1] = late(logs[1], 25)

    record = calibrate_logs(arm.model, logs, CalibrateOptions(), arm.regressor, None, lambda step: None)

    assert record.verdict is not None
    first, second = record.verdict.delays
    assert (first.log, second.log) == ("slow", "fast")
    assert first.value == pytest.approx(0.0, abs=1e-3)
    assert second.value == pytest.approx(0.05, abs=1e-3)
    assert [reason for reason in record.verdict.reasons if "slow" in reason] == []


def test_a_low_pass_on_the_torque_alone_counts_as_its_delay(arm):
    """A first-order lag T delays a frequency w by atan(w T) / w: by T = 40 ms at low ones, by half of it at 9 Hz, which the
    filter's 8 Hz hardly pass."""
    log = smooth_log(arm)
    rate, lagged = log.period / 0.04, np.array(log.effort)
    for row in range(1, len(lagged)):
        lagged[row] = lagged[row - 1] + rate * (log.effort[row] - lagged[row - 1])

    found = verdict_on(arm, replace(log, effort=lagged))

    assert not found.usable
    assert 0.02 < found.delays[0].value < 0.04


@pytest.mark.parametrize("step", [1e-3, 0.05, 0.5, 3.0])
def test_currents_in_whole_steps_do_not_saturate(arm, step: float):
    log = smooth_log(arm, noise=0.0)

    assert saturated(replace(log, effort=step * np.round(log.effort / step))) == ()


def test_a_sine_in_whole_steps_does_not_saturate(arm):
    """Of all smooth curves it stays longest at its extremes."""
    log = smooth_log(arm)
    for step in (0.01, 0.02, 0.04, 0.1, 0.3):
        wave = np.sin(2 * np.pi * 0.3 * log.time)[:, None] * np.ones(2)
        assert saturated(replace(log, effort=step * np.round(wave / step))) == ()


def test_an_arm_that_stands_holds_one_torque_and_does_not_saturate(arm):
    log = smooth_log(arm, noise=0.0)
    rows = int(np.argmax(log.effort[:, 0]))
    order = np.concatenate([np.arange(rows), np.full(2000, rows), np.arange(rows, len(log))])
    position, effort = log.position[order], log.effort[order]
    time = np.arange(len(order)) * log.period

    assert saturated(replace(log, time=time, position=position, velocity=None, effort=effort)) == ()


def test_what_friction_of_one_size_would_look_like_is_only_a_doubt(arm):
    log = smooth_log(arm)
    speed = log.velocity
    assert speed is not None

    found = saturated(replace(log, effort=np.clip(1.2 * np.tanh(speed / 0.1), -1.0, 1.0)))

    assert [each.certain for each in found] == [False, False]


def test_one_side_is_enough(arm):
    log = smooth_log(arm)
    cut = np.minimum(log.effort, 0.3 * log.effort.max(axis=0))

    found = saturated(replace(log, effort=cut))

    assert [(each.joint, each.certain) for each in found] == [("shoulder", True), ("elbow", True)]
    assert [each.level for each in found] == pytest.approx(0.3 * log.effort.max(axis=0))


def test_what_friction_alone_explains_is_a_doubt_that_says_what_to_check():
    """A level whose unit is not known has none."""
    piled = Saturated("J2", 12.1, 0.08, False), Saturated("J3", 3.0, 0.05, False, "N")
    found = SimpleNamespace(evidence=SimpleNamespace(saturated=piled), record=SimpleNamespace(facts={}))
    assert next(doubts(cast("Findings", found))).words == (
        "the effort may be cut off at a limit, or this may be friction alone: joint J2 at 12.1 in 8%, J3 at 3 N in 5% of "
        "its moving rows: if the drive or sensor has that limit, record again with slower motions"
    )


def test_a_delay_in_words_has_the_digits_of_its_deviation():
    assert Delay("a", 0.20208, 0.0034, True).words == "0.2021 +- 0.0034 s later"
    assert Delay("a", -0.1, 0.02, True).words == "0.100 +- 0.020 s earlier"
    assert Delay("a", 0.5, np.inf, True).words == "0.5 s or more later"
