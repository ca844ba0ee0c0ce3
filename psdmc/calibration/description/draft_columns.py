"""Guesses at what a log's columns are, from their names or, without names, from their number."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from psdmc.calibration.description.columns_found import USUAL, What

WORDS: Mapping[What, tuple[str, ...]] = {
    "velocity": ("qd", "dq", "qdot", "vel", "velocity", "velocities", "speed", "omega", "rpm", "qp"),
    "effort": (
        "tau",
        "torque",
        "torques",
        "trq",
        "tq",
        "effort",
        "efforts",
        "current",
        "currents",
        "cur",
        "curr",
        "amp",
        "ampere",
        "iq",
        "i",
        "moment",
        "force",
        "load",
    ),
    "position": (
        *("q", "pos", "position", "positions", "angle", "angles", "theta", "enc", "encoder", "ang", "p"),
        *("deg", "degrees", "rad", "ticks", "counts"),
    ),
}
"""Words in the names of columns; velocity before position, as 'qd' begins with 'q'."""
COMMANDED = (
    "target",
    "desired",
    "des",
    "ref",
    "reference",
    "cmd",
    "command",
    "setpoint",
    "goal",
    "setp",
    "error",
)
"""Words of what was asked for, not measured."""
TIMES = (
    "time_s",
    "time",
    "t",
    "timestamp",
    "stamp",
    "sec",
    "seconds",
    "ms",
    "millis",
    "date",
    "datetime",
    "when",
)


@dataclass(frozen=True, slots=True)
class Guess:
    """Places of columns (from 0). time: None where none looks like it; joints: by name, in the model's order where it is
    known, else in the log's; `by_number` where nothing but the number of columns told."""

    time: int | None
    joints: Mapping[str, Mapping[What, int]]
    by_number: bool = False
    other: tuple[int, ...] = field(default=())


def guessed(names: Sequence[str], width: int, joint_names: Sequence[str] | None) -> Guess:
    """What the columns look like; joints that the model has and no column was found for have no places."""
    if not names:
        return _by_number(width, joint_names)
    time = next((k for word in TIMES for k, name in enumerate(names) if _plain(name) == word), None)
    if time is None:
        time = next((k for k, name in enumerate(names) if set(_words(name)) & set(TIMES)), None)
    found: dict[str, dict[What, int]] = {}
    for place, name in enumerate(names):
        read = None if place == time else _read(name, joint_names)
        if read is not None:
            what, joint = read
            found.setdefault(joint, {}).setdefault(what, place)
    return Guess(time, _by_joint(found, joint_names))


def _plain(name: str) -> str:
    return re.sub(r"\s*[\[(].*", "", name.strip().lower())


def _words(name: str) -> list[str]:
    """Parts of a name, in lower case: 'actual_qd_3' is actual, qd, 3; 'jointPos[2]' joint, pos, 2."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return re.findall(r"[a-z]+|\d+", spaced.lower())


def _read(name: str, joint_names: Sequence[str] | None) -> tuple[What, str] | None:
    """Quantity and joint of a column: the joint by its name, else by its number."""
    for what, prefixes in USUAL.items():
        prefix, _, joint = name.partition(".")
        if prefix in prefixes and joint:
            return what, joint
    left = name
    owner = _owner(name, joint_names)
    if owner is not None:
        left = name.replace(owner, " ", 1)
    words = _words(left)
    if set(words) & set(COMMANDED):
        return None
    meant = [what for what, known in WORDS.items() if set(words) & set(known)]
    numbers = [word for word in words if word.isdigit()]
    if not meant or (owner is None and not numbers):
        return None
    return meant[0], owner if owner is not None else f"#{int(numbers[-1])}"


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
    """By the model's joints: what has their name, else numbered columns in order."""
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
