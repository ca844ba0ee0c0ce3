"""Filtered values at few rows, against SciPy's filter on all rows."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy import signal

from psdmc.calibration.logs.filter import filtered, thinned
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.low_pass import FilterOptions, LowPass
from psdmc.calibration.logs.smoothed_rows import BLOCK, Decays, smoothed_rows

# SciPy's own sections differ from exact ones by rounding over (1 - pole)^2, which is a million at 8 Hz and 1 kHz.
ROUNDING = 1e-12

FILTERS = [
    (8, 8.0, 1000.0),
    (8, 15.0, 125.0),
    (7, 8.0, 1000.0),
    (1, 20.0, 500.0),
    (2, 40.0, 100.0),
    (8, 45.0, 100.0),
    (1, 25.0, 100.0),
    (3, 25.0, 100.0),
]


@pytest.mark.parametrize(("order", "cutoff", "rate"), FILTERS)
def test_the_response_is_that_of_scipys_filter(order: int, cutoff: float, rate: float):
    options = FilterOptions(cutoff, order)
    low_pass = LowPass.design(options, 1.0 / rate)
    far = max(2 * low_pass.memory, 50)
    impulse = np.zeros(2 * far + 1)
    impulse[far] = 1.0

    expected = signal.sosfiltfilt(signal.butter(order, cutoff, fs=rate, output="sos"), impulse)

    assert (
        np.abs(Decays.of(low_pass).response(np.arange(-far, far + 1)) - expected).max()
        < ROUNDING * expected.max()
    )


@pytest.mark.parametrize(("order", "cutoff", "rate"), FILTERS)
def test_any_rows_are_those_of_scipys_filter(order: int, cutoff: float, rate: float):
    """Neighbouring rows, rows far apart, the ends of blocks, and a last block with few rows."""
    low_pass = LowPass.design(FilterOptions(cutoff, order), 1.0 / rate)
    rng = np.random.default_rng(3)
    values = rng.normal(2.0, 1.0, (20_011, 2, 3))
    inner = np.arange(low_pass.memory, len(values) - low_pass.memory)
    rows = np.unique([*rng.choice(inner, 100), *inner[:130], *inner[-70:]])

    found = Decays.of(low_pass).at(rows, lambda part: values[part], low_pass.memory)

    sections = signal.butter(order, cutoff, fs=rate, output="sos")
    expected = signal.sosfiltfilt(sections, values, axis=0)[rows]
    assert np.abs(found - expected).max() < ROUNDING * np.abs(expected).max()


def test_a_log_in_parts_gives_what_the_whole_log_gives(arm, log: Log, monkeypatch: pytest.MonkeyPatch):
    options = FilterOptions()
    states = filtered(log, options)
    at = thinned(states, options)
    values = arm.regressor.regressor(states.q, states.qd, states.qdd)
    whole = states.low_pass(values)[at]

    monkeypatch.setattr(sys.modules["psdmc.calibration.logs.smoothed_rows"], "AT_ONCE", 2 * BLOCK)
    parts = smoothed_rows(states, at, lambda rows: values[rows])

    assert len(log) > 2 * states.low_pass.memory + 5 * BLOCK
    assert np.abs(parts - whole).max() < ROUNDING * np.abs(whole).max()
