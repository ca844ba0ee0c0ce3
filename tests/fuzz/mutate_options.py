"""Robots with the options that they are read with, as JSON: {"robot": text, "options": {keyword of load_robot: value}}."""

from __future__ import annotations

import json
import re
from random import Random
from typing import Any

from mutate_bytes import mutate_bytes
from mutate_toml import mutate_toml
from mutate_tree import mutate_tree
from mutate_xml import mutate_xml
from nasty import anything, near, text

NUMBERS = (
    0,
    -0.0,
    0.5,
    -1,
    1e-9,
    3.2,
    7.0,
    1e3,
    1e6,
    1e155,
    1e300,
    5e-324,
    float("nan"),
    float("inf"),
    True,
    None,
    "1",
)
PARAMETERS = ("m", "mx", "mz", "Ixx", "Iyz", "Ixz@com", "rx", "Im", "x", "")
SNAPS = (0, 1e-5, 1e-9, 0.1, 0.2, -1, float("nan"), "0", None)

KEYWORDS = (
    "base",
    "tip",
    "gravity",
    "drive_inertia",
    "assume_zero",
    "snap",
    "frames",
    "tool",
    "lock",
    "floating",
)


def robot_and_options(data: bytes) -> tuple[str, dict[str, Any]] | None:
    """The text and the keyword arguments; None where these bytes hold no such thing."""
    try:
        whole = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(whole, dict):
        return None
    robot, options = whole.get("robot"), whole.get("options")
    if not isinstance(robot, str) or not isinstance(options, dict):
        return None
    return robot, {name: value for name, value in options.items() if name in KEYWORDS}


def mutate_options(data: bytes, rng: Random) -> bytes:
    given = robot_and_options(data)
    if given is None or rng.random() < 0.02:
        return mutate_bytes(data, rng)
    robot, options = given
    if rng.random() < 0.4:
        mutate = mutate_xml if robot.lstrip().startswith("<") else mutate_toml
        robot = mutate(robot.encode(errors="replace"), rng).decode(errors="replace")
    for _ in range(rng.choice((0, 1, 1, 2))):
        options = _one_edit(options, robot, rng)
    return json.dumps({"robot": robot, "options": options}).encode()


def _one_edit(options: dict[str, Any], robot: str, rng: Random) -> dict[str, Any]:
    choice = rng.randrange(8)
    if choice == 0 and options:
        return {name: value for name, value in options.items() if name != rng.choice(list(options))}
    if choice == 1:
        edited = mutate_tree(options, rng)
        return edited if isinstance(edited, dict) else {}
    name = rng.choice(KEYWORDS)
    return options | {name: anything(rng) if choice == 2 else _value(name, robot, rng)}


def _value(keyword: str, robot: str, rng: Random) -> Any:
    """Of the kind that this option has, with names of the robot's."""
    if keyword in ("base", "tip"):
        return _name(robot, rng)
    if keyword == "frames":
        return [_name(robot, rng) for _ in range(rng.randrange(4))]
    if keyword == "lock":
        return {_name(robot, rng): _number(rng) for _ in range(rng.randrange(1, 4))}
    if keyword == "floating":
        return rng.choice((True, True, False, 1, "yes"))
    if keyword == "assume_zero":
        return [f"{_name(robot, rng)}:{rng.choice(PARAMETERS)}" for _ in range(rng.randrange(3))]
    if keyword == "snap":
        return rng.choice(SNAPS)
    if keyword == "drive_inertia" and rng.random() < 0.3:
        return rng.choice((True, False))
    count = {"gravity": 3, "tool": 6}.get(keyword, rng.randrange(1, 6))
    return [_number(rng) for _ in range(count + rng.choice((0, 0, 0, 0, 1, -1)))]


def _name(robot: str, rng: Random) -> str:
    found = re.findall(r"(?:name|link) *= *[\"']([^\"']*)", robot)
    return rng.choice(found) if found and rng.random() < 0.9 else text(rng)


def _number(rng: Random) -> Any:
    if rng.random() < 0.8:
        return round(rng.uniform(-1.0, 1.0), 3)
    if rng.random() < 0.5:
        return rng.choice(NUMBERS)
    word = near("0.5", rng)
    try:
        return float(word)
    except ValueError:
        return word
