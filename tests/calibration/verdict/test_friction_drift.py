"""Friction that changes over a log, as of a robot that warms up: found, sized, and left out with --warm."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import status
from scipy import signal
from worn_arm import COULOMB, VISCOUS, Worn, recorded

from psdmc.calibration.identify.linear_fit import calibrate_linear
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.log_information import FrictionDrift, friction_drift
from psdmc.calibration.logs.log import Log, StoredLog, without_start
from psdmc.calibration.logs.log_files import open_log, read_log, write_log
from psdmc.errors import InputError
from psdmc.model.store import save

GOOD = 12
WARMING = 8.0
"""s, after which the friction that is added has fallen to 1/e."""


@pytest.fixture(scope="module")
def folder(arm, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The arm's model, logs of constant friction, and logs of an arm that is cold at first."""
    path = tmp_path_factory.mktemp("warm")
    save(arm.model, path / "arm.npz")
    for k in range(GOOD):
        recorded(path, f"good{k}", Worn(seed=k, seconds=40.0), arm.folder / "two_link.toml")
    for k, share in enumerate((0.5, 0.25)):
        log = read_log(path / f"good{k}.csv")
        effort = log.effort + share * cold(log)
        write_log(replace(log, name=f"cold{k}", effort=effort), path / f"cold{k}.csv")
    return path


def cold(log: Log) -> np.ndarray:
    """The shoulder's viscous friction once more, falling as it warms up."""
    qd = np.gradient(log.position[:, 0], log.time)
    return np.column_stack([VISCOUS[0] * qd * np.exp(-log.time / WARMING), np.zeros(len(qd))])


def drifts(arm, *logs: Log, **how: int) -> dict[tuple[str, str], FrictionDrift]:
    chain, options = arm.model.mechanism, LinearOptions(**how)
    found = calibrate_linear(chain, arm.regressor, arm.model.l, logs, options, theta_b=arm.model.theta_b)
    each = friction_drift(found.problem, found.estimate, [log.name for log in logs])
    return {(one.log, one.joint): one for one in each}


def test_constant_friction_raises_no_alarm(arm, folder: Path):
    off = []
    for k in range(GOOD):
        for one in drifts(arm, read_log(folder / f"good{k}.csv")).values():
            assert not one.shown
            off.append(one.change / one.std)
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.6


def test_lasting_noise_is_no_drift(arm, folder: Path):
    for k in range(GOOD):
        log = read_log(folder / f"good{k}.csv")
        white = np.random.default_rng(k).standard_normal(log.effort.shape)
        log = replace(log, effort=log.effort + signal.lfilter([0.2], [1.0, -0.98], white, axis=0))
        assert [one for one in drifts(arm, log).values() if one.shown] == []


@pytest.mark.parametrize("k", [0, 1])
def test_a_cold_joint_is_named(arm, folder: Path, k: int):
    log = read_log(folder / f"cold{k}.csv")

    found = drifts(arm, log)

    assert [joint for (_, joint), one in found.items() if one.shown] == ["shoulder"]
    assert found[log.name, "shoulder"].change < 0.0


@pytest.mark.parametrize("rate", [0.4, -0.8])
def test_the_size_is_that_of_the_torque_that_was_added(arm, folder: Path, rate: float):
    """The elbow's viscous friction changes by `rate` N m s/rad, and its Coulomb friction by half of that in N m."""
    for k in range(GOOD):
        log = read_log(folder / f"good{k}.csv")
        speed, turn = np.gradient(log.position[:, 1], log.time), log.time / log.time[-1]
        added = rate * turn * (speed + 0.5 * np.tanh(speed / 0.03))
        log = replace(log, effort=log.effort + np.column_stack([np.zeros(len(turn)), added]))

        found = drifts(arm, log)

        one = found[log.name, "elbow"]
        assert one.seconds == pytest.approx(0.7 * 40.0, rel=0.05)
        fitted = log.time < log.time[0] + one.seconds
        size = np.mean(np.abs(speed[fitted]))
        true = rate * 0.7 * (size + 0.5 * np.mean(np.abs(np.tanh(speed[fitted] / 0.03))))
        assert [joint for (_, joint), each in found.items() if each.shown] == ["elbow"]
        assert one.change == pytest.approx(true, rel=0.06)  # the filter rounds the sign
        friction = COULOMB[1] + VISCOUS[1] * size + 0.5 * true
        assert one.share == pytest.approx(true / friction, rel=0.1)


def test_rows_on_disk_and_many_logs_say_the_same(arm, folder: Path):
    logs = [read_log(folder / f"{name}.csv") for name in ("good2", "cold0", "good3")]
    kept, read = drifts(arm, *logs), drifts(arm, *logs, held_bytes=1000)

    assert kept == read
    assert [key for key, one in kept.items() if one.shown] == [("cold0.csv", "shoulder")]


def test_the_command_says_it_and_warm_mends_it(folder: Path, capsys: pytest.CaptureFixture[str]):
    words = ("calibrate", folder / "arm.npz", folder / "cold0.csv", "-o", folder / "out.npz")

    assert status(*words, "--report", folder / "o.html") == 0

    line = next(line for line in capsys.readouterr().out.splitlines() if "friction changes" in line)
    assert "fitted of cold0.csv: joint shoulder by -" in line
    assert line.endswith("or leave out the first part by --warm SECONDS")
    numbers = json.loads((folder / "o.json").read_text(encoding="utf-8"))
    assert "friction_drifts" in numbers["verdict"]["codes"]["doubts"]
    assert [each["shown"] for each in numbers["facts"]["friction_drift"]] == [True, False]
    assert "Change of friction over each log" in (folder / "o.html").read_text(encoding="utf-8")
    assert status(*words, "--warm", 20, "--report", folder / "o.html") == 0
    assert "friction changes" not in capsys.readouterr().out
    numbers = json.loads((folder / "o.json").read_text(encoding="utf-8"))
    assert numbers["facts"]["data"][0]["rows"] == 2000


def test_leaving_out_all_is_refused(folder: Path):
    log = read_log(folder / "good0.csv")
    with pytest.raises(InputError, match=r"no rows after the first 60 s: it lasts 39\.99 s"):
        without_start(log, 60.0)


def test_a_log_on_disk_loses_the_same_rows(folder: Path):
    held = read_log(folder / "good0.csv")
    on_disk = open_log(folder / "good0.csv", held=1000)
    assert isinstance(on_disk, StoredLog)

    left, read = without_start(held, 7.0), without_start(without_start(on_disk, 3.0), 4.0)

    assert np.array_equal(left.time, read.time)
    assert len(left) == 3300
    assert np.array_equal(left.rows(5, 900).position, read.rows(5, 900).position)
    assert np.array_equal(left.rows(5, 900).effort, read.rows(5, 900).effort)
