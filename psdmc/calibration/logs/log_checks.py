"""Checks a log before a fit, and reports its faults with a remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import NamedTuple, TypeVar

import numpy as np

from psdmc.calibration.logs.foreign_bytes import first_faults, listed
from psdmc.calibration.logs.log import AnyLog, Log, StoredLog
from psdmc.calibration.logs.log_survey import Survey, surveyed
from psdmc.errors import InputError
from psdmc.model.calibrated import Remark, code_of
from psdmc.robot.mechanism import Mechanism

UNITS = (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9))
"""Units that loggers write instead of seconds, and how many make one second."""
PERIODS = (0.9, 100.0, 1e5)
"""Smallest period, as a number, that is read as each of UNITS. Slower or faster logs do not exist: one row in 0.9 s, or
20 kHz in nanoseconds or microseconds, 10 Hz in the unit before."""
UNIT_MATCH = 0.1
"""Share by which velocity over slope may differ from a unit's factor."""
SMALLEST_STEP = 1e-9
"""s between any two rows: the resolution of time stamps."""


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """Limits above or below which a log is rejected or gets a remark.

    largest_gap        sample periods; a log with a longer pause is rejected
    largest_jitter     share of the sample period; with more jitter the log is resampled, and a note says so
    limit_slack        share by which position and speed may exceed the limits of the robot's joints
    free_position      rad, largest plausible position of a joint without limits
    free_speed         rad/s, largest plausible speed of a joint without a limit
    rate_disagreement  share by which the logged velocity may differ from the position's slope
    saturated_share    share of a moving joint's samples at one extreme effort above which it may be saturated
    shortest           s, shortest log that is accepted
    samples_per_cycle  smallest sampling rate in units of the filter's cut-off
    smallest_motion    rad or m, peak to peak; a joint with less motion is at rest
    longest            s, longest log that is accepted
    fastest            Hz, largest plausible sampling rate
    jump               smallest rate of a jump of the position, in units of the joint's speed; a log with one is rejected
    interpolated       share of rows that lie on straight lines from which the log gets a remark
    """

    largest_gap: float = 10.0
    largest_jitter: float = 0.05
    limit_slack: float = 0.05
    free_position: float = 15.0
    free_speed: float = 30.0
    rate_disagreement: float = 0.25
    saturated_share: float = 0.02
    shortest: float = 2.0
    samples_per_cycle: float = 4.0
    smallest_motion: float = 1e-5
    longest: float = 86_400.0
    fastest: float = 1e6
    jump: float = 5.0
    interpolated: float = 0.01


class Fault(NamedTuple):
    """A fault because of which a log cannot be used, and the remedy."""

    text: str
    remedy: str


@dataclass(frozen=True, slots=True, eq=False)
class Looked:
    """The inputs of the checks of a log: the log, its statistics, the robot, and the limits. `cutoff` is that of the filter
    (Hz) that will be applied to the log."""

    log: AnyLog
    survey: Survey
    chain: Mechanism
    cutoff: float
    options: CheckOptions


LogKind = TypeVar("LogKind", Log, StoredLog, AnyLog)


def checked(log: LogKind, chain: Mechanism, cutoff: float, options: CheckOptions | None = None) -> LogKind:
    """Return the log with its joints in the order of the robot's joints, and with remarks in its notes.

    chain   the robot
    cutoff  Hz, cut-off of the filter that will be applied to the log

    Raises InputError with the faults of the log. Values that are not numbers come first, then faults of time, then
    others.
    """
    options = options or CheckOptions()
    if len(log) < 2:
        raise InputError(
            f"{log.name}: too short: {len(log)} row(s)", f"at least {options.shortest:g} s are needed"
        )
    log = log.ordered(chain.v_names)
    of = Looked(log, surveyed(log, options.saturated_share), chain, cutoff, options)
    for stage in _FAULTS:
        found = [check(of) for check in stage]
        # the first of each kind before the others: one wrong unit gives a fault for every joint
        faults = [fault for same_rank in zip_longest(*found) for fault in same_rank if fault is not None]
        if faults:
            raise InputError(
                f"{log.name}: {first_faults([fault.text for fault in faults])}", faults[0].remedy
            )
    notes = [text for check in _REMARKS for text in check(of)]
    return _with_notes(log, tuple(Remark(f"{log.name}: {note}", code_of(note)) for note in notes))


def _with_notes(log: LogKind, notes: tuple[str, ...]) -> LogKind:
    said: tuple[str, ...] = log.notes
    return replace(log, notes=(*said, *notes))


# Faults of numbers and of time


def _no_numbers(of: Looked) -> Iterator[Fault]:
    """Faults of columns with values that are not finite, or too large for a measurement."""
    for found in of.survey.no_numbers:
        word = "is not finite" if not np.isfinite(found.value) else f"reaches {found.value:.3g}"
        yield Fault(
            f"{found.what} {word} in {found.rows} row(s), the first is row {found.first + 1} of {len(of.log)}",
            "cut the log to a clean stretch, or leave a damaged velocity out",
        )


def _times(of: Looked) -> Iterator[Fault]:
    """Faults of the time of a log whose numbers are finite, at most one of each kind."""
    log, options = of.log, of.options
    shortest = of.survey.steps[0]
    if shortest <= 0.0:
        backwards = np.flatnonzero(np.diff(log.time) <= 0)
        row = int(backwards[0]) + 1
        before, after = log.time[row - 1], log.time[row]
        word = "goes backwards" if after < before else "stands still"
        yield Fault(
            f"time {word} at row {row + 1} ({before:.6g} s, then {after:.6g} s), {len(backwards)} time(s)",
            "sort the rows by time and drop doubled ones, or cut the log to a clean stretch",
        )
    elif shortest < SMALLEST_STEP or log.period * options.fastest < 1.0:
        step, smallest = (
            (shortest, SMALLEST_STEP) if shortest < SMALLEST_STEP else (log.period, 1 / options.fastest)
        )
        text = f"time_s grows by {step:.3g} s from row to row, expected at least {smallest:g} s"
        yield Fault(text, "write time_s in seconds")
    elif unit := _suspected_unit(of):
        yield Fault(f"time_s looks like {unit}: {log.period:.4g} from row to row", "write time_s in seconds")
    else:
        yield from _gaps_and_length(of)


def _suspected_unit(of: Looked) -> str:
    """The likely unit of time if it is not seconds: from the ratio of velocity to slope of the position, or else from the
    period."""
    ratios = list(of.survey.velocity_ratios.values())
    if ratios:
        middle = float(np.median(ratios))
        return next((name for name, factor in UNITS if abs(middle / factor - 1.0) < UNIT_MATCH), "")
    fitting = [name for (name, _), smallest in zip(UNITS, PERIODS, strict=True) if of.log.period >= smallest]
    return fitting[-1] if fitting else ""


def _gaps_and_length(of: Looked) -> Iterator[Fault]:
    log, options = of.log, of.options
    largest = options.largest_gap * log.period
    if of.survey.steps[1] > largest:
        steps = np.diff(log.time)
        gaps = np.flatnonzero(steps > largest)
        row = int(gaps[0])
        yield Fault(
            f"time has {len(gaps)} gap(s): {steps[row]:.3g} s without a row after {log.time[row]:.6g} s",
            "give the stretches between the gaps as logs of their own",
        )
    if log.duration < options.shortest:
        text = f"too short: {log.duration:.3g} s, expected at least {options.shortest:g} s"
        yield Fault(text, "record a longer motion")
    elif log.duration > options.longest:
        text = f"lasts {log.duration:.4g} s, expected at most {options.longest:g} s"
        yield Fault(text, "cut it into several, or write time_s in seconds")
    rate, needed = 1.0 / log.period, options.samples_per_cycle * of.cutoff
    if rate < needed:
        yield Fault(
            f"sampling at {rate:.4g} Hz is too slow for a cut-off of {of.cutoff:g} Hz, "
            f"expected at least {needed:g} Hz",
            f"record faster, or filter a plain log at {rate / options.samples_per_cycle:.3g} Hz or less: --cutoff",
        )


# Faults of columns


def _units(of: Looked) -> Iterator[Fault]:
    """Faults of columns in rad for joints that slide, or in m for joints that turn."""
    for joint in of.chain.leading_joints if of.log.sliding is not None else ():
        found, right = ("m" if joint.name in (of.log.sliding or ()) else "rad"), joint.type.position_unit
        if found != right:
            yield Fault(
                f"joint {joint.name}: position_{found}.{joint.name}, but it {joint.type.verb}",
                f"expected position_{right}.<joint>, and its other columns in units to match",
            )


def _positions(of: Looked) -> Iterator[Fault]:
    for joint, reach in zip(of.chain.leading_joints, of.survey.reach.tolist(), strict=True):
        bound = max(abs(joint.limits.lower), abs(joint.limits.upper))
        bound = _allowed(bound, of.options.free_position, of.options)
        if not reach > bound:
            continue
        unit = joint.type.position_unit
        suspicion = ": degrees?" if unit == "rad" and np.radians(reach) <= bound else ""
        yield Fault(
            f"joint {joint.name}: position reaches {reach:.4g} {unit}, limit {bound:.4g} {unit}{suspicion}",
            "positions are expected in rad: convert the columns"
            if suspicion
            else "correct the columns, or the limits in the robot file",
        )


def _allowed(limit: float, free: float, options: CheckOptions) -> float:
    """A joint's limit with its slack; `free` where the robot has none."""
    return limit * (1 + options.limit_slack) if np.isfinite(limit) else free


def _speeds(of: Looked) -> Iterator[Fault]:
    for joint, speed in zip(of.chain.leading_joints, of.survey.speed.tolist(), strict=True):
        bound = _allowed(joint.limits.speed, of.options.free_speed, of.options)
        if speed > bound:
            yield Fault(
                f"joint {joint.name}: moves at {speed:.4g} per s, limit {bound:.4g}: unit of time or position?",
                "time is expected in s, positions in rad or m: convert the columns",
            )


def _rates(of: Looked) -> Iterator[Fault]:
    """Faults of the logged velocity against the position's slope: a ratio far from one is a wrong unit."""
    for k, ratio in of.survey.velocity_ratios.items():
        if abs(ratio - 1.0) <= of.options.rate_disagreement:
            continue
        degrees = 40 < abs(ratio) < 70 or 0.014 < abs(ratio) < 0.025
        yield Fault(
            f"joint {of.log.joint_names[k]}: velocity is {ratio:.4g} times the position's slope"
            f"{': degrees?' if degrees else ''}",
            "velocities are expected in rad/s or m/s, with the position's sign: convert the columns, "
            "or leave them out",
        )


def _jumping(of: Looked) -> Iterator[Fault]:
    """Faults of positions that jump: an encoder that stood still or lost counts, or rows that are missing without a gap
    in time."""
    for what, jumps in (("position", of.survey.jumps), ("motor_position", of.survey.motor_jumps)):
        for joint, jump, speed in zip(
            of.chain.leading_joints, jumps, of.survey.speed.tolist(), strict=bool(jumps)
        ):
            if jump is None:
                continue
            allowed = _allowed(joint.limits.speed, of.options.free_speed, of.options)
            if abs(jump.rate) > max(of.options.jump * speed, allowed):
                yield Fault(
                    f"joint {joint.name}: {what} jumps by {jump.size:.3g} {joint.type.position_unit} after "
                    f"{jump.time:.6g} s, {abs(jump.rate) / max(speed, 1e-12):.3g} times as fast as it moves otherwise",
                    "an encoder stood still, or rows are missing: give the stretches before and after as logs of their own",
                )


def _nothing_there(of: Looked) -> Iterator[Fault]:
    if np.all(of.survey.motion < of.options.smallest_motion):
        yield Fault("no joint moves", "give a log of a motion; `psdmc excite` plans one")
    if not of.survey.largest_effort.any():
        yield Fault(
            f"{of.log.quantity} is zero throughout, for every joint",
            "record the motors' currents or torques too",
        )


# Remarks


def _jitter(of: Looked) -> Iterator[str]:
    (shortest, longest), period = of.survey.steps, of.log.period
    jitter = max(longest - period, period - shortest) / period
    if jitter > of.options.largest_jitter:
        yield f"sample times jitter by {jitter:.0%}: resampled"


def _saturation(of: Looked) -> Iterator[str]:
    if of.survey.saturated:
        names = listed([f"joint {found.words}" for found in of.survey.saturated])
        yield f"{of.log.quantity} saturated? {names} of its moving rows"


def _still(of: Looked) -> Iterator[str]:
    moved = zip(of.log.joint_names, of.survey.motion, strict=True)
    if still := [name for name, motion in moved if motion < of.options.smallest_motion]:
        yield Remark(f"joint(s) {listed(still)} stand still", "standing")


def _interpolated(of: Looked) -> Iterator[str]:
    share = of.survey.straight
    if share > of.options.interpolated:
        yield Remark(
            f"{share:.0%} of the rows look interpolated: all positions and efforts lie on straight lines there, so "
            "accelerations are missing; leave these rows out",
            "interpolated",
        )


def _dead_effort(of: Looked) -> Iterator[str]:
    efforts = zip(of.log.joint_names, of.survey.largest_effort, strict=True)
    if dead := [name for name, effort in efforts if not effort > 0]:
        yield f"joint(s) {listed(dead)}: {of.log.quantity} is zero throughout"


_FAULTS: tuple[tuple[Callable[[Looked], Iterator[Fault]], ...], ...] = (
    (_no_numbers, _units),
    (_times,),
    (_positions, _speeds, _rates, _jumping, _nothing_there),
)
"""In stages: the checks of a stage make sense only where earlier stages found no fault."""

_REMARKS: tuple[Callable[[Looked], Iterator[str]], ...] = (
    _jitter,
    _saturation,
    _still,
    _dead_effort,
    _interpolated,
)
