"""Filtering: no phase, exact differences, honest counting of independent samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from psdmc.calibration.logs.filter import SplitOptions, central_differences, filtered, held_out, thinned
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.low_pass import FilterOptions, LowPass
from psdmc.errors import InputError

PERIOD = 1e-3
TIME = np.arange(4000) * PERIOD


def test_a_sine_below_the_cut_off_keeps_size_and_phase():
    sine = np.sin(2 * np.pi * 3.0 * TIME)

    smooth = LowPass.design(FilterOptions(cutoff=15.0), PERIOD)(sine)

    assert np.abs(smooth - sine)[500:-500].max() < 1e-6


def test_a_sine_at_twice_the_cut_off_is_gone():
    sine = np.sin(2 * np.pi * 30.0 * TIME)

    smooth = LowPass.design(FilterOptions(cutoff=15.0), PERIOD)(sine)

    # 8th order, both ways; the bilinear transform bends the frequency axis by the tangent
    ratio = np.tan(np.pi * 30.0 * PERIOD) / np.tan(np.pi * 15.0 * PERIOD)
    assert np.abs(smooth)[1500:-1500].max() == pytest.approx(1 / (1 + ratio**16), rel=0.02)


@pytest.mark.parametrize("shape", [(4000,), (900, 2), (300, 2, 3), (40, 2), (2,), (1,)])
def test_it_is_scipys_filter_there_and_back_bit_for_bit(shape: tuple[int, ...]):
    """Logs shorter than the extension at either end too."""
    low_pass = LowPass.design(FilterOptions(cutoff=15.0), PERIOD)
    values = np.random.default_rng(2).normal(3.0, 1.0, shape)
    extended = min(len(values) - 1, 24 * (2 * len(low_pass.sections) + 1))

    expected = signal.sosfiltfilt(low_pass.sections, values, axis=0, padlen=extended)

    assert np.array_equal(low_pass(values), expected)


def test_central_differences_of_a_parabola_are_exact():
    q = (0.5 * TIME**2 - 2 * TIME)[:, None]

    qd, qdd = central_differences(q, PERIOD)

    assert np.abs(qd[1:-1, 0] - (TIME[1:-1] - 2)).max() < 1e-9
    assert np.abs(qdd[1:-1, 0] - 1.0).max() < 1e-6


def test_jittered_times_are_resampled(log: Log):
    rng = np.random.default_rng(1)
    time = log.time + 0.3 * log.period * rng.uniform(-1, 1, len(log))
    q = np.stack([np.sin(time), np.cos(time)], axis=1)

    states = filtered(replace(log, time=time, position=q, velocity=None), FilterOptions(cutoff=5.0))

    assert np.ptp(np.diff(states.time)) < 1e-12
    inside = states.use
    # unresampled, 0.3 of a 4 ms period at 1 rad/s would be 1.2e-3 off
    assert np.abs(states.q[inside, 0] - np.sin(states.time[inside] + time[0])).max() < 1e-5


def test_a_resting_joint_excites_nothing(log: Log):
    position = np.array(log.position)
    position[:, 1] = 0.3 + 1e-7 * np.random.default_rng(2).standard_normal(len(log))

    states = filtered(replace(log, position=position, velocity=None), FilterOptions())

    assert not states.qd[:, 1].any()
    assert not states.qdd[:, 1].any()
    assert states.qd[:, 0].any()


@pytest.mark.parametrize("blocks", [0, 20, 40])
def test_the_wanted_share_is_held_out(blocks: int):
    out = held_out(2000, SplitOptions(held_out=0.15, blocks=blocks))

    assert out.mean() == pytest.approx(0.15, abs=0.01)
    if blocks == 0:
        assert out[-300:].all()
        assert not out[:1700].any()


def test_independent_samples_are_half_a_cut_off_period_apart(log: Log):
    states = filtered(log, FilterOptions(cutoff=12.5))

    assert set(np.diff(thinned(states, FilterOptions(cutoff=12.5)))) == {10}  # 250 Hz / (2 * 12.5 Hz)


def test_a_log_shorter_than_the_filter_is_refused(log: Log):
    with pytest.raises(InputError, match="leave nothing after"):
        filtered(log.between(0.0, 0.3), FilterOptions(cutoff=15.0))
