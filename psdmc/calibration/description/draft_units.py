"""Guesses at the units of a log's columns, from words in their names and from their numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from psdmc.calibration.description.columns_found import USUAL, What
from psdmc.calibration.description.units import UNITS
from psdmc.calibration.logs.log import Array

SPELLED: Mapping[What, Mapping[str, str]] = {
    "position": {
        "deg": "deg",
        "degree": "deg",
        "degrees": "deg",
        "rad": "rad",
        "rev": "rev",
        "ticks": "ticks",
    }
    | {"counts": "ticks", "mm": "mm"},
    "velocity": {"rpm": "rpm", "deg": "deg/s", "degrees": "deg/s", "rad": "rad/s", "mm": "mm/s"},
    "effort": {"ma": "mA", "a": "A", "amp": "A", "ampere": "A", "current": "A", "currents": "A", "cur": "A"}
    | {"curr": "A", "iq": "A", "i": "A", "mnm": "mNm", "ncm": "Ncm", "nm": "Nm", "knm": "kNm"},
}
"""Units by words in names; the first word that is there counts."""
TURN = 2.0 * np.pi * 1.1
"""rad: a joint that goes further is taken to be logged in degrees."""
RATIO = 0.3
"""Share by which velocity over slope may differ from a unit's factor."""
TIME_PERIODS = (("ns", 1e5), ("us", 100.0), ("ms", 0.9))
"""Units of time by the smallest period, as a number, that is read as theirs."""


def unit_of(what: What, names: Sequence[str], values: Array) -> str:
    """A unit of a quantity's columns (N, n); positions beyond a turn are in degrees where their names say nothing."""
    spelled = spelled_unit(what, names)
    if spelled:
        return spelled
    if what == "effort":
        return "Nm"
    if what == "velocity":
        return "rad/s"
    finite = values[np.isfinite(values)]
    return "deg" if len(finite) and float(np.abs(finite).max()) > TURN else "rad"


def spelled_unit(what: What, names: Sequence[str]) -> str:
    """The unit that the columns' names state; empty where they do not."""
    for name in names:
        prefix = name.partition(".")[0]
        if prefix in USUAL[what]:
            return USUAL[what][prefix][0]
        words = re.findall(r"[a-z]+", name.lower())
        hit = next((unit for word, unit in SPELLED[what].items() if word in words), "")
        if hit:
            return hit
    return ""


def velocity_unit(time: Array, position: Array, velocity: Array) -> str:
    """The unit in which velocities (N, n) are the slopes of positions (N, n) in rad; empty where none fits."""
    if len(time) < 3 or not np.all(np.diff(time) > 0):
        return ""
    slope = np.gradient(position, time, axis=0)
    power = float(np.sum(slope**2))
    if not power > 0 or not np.all(np.isfinite(velocity)):
        return ""
    ratio = abs(float(np.sum(slope * velocity)) / power)
    for name, unit in UNITS["velocity"].items():
        if unit.says == "turning" and name != "ticks/s" and abs(ratio * unit.size - 1.0) < RATIO:
            return name
    return ""


def time_unit(time: Array) -> str:
    """s, ms, us or ns, from the median period."""
    if len(time) < 2:
        return "s"
    period = float(np.median(np.diff(time)))
    return next((name for name, smallest in TIME_PERIODS if period >= smallest), "s")
