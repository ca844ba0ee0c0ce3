"""Each thing that can be wrong with a log is found and named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.plant.spoiled import decimated
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot.load import load_robot

ROBOTS = Path(__file__).resolve().parents[3] / "examples" / "robots"
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

    assert (
        "effort (motor_torque) of joint elbow is not finite in 1 row(s), the first is row 18 of 3000"
        in message(arm, broken)
    )


def test_time_going_backwards_is_named_with_its_row(arm, log: Log):
    time = np.array(log.time)
    time[50] = time[48]

    assert "time goes backwards at row 51" in message(arm, replace(log, time=time))


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


@pytest.mark.parametrize("with_velocity", [True, False])
@pytest.mark.parametrize(("unit", "factor"), [("milli", 1e3), ("micro", 1e6), ("nano", 1e9)])
def test_a_wrong_unit_of_time_is_named_and_so_is_the_remedy(
    arm, log: Log, unit: str, factor: float, with_velocity: bool
):
    velocity = log.velocity if with_velocity else None

    with pytest.raises(InputError) as raised:
        checked(replace(log, time=factor * log.time, velocity=velocity), arm.model.chain, CUTOFF)

    assert f"time_s looks like {unit}seconds" in raised.value.message
    assert raised.value.hint == "write time_s in seconds"


def test_a_wrong_unit_of_time_is_told_from_real_slowness_by_the_velocity(arm, log: Log):
    slow = decimated(log, 250)

    assert "sampling at 1 Hz is too slow" in message(arm, slow)


def test_thirty_hertz_are_enough_where_the_cut_off_suits(arm, log: Log):
    slow = decimated(log, 8)

    assert len(checked(slow, arm.model.chain, 7.5)) == 375
    with pytest.raises(InputError) as raised:
        checked(slow, arm.model.chain, 8.0)
    assert "filter a plain log at 7.81 Hz or less: --cutoff" in (raised.value.hint or "")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("what", ["time", "position", "velocity", "effort"])
def test_what_is_no_number_is_refused_in_every_column(arm, log: Log, what: str, value: float):
    values = np.array(getattr(log, what))
    values[17, ...] = value

    text = message(arm, replace(log, **{what: values}))

    assert text.startswith(f"smooth: {what}")
    assert "the first is row 18 of 3000" in text


def test_a_sliding_column_for_a_turning_joint_is_refused(arm, log: Log):
    text = message(arm, replace(log, sliding=("elbow",)))

    assert "joint elbow: position_m.elbow, but it turns" in text


def test_many_faults_are_cut_short(arm):
    many = derive_model(load_robot(ROBOTS / "kr6.toml").chain)
    still = np.zeros((3000, many.n))
    log = Log("kr6", many.joint_names, np.arange(3000) / 250, still + 1000.0, None, still, "motor_torque")

    with pytest.raises(InputError) as raised:
        checked(log, many.chain, CUTOFF)

    assert raised.value.message.startswith("kr6: joint joint_1: position reaches 1000 rad")
    assert raised.value.message.endswith("and 5 more")


def test_steps_of_time_that_no_clock_has_are_refused_before_anything_overflows(arm, log: Log):
    time = np.array(log.time)
    time[100] = np.nextafter(time[99], 1.0)

    with np.errstate(all="raise"):
        assert "expected at least 1e-09 s" in message(arm, replace(log, time=time, velocity=None))


def test_a_position_that_flips_every_row_has_no_slope_and_is_no_division_by_zero(arm, log: Log):
    flips = np.where(np.arange(len(log)) % 2, 0.5, -0.5)[:, None] * np.ones(2)

    with np.errstate(all="raise"):
        checked(replace(log, position=flips), arm.model.chain, CUTOFF)


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
