"""Drafts a log description from the logs themselves, for `psdmc calibrate --describe`."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from psdmc.calibration.description.columns_found import USUAL, What
from psdmc.calibration.description.units import UNITS
from psdmc.calibration.logs.formats import format_of
from psdmc.calibration.logs.log import LARGEST_NUMBER, Array
from psdmc.calibration.logs.log_format import Columns, Opening
from psdmc.calibration.logs.wording import quoted
from psdmc.errors import InputError

WHATS: tuple[What, ...] = ("position", "velocity", "effort")
LONGEST_NAME = 100
"""Characters of a column's name in a draft; longer ones are given by number."""
MOST_LISTED = 200
"""Columns listed in a draft's head."""
MISSING = "?"
"""Stands for a column that was not found: reading such a description names the joint and the quantity."""

HEAD = (
    "# Log description, drafted by psdmc calibrate --describe. Everything below is a guess from the columns' names",
    "# and numbers: read it, correct it, then run psdmc calibrate MODEL.npz {name} -o OUT.npz",
    "# Every key: docs/log_description.md",
)
KEYS = (
    "# per joint, instead of a column alone: { column = ..., unit = ..., sign = -1, gear_ratio = 100, offset = 0,",
    "#   torque_constant = 0.1 (N m/A of the motor, before the gear), delay = 0.004 (s by which the column lags) }",
)


@dataclass(frozen=True, slots=True)
class Draft:
    """The text of a log description, and the joints with quantities for which no column was found, in words."""

    text: str
    missing: tuple[str, ...]


def drafted(
    paths: Sequence[Path], output: Path, joint_names: tuple[str, ...] | None, topic: str = ""
) -> Draft:
    """Return the draft of a log description that will be written to `output`, for logs with equal columns. The meaning
    of the columns is guessed from the first log.

    joint_names  joints of the model; None: the names in the log

    Raises InputError if a log cannot be read.
    """
    with format_of(paths[0]).columns(paths[0], Opening(topic=topic)) as columns:
        guess = guessed(columns.names, columns.width, joint_names)
        if not guess.joints:
            raise InputError(
                f"{paths[0]}: no column looks like a joint's: it has {columns.width} columns",
                "give the model, too: psdmc calibrate --describe MODEL.npz LOG; or write log.toml by hand",
            )
        values = _values(columns, guess)
        lines = [line.format(name=quoted_word(output.name)) for line in HEAD]
        lines += ["#", *_listing(columns), ""]
        for k, path in enumerate(paths):
            lines += ["[[log]]", f"file = {toml_text(_beside(path, output))}"]
            lines += [f"topic = {toml_text(topic)}"] if topic else []
            lines += (
                ['use = "fit"   # or "validate": held out as a whole', ""] if k == 0 else ['use = "fit"', ""]
            )
        lines += _time(columns, guess, values) + _quantities(columns, guess, values) + _joints(columns, guess)
    missing = tuple(
        f"{what} of {quoted(joint)}"
        for joint, places in guess.joints.items()
        for what in ("position", "effort")
        if what not in places
    )
    return Draft("\n".join(lines) + "\n", missing)


def toml_text(text: str) -> str:
    """Return a text in TOML's quotes. TOML has the escapes of JSON, and also requires one for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def quoted_word(text: str) -> str:
    """Return the name of a file as text for a TOML comment. The name is unchanged if all its characters are printable,
    else it is quoted and escaped."""
    return text if text.isprintable() else quoted(text)


def _beside(path: Path, output: Path) -> str:
    """A log's path as the description names it: relative to its folder, where that is possible."""
    try:
        return os.path.relpath(path, output.parent)
    except ValueError:  # another drive
        return str(path.absolute())


def _listing(columns: Columns) -> list[str]:
    if not columns.names:
        return [f"# {quoted_word(Path(columns.name).name)}: {columns.width} columns without names"]
    lines = [f"# columns of {quoted_word(Path(columns.name).name)}:"]
    lines += [f"#   {k}  {quoted(name)}" for k, name in enumerate(columns.names[:MOST_LISTED], start=1)]
    return lines


def _values(columns: Columns, guess: Guess) -> dict[int, Array]:
    """The first rows of the guessed columns, by place; empty where they are no numbers."""
    places = sorted({k for joint in guess.joints.values() for k in joint.values()} | _of(guess.time))
    try:
        first = next(iter(columns.rows(places, False)), np.zeros((0, len(places))))
    except InputError:
        return {}
    first = first[np.all(np.abs(first) < LARGEST_NUMBER, axis=1)]  # not a number compares as false
    return {place: first[:, k] for k, place in enumerate(places)}


def _of(place: int | None) -> set[int]:
    return set() if place is None else {place}


def _time(columns: Columns, guess: Guess, values: dict[int, Array]) -> list[str]:
    if guess.time is None:
        return [
            "[time]",
            "rate = 100   # Hz: no column looks like time: give the rate, or column and unit",
            "",
        ]
    unit = time_unit(values.get(guess.time, np.zeros(0)))
    return [
        "[time]",
        f"column = {_reference(columns, guess.time)}",
        f'unit = "{unit}"   # s, ms, us or ns',
        "",
    ]


def _quantities(columns: Columns, guess: Guess, values: dict[int, Array]) -> list[str]:
    lines = []
    for what in WHATS:
        places = [joint[what] for joint in guess.joints.values() if what in joint]
        if not places:
            continue
        unit = _unit(what, columns, guess, places, values)
        lines += [f"[{what}]", f'unit = "{unit}"   # {", ".join(UNITS[what])}']
        if what == "position" and unit == "ticks":
            lines.append("ticks_per_rev = 4096")
        if what == "effort":
            lines.append('# quantity = "joint_torque"   # where the torques are without friction')
        lines.append("")
    return lines


def _unit(what: What, columns: Columns, guess: Guess, places: Sequence[int], values: dict[int, Array]) -> str:
    names = [columns.names[k] for k in places] if columns.names else []
    own = np.column_stack([values[k] for k in places]) if values else np.zeros((0, len(places)))
    if what != "velocity" or spelled_unit(what, names) or not values or guess.time is None:
        return unit_of(what, names, own)
    both = [joint for joint in guess.joints.values() if "position" in joint and "velocity" in joint]
    position = np.column_stack([values[joint["position"]] for joint in both])
    velocity = np.column_stack([values[joint["velocity"]] for joint in both])
    said = [columns.names[joint["position"]] for joint in both] if columns.names else []
    size = UNITS["position"][unit_of("position", said, position)].size
    time = values[guess.time] * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[time_unit(values[guess.time])]
    return velocity_unit(time, position * size, velocity) or unit_of(what, names, own)


def _joints(columns: Columns, guess: Guess) -> list[str]:
    lines = [*KEYS]
    if guess.by_number:
        lines.append(
            "# the file has no header: numbers of columns are a guess, in the order time, position, velocity, effort"
        )
    for joint, places in guess.joints.items():
        lines += ["[[joint]]", f"name = {toml_text(joint)}"]
        for what in WHATS:
            if what in places:
                lines.append(f"{what} = {_reference(columns, places[what])}")
            elif what != "velocity":
                lines.append(f'{what} = "{MISSING}"   # no column was found: its name, or its number from 1')
        lines.append("")
    return lines


def _reference(columns: Columns, place: int) -> str:
    """A column's name where it is short, printable and the only one of that name; else its number."""
    name = columns.names[place] if columns.names else ""
    plain = 0 < len(name) <= LONGEST_NAME and name.isprintable() and columns.names.count(name) == 1
    return toml_text(name) if plain else str(place + 1)


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
    """A guess which columns of a log hold which quantities, as indices from 0.

    time       column of time; None if no column resembles time
    joints     columns by joint name, in the order of the model if it is known, else of the log
    by_number  True: the names of the columns gave no hint, and the guess follows only from the number of columns
    other      columns without a guess
    """

    time: int | None
    joints: Mapping[str, Mapping[What, int]]
    by_number: bool = False
    other: tuple[int, ...] = field(default=())


def guessed(names: Sequence[str], width: int, joint_names: Sequence[str] | None) -> Guess:
    """Return a guess which columns belong to which joints. Joints of the model without a column have no entries."""
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
            return USUAL[what][prefix][0]
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
