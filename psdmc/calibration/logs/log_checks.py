"""Faults of a log, found and named before anything is fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import zip_longest
from typing import NamedTuple, TypeVar

import numpy as np

from psdmc.calibration.logs.check_options import CheckOptions
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_survey import NoNumber, Survey, surveyed
from psdmc.calibration.logs.log_time import time_faults
from psdmc.calibration.logs.stored_log import AnyLog, StoredLog
from psdmc.calibration.logs.wording import first_faults, listed
from psdmc.errors import InputError
from psdmc.model.calibrated import Remark, code_of
from psdmc.robot.mechanism import Mechanism

LogKind = TypeVar("LogKind", Log, StoredLog, AnyLog)


class Fault(NamedTuple):
    """A fault that forbids a log's use, and the remedy."""

    text: str
    remedy: str


def checked(log: LogKind, chain: Mechanism, cutoff: float, options: CheckOptions | None = None) -> LogKind:
    """The log with its joints in the chain's order, and remarks in its notes.

    cutoff   Hz, of the filter that the log is meant for

    InputError names the faults that forbid its use: first values that are no numbers, then faults of time, then others.
    """
    options = options or CheckOptions()
    if len(log) < 2:
        raise InputError(
            f"{log.name}: too short: {len(log)} row(s)", f"at least {options.shortest:g} s are needed"
        )
    log = log.ordered(chain.joint_names)
    survey = surveyed(log, options.saturated_share)
    for stage in _FAULTS:
        found = [check(log, survey, chain, cutoff, options) for check in stage]
        # the first of each kind before the others: one wrong unit gives a fault for every joint
        faults = [fault for same_rank in zip_longest(*found) for fault in same_rank if fault is not None]
        if faults:
            raise InputError(
                f"{log.name}: {first_faults([fault.text for fault in faults])}", faults[0].remedy
            )
    notes = [text for check in _REMARKS for text in check(log, survey, chain, cutoff, options)]
    return _with_notes(log, tuple(Remark(f"{log.name}: {note}", code_of(note)) for note in notes))


def _with_notes(log: LogKind, notes: tuple[str, ...]) -> LogKind:
    said: tuple[str, ...] = log.notes
    return replace(log, notes=(*said, *notes))


def _no_numbers(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[Fault]:
    return [_no_number(found, log) for found in survey.no_numbers]


def _no_number(found: NoNumber, log: AnyLog) -> Fault:
    """The fault of a column's first value that is not finite, or too large for a measurement."""
    word = "is not finite" if not np.isfinite(found.value) else f"reaches {found.value:.3g}"
    return Fault(
        f"{found.what} {word} in {found.rows} row(s), the first is row {found.first + 1} of {len(log)}",
        "cut the log to a clean stretch, or leave a damaged velocity out",
    )


def _units(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[Fault]:
    """Faults of columns in rad for joints that slide, or in m for joints that turn."""
    if log.sliding is None:
        return []
    faults = []
    for joint in chain.joints:
        found, right = ("m" if joint.name in log.sliding else "rad"), joint.type.position_unit
        if found != right:
            faults.append(
                Fault(
                    f"joint {joint.name}: position_{found}.{joint.name}, but it {joint.type.verb}",
                    f"expected position_{right}.<joint>, and its other columns in units to match",
                )
            )
    return faults


def _positions(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[Fault]:
    faults = []
    for k, joint in enumerate(chain.joints):
        reach = float(survey.reach[k])
        bound = max(abs(joint.limits.lower), abs(joint.limits.upper))
        bound = _allowed(bound, options.free_position, options)
        if not reach > bound:
            continue
        unit = joint.type.position_unit
        suspicion = ": degrees?" if unit == "rad" and np.radians(reach) <= bound else ""
        faults.append(
            Fault(
                f"joint {joint.name}: position reaches {reach:.4g} {unit}, limit {bound:.4g} {unit}{suspicion}",
                "positions are expected in rad: convert the columns"
                if suspicion
                else "correct the columns, or the limits in the robot file",
            )
        )
    return faults


def _allowed(limit: float, free: float, options: CheckOptions) -> float:
    """A joint's limit with its slack; `free` where the robot has none."""
    return limit * (1 + options.limit_slack) if np.isfinite(limit) else free


def _speeds(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[Fault]:
    faults = []
    for k, joint in enumerate(chain.joints):
        speed = float(survey.speed[k])
        bound = _allowed(joint.limits.speed, options.free_speed, options)
        if speed > bound:
            faults.append(
                Fault(
                    f"joint {joint.name}: moves at {speed:.4g} per s, limit {bound:.4g}: unit of time or position?",
                    "time is expected in s, positions in rad or m: convert the columns",
                )
            )
    return faults


def _rates(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[Fault]:
    """Faults of the logged velocity against the position's slope: a ratio far from one is a wrong unit."""
    faults = []
    for k, ratio in survey.velocity_ratios.items():
        if abs(ratio - 1.0) <= options.rate_disagreement:
            continue
        degrees = 40 < abs(ratio) < 70 or 0.014 < abs(ratio) < 0.025
        faults.append(
            Fault(
                f"joint {log.joint_names[k]}: velocity is {ratio:.4g} times the position's slope"
                f"{': degrees?' if degrees else ''}",
                "velocities are expected in rad/s or m/s, with the position's sign: convert the columns, "
                "or leave them out",
            )
        )
    return faults


def _nothing_there(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[Fault]:
    faults = []
    if np.all(survey.motion < options.smallest_motion):
        faults.append(Fault("no joint moves", "give a log of a motion; `psdmc excite` plans one"))
    if not survey.largest_effort.any():
        faults.append(
            Fault(
                f"{log.quantity} is zero throughout, for every joint",
                "record the motors' currents or torques too",
            )
        )
    return faults


def _jitter(log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions) -> list[str]:
    steps = np.diff(log.time)
    jitter = float(np.abs(steps - log.period).max() / log.period)
    return [f"sample times jitter by {jitter:.0%}: resampled"] if jitter > options.largest_jitter else []


def _saturation(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[str]:
    names = listed([f"joint {found.words}" for found in survey.saturated])
    return [f"{log.quantity} saturated? {names} of its moving rows"] if survey.saturated else []


def _still(log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions) -> list[str]:
    still = [
        name
        for name, motion in zip(log.joint_names, survey.motion, strict=True)
        if motion < options.smallest_motion
    ]
    return [Remark(f"joint(s) {listed(still)} stand still", "standing")] if still else []


def _dead_effort(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[str]:
    dead = [name for k, name in enumerate(log.joint_names) if not survey.largest_effort[k] > 0]
    return [f"joint(s) {listed(dead)}: {log.quantity} is zero throughout"] if dead else []


Check = Callable[[AnyLog, Survey, Mechanism, float, CheckOptions], list[Fault]]
Noticing = Callable[[AnyLog, Survey, Mechanism, float, CheckOptions], list[str]]


def _times(
    log: AnyLog, survey: Survey, chain: Mechanism, cutoff: float, options: CheckOptions
) -> list[Fault]:
    return [Fault(*fault) for fault in time_faults(log, survey, cutoff, options)]


_FAULTS: tuple[tuple[Check, ...], ...] = (
    (_no_numbers, _units),
    (_times,),
    (_positions, _speeds, _rates, _nothing_there),
)
"""In stages: the checks of a stage make sense only where earlier stages found no fault."""
_REMARKS: tuple[Noticing, ...] = (_jitter, _saturation, _still, _dead_effort)
