"""Adds faults to logs that real logs can have, for tests of the verdict of a calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from psdmc.calibration.logs.log import Array, Log

MOVED = ("position", "velocity")
ALL = (*MOVED, "effort")


def scaled(log: Log, factor: float | Sequence[float]) -> Log:
    """Return the log with efforts times one factor, or one per joint, as in a wrong unit or currents."""
    return replace(log, effort=log.effort * np.asarray(factor, dtype=np.float64))


def turned(log: Log, joint: int, columns: Sequence[str]) -> Log:
    """Return the log with the sign of one joint's columns reversed: of "position", "velocity", "effort" or
    "motor_position"."""
    signs = np.ones(len(log.joint_names))
    signs[joint] = -1.0
    return _changed(log, columns, lambda values: signs * values)


def swapped(log: Log, first: int, second: int, columns: Sequence[str]) -> Log:
    """Return the log with the columns of two joints exchanged."""
    order = list(range(len(log.joint_names)))
    order[first], order[second] = second, first
    return _changed(log, columns, lambda values: values[:, order])


def decimated(log: Log, every: int) -> Log:
    """Return the log with every `every`-th row only."""
    return log.at(slice(None, None, every))


def noise_only(log: Log, seed: int = 0) -> Log:
    """Return the log with efforts replaced by noise of the same size, which is unrelated to the motion."""
    rng = np.random.default_rng(seed)
    return replace(log, effort=rng.standard_normal(log.effort.shape) * np.std(log.effort, axis=0))


def _changed(log: Log, columns: Sequence[str], change: Callable[[Array], Array]) -> Log:
    for name in columns:
        values: Array | None = getattr(log, name)
        if values is not None:
            log = replace(log, **{name: change(values)})  # type: ignore[arg-type]
    return log


def clipped(log: Log, share: float) -> Log:
    """Return the log with every joint's effort limited to a share of its peak."""
    peak = share * np.abs(log.effort).max(axis=0)
    return replace(log, effort=np.clip(log.effort, -peak, peak))


def late(log: Log, rows: int) -> Log:
    """Return the log with its effort delayed by this number of rows."""
    velocity = None if log.velocity is None else log.velocity[rows:]
    return replace(
        log, time=log.time[rows:], position=log.position[rows:], velocity=velocity, effort=log.effort[:-rows]
    )


def borrowed(log: Log, joint: int, other: Log, other_joint: int) -> Log:
    """Return the log with the columns of one joint taken from a joint of another robot's log, at the same times.

    The result ends where the shorter log ends.
    """
    times = other.time - other.time[0]
    kept = log.at(log.time - log.time[0] <= times[-1])

    def changed(own: Array, theirs: Array) -> Array:
        column = np.interp(kept.time - kept.time[0], times, theirs[:, other_joint])
        return _with_column(own, joint, column)

    velocity = kept.velocity
    if velocity is not None:
        rates = other.velocity if other.velocity is not None else np.gradient(other.position, times, axis=0)
        velocity = changed(velocity, rates)
    return replace(
        kept,
        position=changed(kept.position, other.position),
        velocity=velocity,
        effort=changed(kept.effort, other.effort),
    )


def drifting(log: Log, share: float) -> Log:
    """Return the log with efforts whose clock is slower than that of the positions by this share."""
    since = log.time - log.time[0]
    effort = [np.interp((1.0 - share) * since, since, column) for column in log.effort.T]
    return replace(log, effort=np.stack(effort, axis=1))


def bridged(log: Log, gaps: int, seconds: float) -> Log:
    """Return the log with evenly spread gaps of this length, whose samples are replaced by straight lines."""
    since = log.time - log.time[0]
    starts = (np.arange(gaps) + 0.5) * since[-1] / gaps
    lost = np.any((since[:, None] > starts) & (since[:, None] < starts + seconds), axis=1)

    def filled(values: Array) -> Array:
        return np.stack([np.interp(log.time, log.time[~lost], column[~lost]) for column in values.T], axis=1)

    velocity = None if log.velocity is None else filled(log.velocity)
    return replace(log, position=filled(log.position), velocity=velocity, effort=filled(log.effort))


def quantised(log: Log, share: float) -> Log:
    """Return the log with efforts rounded to steps of this share of each joint's range of effort."""
    step = share * np.maximum(np.ptp(log.effort, axis=0), 1e-12)
    return replace(log, effort=np.round(log.effort / step) * step)


def geared(log: Log, joint: int, factor: float) -> Log:
    """Return the log that a wrong reduction ratio of one joint gives: position and velocity times the factor, effort
    divided by the factor."""
    factors = np.ones(len(log.joint_names))
    factors[joint] = factor
    moved = _changed(log, MOVED, lambda values: values * factors)
    return replace(moved, effort=log.effort / factors)


def undivided(log: Log, joint: int, ratio: float) -> Log:
    """Return the log with one joint's motor position before it was divided by the gear ratio."""
    factors = np.ones(len(log.joint_names))
    factors[joint] = ratio
    return _changed(log, ["motor_position"], lambda values: values * factors)


def offset(log: Log, joint: int, angle: float) -> Log:
    """Return the log with one joint's position shifted by a constant, as by a wrong zero position; rad or m."""
    shift = np.zeros(len(log.joint_names))
    shift[joint] = angle
    return replace(log, position=log.position + shift)


def rough(log: Log, share: float, seed: int = 0) -> Log:
    """Return the log with white noise added to the efforts, of this share of each joint's standard deviation."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(log.effort.shape) * share * np.std(log.effort, axis=0)
    return replace(log, effort=log.effort + noise)


def stuck(log: Log, joint: int, start: float, seconds: float, column: str = "position") -> Log:
    """Return the log in which one joint's encoder stands still for some time that begins `start` s after the first row.

    column  "position", or "motor_position" for the encoder of the motor
    """
    since = log.time - log.time[0]
    rows = np.flatnonzero((since >= start) & (since < start + seconds))

    def held(values: Array) -> Array:
        return _with_column(
            values,
            joint,
            np.where(np.isin(np.arange(len(values)), rows), values[rows[0], joint], values[:, joint]),
        )

    velocity = log.velocity
    if velocity is not None and column == "position":
        velocity = velocity.copy()
        velocity[rows, joint] = 0.0
    return replace(_changed(log, [column], held), velocity=velocity)


def backwards(log: Log, row: int, seconds: float) -> Log:
    """Return the log whose clock is set back by this time at one row."""
    time = log.time.copy()
    time[row:] -= seconds
    return replace(log, time=time)


def _with_column(values: Array, joint: int, column: Array) -> Array:
    changed = values.copy()
    changed[:, joint] = column
    return changed
