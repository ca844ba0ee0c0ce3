"""Each thing that can be wrong with a log is found and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from psdmc.calibrate.log import Log
from psdmc.calibrate.log_checks import checked
from psdmc.errors import InputError

CUTOFF = 15.0


def altered(values: np.ndarray, row: int, column: int, value: float) -> np.ndarray:
    copy = np.array(values)
    copy[row, column] = value
    return copy


def message(arm, log: Log) -> str:
    with pytest.raises(InputError) as raised:
        checked(log, arm.model.chain, CUTOFF)
    return raised.value.message


def test_a_good_log_passes_with_nothing_to_say(arm, log: Log):
    assert checked(log, arm.model.chain, CUTOFF).notes == ()


def test_nan_is_named_with_its_row(arm, log: Log):
    broken = replace(log, effort=altered(log.effort, 17, 1, np.nan))

    assert "effort is not finite in 1 row(s), the first is row 17" in message(arm, broken)


def test_time_going_backwards_is_named_with_its_row(arm, log: Log):
    time = np.array(log.time)
    time[50] = time[48]

    assert "time goes backwards at row 50" in message(arm, replace(log, time=time))


def test_a_gap_is_named_with_its_length(arm, log: Log):
    time = np.array(log.time)
    time[100:] += 0.5

    assert "1 gap(s): 0.504 s without a row" in message(arm, replace(log, time=time))


def test_too_short(arm, log: Log):
    assert "too short: 0.996 s" in message(arm, log.between(0.0, 0.999))


def test_sampling_too_slow_for_the_filter(arm, log: Log):
    rows = slice(None, None, 10)
    slow = replace(
        log,
        time=log.time[rows],
        position=log.position[rows],
        velocity=None,
        effort=log.effort[rows],
    )

    assert "25 Hz is too slow for a cut-off of 15 Hz, expected at least 60 Hz" in message(arm, slow)


def test_degrees_are_suspected(arm, log: Log):
    degrees = replace(log, position=np.degrees(log.position), velocity=None)

    text = message(arm, degrees)

    assert "joint shoulder: position reaches 51.5" in text
    assert "degrees?" in text


def test_velocity_in_degrees_is_suspected(arm, log: Log):
    assert log.velocity is not None

    text = message(arm, replace(log, velocity=np.degrees(log.velocity)))

    assert "joint elbow: velocity is 57.3 times the position's slope: degrees?" in text


def test_time_in_milliseconds_moves_too_slowly_to_sample(arm, log: Log):
    assert "too slow for a cut-off" in message(arm, replace(log, time=1e3 * log.time, velocity=None))


def test_a_log_where_nothing_moves(arm, log: Log):
    still = replace(log, position=np.zeros_like(log.position), velocity=None)

    assert "no joint moves" in message(arm, still)


def test_a_log_of_zeros(arm, log: Log):
    dead = replace(log, effort=np.zeros_like(log.effort))

    assert "motor_torque is zero throughout" in message(arm, dead)


def test_all_faults_are_told_at_once(arm, log: Log):
    dead = replace(log, effort=np.zeros_like(log.effort), position=np.degrees(log.position), velocity=None)

    text = message(arm, dead)

    assert "zero throughout" in text
    assert "degrees?" in text


def test_jitter_saturation_and_a_resting_joint_are_remarked_on(arm, log: Log):
    rng = np.random.default_rng(0)
    time = log.time + 0.2 * log.period * rng.uniform(-1, 1, len(log))
    effort = np.clip(log.effort, -6.0, 6.0)
    position = np.array(log.position)
    position[:, 1] = 0.3

    notes = " ".join(
        checked(
            replace(log, time=time, effort=effort, position=position, velocity=None), arm.model.chain, CUTOFF
        ).notes
    )

    assert "jitter" in notes
    assert "saturated?" in notes
    assert "joint(s) elbow stand still" in notes
