"""Guesses which columns of a log hold which quantities of which joints, and in which units, for a draft of a log
description."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.description.columns_found import USUAL
from psdmc.calibration.description.joint_tables import UNITS, What
from psdmc.calibration.logs.log import Array

WORDS: Mapping[What, tuple[str, ...]] = {
    "velocity": ("qd", "dq", "qdot", "vel", "velocity", "velocities", "speed", "omega", "rpm", "qp"),
    "effort": (
        *("tau", "torque", "torques", "trq", "tq", "effort", "efforts", "moment", "force", "load"),
        *("current", "currents", "cur", "curr", "amp", "ampere", "iq", "i"),
    ),
    "position": (
        *("q", "pos", "position", "positions", "angle", "angles", "theta", "enc", "encoder", "ang", "p"),
        *("deg", "degrees", "rad", "ticks", "counts"),
    ),
}
"""Words in the names of columns; velocity before position, as 'qd' begins with 'q'."""
COMMANDED = (
    *("target", "desired", "des", "ref", "reference", "cmd", "command", "setpoint", "setp", "goal"),
    "error",
)
"""Words of what was asked for, not measured."""
SIDES: Mapping[str, tuple[str, ...]] = {
    "motor": ("motor", "mot", "rotor", "drive"),
    "link": ("link", "load", "output", "out"),
}
"""Words that tell on which side of an elastic gear a column was measured."""
GEARLESS = 0.05
"""A ratio of motor to link nearer to one is that of a column that is already divided by the gear ratio."""
TOGETHER = 0.95
"""Correlation from which two columns are the positions of one joint's two sides."""
TIMES = (
    *("time_s", "time", "t", "timestamp", "stamp", "sec", "seconds", "ms", "millis"),
    *("date", "datetime", "when"),
)
"""Words of time, the likeliest first."""


@dataclass(frozen=True, slots=True)
class Guess:
    """A guess which columns of a log hold which quantities, as indices from 0.

    time       column of time; None if no column resembles time
    joints     columns by joint name, in the order of the model if it is known, else of the log
    by_number  True: the names of the columns gave no hint, and the guess follows only from the number of columns
    """

    time: int | None
    joints: Mapping[str, Mapping[What, int]]
    by_number: bool = False


def guessed(names: Sequence[str], width: int, joint_names: Sequence[str] | None) -> Guess:
    """Return a guess which columns belong to which joints. Joints of the model without a column have no entries."""
    if not names:
        return _by_number(width, joint_names)
    time = next((k for word in TIMES for k, name in enumerate(names) if _plain(name) == word), None)
    if time is None:
        time = next((k for k, name in enumerate(names) if set(_words(name)) & set(TIMES)), None)
    found: dict[str, dict[tuple[What, str], int]] = {}
    for place, name in enumerate(names):
        read = None if place == time else _read(name, joint_names)
        if read is not None:
            what, joint, side = read
            found.setdefault(joint, {}).setdefault((what, side), place)
    return Guess(time, _by_joint({joint: _two_sides(own) for joint, own in found.items()}, joint_names))


def _two_sides(places: Mapping[tuple[What, str], int]) -> dict[What, int]:
    """Columns of one joint by quantity, from columns by quantity and side. If the joint has positions of its motor and of
    its link, `position` and `velocity` are those of the link. Otherwise, the first column of a quantity is taken."""
    first: dict[What, int] = {}
    for (what, _), place in places.items():
        first.setdefault(what, place)
    sides = [side for what, side in places if what == "position"]
    if len(sides) < 2:
        return first
    link, motor = ("link" if "link" in sides else ""), ("motor" if "motor" in sides else "")
    pair: dict[What, int] = {
        "position": places["position", link],
        "motor_position": places["position", motor],
    }
    if ("velocity", link) in places:
        pair["velocity"] = places["velocity", link]
    if "effort" in first:
        pair["effort"] = places.get(("effort", "motor"), first["effort"])
    return pair


def _plain(name: str) -> str:
    return re.sub(r"\s*[\[(].*", "", name.strip().lower())


def _words(name: str) -> list[str]:
    """Parts of a name, in lower case: 'actual_qd_3' is actual, qd, 3; 'jointPos[2]' joint, pos, 2."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return re.findall(r"[a-z]+|\d+", spaced.lower())


def _read(name: str, joint_names: Sequence[str] | None) -> tuple[What, str, str] | None:
    """Quantity, joint and side of a column: the joint by its name, else by its number; the side is empty if unknown."""
    for what, prefixes in USUAL.items():
        prefix, _, joint = name.partition(".")
        if prefix in prefixes and joint:
            return what, joint, ""
    left = name
    owner = _owner(name, joint_names)
    if owner is not None:
        left = name.replace(owner, " ", 1)
    words = _words(left)
    if set(words) & set(COMMANDED):
        return None
    side = next((side for side, known in SIDES.items() if set(words) & set(known)), "")
    plain = set(words) - set(SIDES.get(side, ()))  # a load's position is no effort
    meant = [what for own in (plain, set(words)) for what, known in WORDS.items() if own & set(known)]
    numbers = [word for word in words if word.isdigit()]
    if not meant or (owner is None and not numbers):
        return None
    return meant[0], owner if owner is not None else f"#{int(numbers[-1])}", side


def _owner(name: str, joint_names: Sequence[str] | None) -> str | None:
    """The longest of the model's joint names in a column's name, not within a longer word or number."""
    hits = [
        joint
        for joint in joint_names or ()
        if re.search(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])", name)
    ]
    return max(hits, key=len, default=None)


def _by_joint(
    found: Mapping[str, Mapping[What, int]], joint_names: Sequence[str] | None
) -> dict[str, Mapping[What, int]]:
    """Assign columns to the model's joints: those with a joint's name, else numbered columns in order."""
    numbered = sorted((joint for joint in found if joint.startswith("#")), key=lambda joint: int(joint[1:]))
    if joint_names is None:
        own = {joint: places for joint, places in found.items() if joint not in numbered}
        return own or {f"joint_{k}": found[joint] for k, joint in enumerate(numbered, start=1)}
    order = [joint for joint in numbered if "position" in found[joint]]
    others = [joint for joint in found if joint not in joint_names and joint not in numbered]
    spare = order if len(order) >= len(joint_names) else []
    if not spare and len(others) == len(joint_names):
        spare = others
    by_place = dict(zip(joint_names, spare, strict=False))
    return {
        joint: found[joint] if joint in found else found.get(by_place.get(joint, ""), {})
        for joint in joint_names
    }


def _by_number(width: int, joint_names: Sequence[str] | None) -> Guess:
    """Columns without names: time, positions, velocities where they fit, efforts, in this order."""
    n = len(joint_names) if joint_names is not None else next((k for k in (3, 2) if (width - 1) % k == 0), 0)
    if joint_names is None:
        n = (width - 1) // n if n else 0
    parts: tuple[What, ...] = (
        ("position", "velocity", "effort") if width >= 3 * n + 1 else ("position", "effort")
    )
    time = 0 if width > len(parts) * n else None
    first = 0 if time is None else 1
    names = joint_names or [f"joint_{k}" for k in range(1, n + 1)]
    joints: dict[str, Mapping[What, int]] = {
        name: {what: first + j * n + k for j, what in enumerate(parts) if first + j * n + k < width}
        for k, name in enumerate(names)
    }
    return Guess(time, joints, by_number=True)


LENGTHS = {"deg": "deg", "degree": "deg", "degrees": "deg", "rad": "rad"} | {
    "rev": "rev",
    "ticks": "ticks",
    "counts": "ticks",
    "mm": "mm",
}
SPELLED: Mapping[What, Mapping[str, str]] = {
    "position": LENGTHS,
    "motor_position": LENGTHS,
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
    """Return a guessed unit for the columns `values` (N samples, n joints) of a position, velocity or effort. If the
    names of the columns state a unit, it is returned.

    Otherwise, efforts are taken for N m and velocities for rad/s. Positions are taken for rad if they stay within 1.1
    revolutions, else for degrees.
    """
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
    """Return the unit that the names of the columns state; empty if they state none."""
    for name in names:
        prefix = name.partition(".")[0]
        if prefix in USUAL[what]:
            return USUAL[what][prefix]
        words = re.findall(r"[a-z]+", name.lower())
        hit = next((unit for word, unit in SPELLED[what].items() if word in words), "")
        if hit:
            return hit
    return ""


def velocity_unit(time: Array, position: Array, velocity: Array) -> str:
    """Return the unit in which velocities (N, n) are the slopes of positions (N, n) in rad; empty if none fits."""
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
    """Return the guessed unit of time, s, ms, us or ns, from the median period."""
    if len(time) < 2:
        return "s"
    period = float(np.median(np.diff(time)))
    return next((name for name, smallest in TIME_PERIODS if period >= smallest), "s")


def slope(link: Array, motor: Array) -> float:
    """Return the change of the motor's column per change of the link's, by least squares. It is zero if the two do not
    move together."""
    if len(link) < 3 or not (np.ptp(link) > 0 and np.ptp(motor) > 0):
        return 0.0
    link, motor = link - link.mean(), motor - motor.mean()
    both = float(link @ motor)
    return (
        both / float(link @ link)
        if both**2 > TOGETHER**2 * float(link @ link) * float(motor @ motor)
        else 0.0
    )
