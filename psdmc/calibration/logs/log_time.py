"""A log's time column: its order, its gaps, its rate, and the unit that it seems to have."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.logs.check_options import CheckOptions
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_survey import Survey
from psdmc.calibration.logs.stored_log import AnyLog

UNITS = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
"""Units that loggers write instead of seconds, and how many make one second."""
PERIODS = (0.9, 100.0, 1e5)
"""Smallest period, as a number, that is read as each of UNITS. Slower or faster logs do not exist: one row in 0.9 s, or
20 kHz in nanoseconds or microseconds, 10 Hz in the unit before."""
UNIT_MATCH = 0.1
"""Share by which velocity over slope may differ from a unit's factor."""
SMALLEST_STEP = 1e-9
"""s between any two rows: the resolution of time stamps."""

FaultAndRemedy = tuple[str, str]


def time_faults(log: AnyLog, survey: Survey, cutoff: float, options: CheckOptions) -> list[FaultAndRemedy]:
    """Faults of the time of a log whose numbers are finite, each with its remedy; at most one of a kind."""
    steps = np.diff(log.time)
    order = _order(log, steps)
    if order:
        return order
    shortest = float(steps.min())
    if shortest < SMALLEST_STEP or log.period * options.fastest < 1.0:
        step, smallest = (
            (shortest, SMALLEST_STEP) if shortest < SMALLEST_STEP else (log.period, 1 / options.fastest)
        )
        text = f"time_s grows by {step:.3g} s from row to row, expected at least {smallest:g} s"
        return [(text, "write time_s in seconds")]
    unit = suspected_unit(log, survey)
    if unit:
        return [(f"time_s looks like {unit}: {log.period:.4g} from row to row", "write time_s in seconds")]
    return _gaps(log, steps, options) + _length(log, options) + _too_slow(log, cutoff, options)


def suspected_unit(log: AnyLog, survey: Survey) -> str:
    """Name of the unit that time seems to have, where it is not seconds: from velocity over slope, else from the
    period."""
    ratios = list(survey.velocity_ratios.values())
    if ratios:
        middle = float(np.median(ratios))
        return next((name for name, factor in UNITS if abs(middle / factor - 1.0) < UNIT_MATCH), "")
    fitting = [name for (name, _), smallest in zip(UNITS, PERIODS, strict=True) if log.period >= smallest]
    return fitting[-1] if fitting else ""


def _order(log: AnyLog, steps: Array) -> list[FaultAndRemedy]:
    backwards = np.flatnonzero(steps <= 0)
    if not len(backwards):
        return []
    row = int(backwards[0]) + 1
    before, after = log.time[row - 1], log.time[row]
    word = "goes backwards" if after < before else "stands still"
    return [
        (
            f"time {word} at row {row + 1} ({before:.6g} s, then {after:.6g} s), {len(backwards)} time(s)",
            "sort the rows by time and drop doubled ones, or cut the log to a clean stretch",
        )
    ]


def _gaps(log: AnyLog, steps: Array, options: CheckOptions) -> list[FaultAndRemedy]:
    gaps = np.flatnonzero(steps > options.largest_gap * log.period)
    if not len(gaps):
        return []
    row = int(gaps[0])
    return [
        (
            f"time has {len(gaps)} gap(s): {steps[row]:.3g} s without a row after {log.time[row]:.6g} s",
            "give the stretches between the gaps as logs of their own",
        )
    ]


def _length(log: AnyLog, options: CheckOptions) -> list[FaultAndRemedy]:
    if log.duration < options.shortest:
        text = f"too short: {log.duration:.3g} s, expected at least {options.shortest:g} s"
        return [(text, "record a longer motion")]
    if log.duration > options.longest:
        text = f"lasts {log.duration:.4g} s, expected at most {options.longest:g} s"
        return [(text, "cut it into several, or write time_s in seconds")]
    return []


def _too_slow(log: AnyLog, cutoff: float, options: CheckOptions) -> list[FaultAndRemedy]:
    rate = 1.0 / log.period
    if rate >= options.samples_per_cycle * cutoff:
        return []
    return [
        (
            f"sampling at {rate:.4g} Hz is too slow for a cut-off of {cutoff:g} Hz, "
            f"expected at least {options.samples_per_cycle * cutoff:g} Hz",
            f"record faster, or filter a plain log at {rate / options.samples_per_cycle:.3g} Hz or less: --cutoff",
        )
    ]
