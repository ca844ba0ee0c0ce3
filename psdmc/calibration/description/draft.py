"""The first draft of a log description, from the logs themselves: `psdmc calibrate --describe`."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psdmc.calibration.description.columns_found import What
from psdmc.calibration.description.draft_columns import Guess, guessed
from psdmc.calibration.description.draft_units import spelled_unit, time_unit, unit_of, velocity_unit
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
    "#   torque_constant = 0.1 (N m/A of the motor), delay = 0.004 (s by which the column lags) }",
)


@dataclass(frozen=True, slots=True)
class Draft:
    """The text of a description, and joints with their quantities for which no column was found, in words."""

    text: str
    missing: tuple[str, ...]


def drafted(
    paths: Sequence[Path], output: Path, joint_names: tuple[str, ...] | None, topic: str = ""
) -> Draft:
    """The description of logs of one form, which `output` is to hold; columns are guessed from the first.

    joint_names  of the model; None: the log's own names

    InputError where a log cannot be read.
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
    """A TOML string: JSON's escapes are TOML's, except that TOML also requires one for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def quoted_word(text: str) -> str:
    """A file's name in a comment: as it is where it is printable."""
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
