"""What can be wrong with a log, found before anything is fitted, and named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibrate.log import Array, Log
from psdmc.errors import InputError
from psdmc.robot.chain import Chain


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """When a log is refused or remarked on.

    largest_gap       sample periods; a longer pause is a gap, and refused
    largest_jitter    share of the sample period; above it the log is resampled, and a note says so
    limit_slack       share by which position and speed may exceed the chain's limits
    free_position     rad, largest believable position of a joint without limits
    free_speed        rad/s, largest believable speed of a joint without a limit
    rate_disagreement share by which the logged velocity may differ from the position's slope
    saturated_share   share of samples at the largest effort from which it counts as saturated
    shortest          s, shortest log that is read
    samples_per_cycle smallest sampling rate in units of the filter's cut-off
    smallest_motion   rad or m, peak to peak; below it a joint stands still
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


def checked(log: Log, chain: Chain, cutoff: float, options: CheckOptions | None = None) -> Log:
    """The log with its joints in the chain's order and what was noticed in its notes.

    cutoff   Hz, of the filter that the log is meant for
    InputError names everything that forbids its use, all at once.
    """
    options = options or CheckOptions()
    if len(log) < 2:
        raise InputError(
            f"{log.name}: too short: {len(log)} row(s)", f"at least {options.shortest:g} s are needed"
        )
    log = log.ordered(chain.joint_names)
    faults = [text for check in _FAULTS for text in check(log, chain, cutoff, options)]
    if faults:
        raise InputError("; ".join(f"{log.name}: {fault}" for fault in faults), _hint(faults))
    notes = [text for check in _REMARKS for text in check(log, chain, cutoff, options)]
    return replace(log, notes=(*log.notes, *(f"{log.name}: {note}" for note in notes)))


def still_joints(log: Log, options: CheckOptions | None = None) -> tuple[bool, ...]:
    """Per joint, whether it does not move."""
    smallest = (options or CheckOptions()).smallest_motion
    return tuple(bool(motion < smallest) for motion in np.ptp(log.position, axis=0))


def _hint(faults: list[str]) -> str:
    text = " ".join(faults)
    if "degrees" in text:
        return "positions are expected in rad: convert the columns"
    if "finite" in text or "time" in text:
        return "cut the log to a clean stretch, or record it again"
    return "record again, or correct the file"


def _not_finite(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    faults = []
    for what, values in (("time", log.time[:, None]), ("position", log.position), ("effort", log.effort)):
        rows = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(rows):
            faults.append(f"{what} is not finite in {len(rows)} row(s), the first is row {rows[0]}")
    return faults


def _time_order(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    steps = np.diff(log.time)
    backwards = np.flatnonzero(steps <= 0)
    if len(backwards):
        row = int(backwards[0]) + 1
        before, after = log.time[row - 1], log.time[row]
        word = "goes backwards" if after < before else "stands still"
        return [f"time {word} at row {row} ({before:.6g} s, then {after:.6g} s), {len(backwards)} time(s)"]
    gaps = np.flatnonzero(steps > options.largest_gap * log.period)
    if len(gaps):
        row = int(gaps[0])
        return [f"time has {len(gaps)} gap(s): {steps[row]:.3g} s without a row after {log.time[row]:.6g} s"]
    return []


def _too_short(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    if log.duration < options.shortest:
        return [f"too short: {log.duration:.3g} s, expected at least {options.shortest:g} s"]
    return []


def _too_slow(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    rate = 1.0 / log.period if log.period > 0 else np.inf
    if rate < options.samples_per_cycle * cutoff:
        return [
            f"sampling at {rate:.4g} Hz is too slow for a cut-off of {cutoff:g} Hz, "
            f"expected at least {options.samples_per_cycle * cutoff:g} Hz"
        ]
    return []


def _positions(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    faults = []
    for k, joint in enumerate(chain.joints):
        reach = float(np.abs(log.position[:, k]).max(initial=0.0))
        bound = max(abs(joint.limits.lower), abs(joint.limits.upper))
        bound = options.free_position if not np.isfinite(bound) else bound * (1 + options.limit_slack)
        if not reach > bound:
            continue
        unit = "rad" if joint.kind == "revolute" else "m"
        suspicion = ": degrees?" if joint.kind == "revolute" and np.radians(reach) <= bound else ""
        faults.append(
            f"joint {joint.name}: position reaches {reach:.4g} {unit}, limit {bound:.4g} {unit}{suspicion}"
        )
    return faults


def _speeds(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    if (np.diff(log.time) <= 0).any() or not np.isfinite(log.position).all():
        return []
    faults = []
    slope = _slope(log)
    for k, joint in enumerate(chain.joints):
        speed = float(np.quantile(np.abs(slope[:, k]), 0.99))
        bound = joint.limits.speed
        bound = options.free_speed if not np.isfinite(bound) else bound * (1 + options.limit_slack)
        if speed > bound:
            faults.append(
                f"joint {joint.name}: moves at {speed:.4g} per s, limit {bound:.4g}: unit of time or position?"
            )
    return faults


def _rates(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    """The logged velocity against the position's slope: a ratio far from one is a wrong unit."""
    if log.velocity is None or (np.diff(log.time) <= 0).any() or not np.isfinite(log.position).all():
        return []
    faults = []
    slope = _slope(log)
    for k, joint in enumerate(chain.joints):
        moving = float(np.sqrt(np.mean(slope[:, k] ** 2)))
        if np.ptp(log.position[:, k]) < 1e-2:
            continue
        ratio = float(slope[:, k] @ log.velocity[:, k]) / (len(log) * moving**2)
        if abs(ratio - 1.0) > options.rate_disagreement:
            suspicion = ": degrees?" if 40 < abs(ratio) < 70 or 0.014 < abs(ratio) < 0.025 else ""
            faults.append(
                f"joint {joint.name}: velocity is {ratio:.4g} times the position's slope{suspicion}"
            )
    return faults


def _slope(log: Log) -> Array:
    """Central differences over two periods: too coarse for dynamics, enough to tell units apart."""
    slope: Array = (log.position[2:] - log.position[:-2]) / (log.time[2:] - log.time[:-2])[:, None]
    return np.vstack([slope[:1], slope, slope[-1:]])


def _nothing_there(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    faults = []
    if all(still_joints(log, options)):
        faults.append("no joint moves")
    dead = [name for k, name in enumerate(log.joint_names) if not log.effort[:, k].any()]
    if len(dead) == len(log.joint_names):
        faults.append(f"{log.quantity} is zero throughout, for every joint")
    return faults


def _jitter(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    steps = np.diff(log.time)
    jitter = float(np.abs(steps - log.period).max() / log.period)
    return [f"sample times jitter by {jitter:.0%}: resampled"] if jitter > options.largest_jitter else []


def _saturation(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    notes = []
    for k, name in enumerate(log.joint_names):
        size = np.abs(log.effort[:, k])
        share = float(np.mean(size >= size.max() * (1 - 1e-9)))
        if size.max() > 0 and share > options.saturated_share:
            notes.append(
                f"joint {name}: {share:.0%} of its {log.quantity} sits at {size.max():.4g}: saturated?"
            )
    return notes


def _still(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    still = [name for name, rests in zip(log.joint_names, still_joints(log, options), strict=True) if rests]
    return [f"joint(s) {', '.join(still)} stand still"] if still else []


def _dead_effort(log: Log, chain: Chain, cutoff: float, options: CheckOptions) -> list[str]:
    dead = [name for k, name in enumerate(log.joint_names) if not log.effort[:, k].any()]
    return [f"joint(s) {', '.join(dead)}: {log.quantity} is zero throughout"] if dead else []


Check = Callable[[Log, Chain, float, CheckOptions], list[str]]

_FAULTS: tuple[Check, ...] = (
    _not_finite,
    _time_order,
    _too_short,
    _too_slow,
    _positions,
    _speeds,
    _rates,
    _nothing_there,
)
_REMARKS: tuple[Check, ...] = (_jitter, _saturation, _still, _dead_effort)
