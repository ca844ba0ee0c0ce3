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
    """Return the log with the sign of one joint's columns (of "position", "velocity", "effort") reversed."""
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
    position = change(log.position) if "position" in columns else log.position
    effort = change(log.effort) if "effort" in columns else log.effort
    velocity = log.velocity
    if velocity is not None and "velocity" in columns:
        velocity = change(velocity)
    return replace(log, position=position, velocity=velocity, effort=effort)


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
