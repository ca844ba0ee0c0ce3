"""Drafts a log description from the logs themselves, for `psdmc calibrate --describe`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psdmc.calibration.description.guess import (
    GEARLESS,
    Guess,
    guessed,
    slope,
    spelled_unit,
    time_unit,
    unit_of,
    velocity_unit,
)
from psdmc.calibration.description.joint_tables import TIME_UNITS, UNITS, What
from psdmc.calibration.logs.foreign_bytes import quoted
from psdmc.calibration.logs.formats import format_of
from psdmc.calibration.logs.log import LARGEST_NUMBER, Array
from psdmc.calibration.logs.log_format import Columns, Opening
from psdmc.calibration.logs.toml_tables import toml_text
from psdmc.errors import InputError

WHATS: tuple[What, ...] = ("position", "velocity", "effort", "motor_position")
REQUIRED: tuple[What, ...] = ("position", "effort")
LONGEST_NAME = 100
"""Characters of a column's name in a draft; longer ones are given by number."""
MOST_LISTED = 200
"""Columns listed in a draft's head."""
MISSING = "?"
"""Stands for a column that was not found: reading such a description names the joint and the quantity."""

HEAD = """\
# Log description, drafted by psdmc calibrate --describe. Everything below is a guess from the columns' names
# and numbers: read it, correct it, then run psdmc calibrate MODEL.npz {name} -o OUT.npz
# Every key: docs/log_description.md
#"""
KEYS = """\
# per joint, instead of a column alone: { column = ..., unit = ..., sign = -1, gear_ratio = 100, offset = 0,
#   torque_constant = 0.1 (N m/A of the motor, before the gear), delay = 0.004 (s by which the column lags) }"""


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
        lines = [HEAD.format(name=_quoted_word(output.name)), *_listing(columns), ""]
        for k, path in enumerate(paths):
            lines += ["[[log]]", f"file = {toml_text(_beside(path, output))}"]
            lines += [f"topic = {toml_text(topic)}"] if topic else []
            lines += ['use = "fit"' + ("" if k else '   # or "validate": held out as a whole'), ""]
        lines += _time(columns, guess, values) + _quantities(columns, guess, values)
        lines += _joints(columns, guess, values)
    missing = tuple(
        f"{what} of {quoted(joint)}"
        for joint, places in guess.joints.items()
        for what in REQUIRED
        if what not in places
    )
    return Draft("\n".join(lines) + "\n", missing)


def _quoted_word(text: str) -> str:
    """The name of a file for a TOML comment: quoted and escaped if some of its characters are not printable."""
    return text if text.isprintable() else quoted(text)


def _beside(path: Path, output: Path) -> str:
    """A log's path as the description names it: relative to its folder, where that is possible."""
    try:
        return os.path.relpath(path, output.parent)
    except ValueError:  # another drive
        return str(path.absolute())


def _listing(columns: Columns) -> list[str]:
    if not columns.names:
        return [f"# {_quoted_word(Path(columns.name).name)}: {columns.width} columns without names"]
    lines = [f"# columns of {_quoted_word(Path(columns.name).name)}:"]
    lines += [f"#   {k}  {quoted(name)}" for k, name in enumerate(columns.names[:MOST_LISTED], start=1)]
    return lines


def _values(columns: Columns, guess: Guess) -> dict[int, Array]:
    """The first rows of the guessed columns, by place; empty where they are no numbers."""
    of_joints = {k for joint in guess.joints.values() for k in joint.values()}
    places = sorted(of_joints if guess.time is None else of_joints | {guess.time})
    try:
        first = next(iter(columns.rows(places, False)), np.zeros((0, len(places))))
    except InputError:
        return {}
    first = first[np.all(np.abs(first) < LARGEST_NUMBER, axis=1)]  # not a number compares as false
    return {place: first[:, k] for k, place in enumerate(places)}


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
        places = _places(guess, what)
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
    if what == "motor_position" and not spelled_unit(what, names):  # a motor makes many turns, in any unit
        return _unit("position", columns, guess, _places(guess, "position"), values)
    own = np.column_stack([values[k] for k in places]) if values else np.zeros((0, len(places)))
    if what != "velocity" or spelled_unit(what, names) or not values or guess.time is None:
        return unit_of(what, names, own)
    both = [joint for joint in guess.joints.values() if "position" in joint and "velocity" in joint]
    position = np.column_stack([values[joint["position"]] for joint in both])
    velocity = np.column_stack([values[joint["velocity"]] for joint in both])
    said = [columns.names[joint["position"]] for joint in both] if columns.names else []
    size = UNITS["position"][unit_of("position", said, position)].size
    time = values[guess.time] * TIME_UNITS[time_unit(values[guess.time])].size
    return velocity_unit(time, position * size, velocity) or unit_of(what, names, own)


def _places(guess: Guess, what: What) -> list[int]:
    return [joint[what] for joint in guess.joints.values() if what in joint]


def _joints(columns: Columns, guess: Guess, values: dict[int, Array]) -> list[str]:
    lines = [KEYS]
    if guess.by_number:
        lines.append(
            "# the file has no header: numbers of columns are a guess, in the order time, position, velocity, effort"
        )
    for joint, places in guess.joints.items():
        lines += ["[[joint]]", f"name = {toml_text(joint)}"]
        for what in WHATS:
            if what == "motor_position" and what in places:
                lines.append(_motor(columns, guess, values, places))
            elif what in places:
                lines.append(f"{what} = {_reference(columns, places[what])}")
            elif what in REQUIRED:
                lines.append(f'{what} = "{MISSING}"   # no column was found: its name, or its number from 1')
        lines.append("")
    return lines


def _motor(columns: Columns, guess: Guess, values: dict[int, Array], places: Mapping[What, int]) -> str:
    """The line of a joint's motor_position. The gear ratio is that of the numbers: motion of the motor over the link's."""
    reference = _reference(columns, places["motor_position"])
    sides: tuple[What, ...] = ("position", "motor_position")
    units = [_unit(what, columns, guess, _places(guess, what), values) for what in sides]
    ratio = slope(*(values.get(places[what], np.zeros(0)) for what in sides))
    ratio *= UNITS["position"][units[1]].size / UNITS["position"][units[0]].size
    if "ticks" in units or not ratio or abs(ratio - 1.0) < GEARLESS:
        return f"motor_position = {reference}"
    nearest = round(abs(ratio)) if abs(ratio) >= 1.0 else abs(ratio)
    sign = ", sign = -1" if ratio < 0 else ""
    note = f"the numbers give {ratio:.4g}: write the gear's own ratio"
    return f"motor_position = {{ column = {reference}, gear_ratio = {nearest:.6g}{sign} }}   # {note}"


def _reference(columns: Columns, place: int) -> str:
    """A column's name where it is short, printable and the only one of that name; else its number."""
    name = columns.names[place] if columns.names else ""
    plain = 0 < len(name) <= LONGEST_NAME and name.isprintable() and columns.names.count(name) == 1
    return toml_text(name) if plain else str(place + 1)
