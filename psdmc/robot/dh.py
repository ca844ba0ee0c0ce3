"""A DH robot's TOML file as plain data, every entry checked."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from psdmc.errors import InputError
from psdmc.robot.chain import JointKind, Limits
from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.names import naming_faults
from psdmc.robot.zeros import ZERO_NAMES

Convention = Literal["standard", "modified"]
Triple = tuple[float, float, float]

ROBOT_KEYS = ("name", "convention", "gravity", "joint")
JOINT_KEYS = ("name", "type", "a", "alpha", "d", "theta", "limits", "drive_inertia", "link")
LIMIT_KEYS = ("position", "speed", "acceleration", "effort")
LINK_KEYS = ("mass", "com", "inertia_com", "zero")

UNKNOWN = math.nan


@dataclass(frozen=True, slots=True)
class DhLink:
    """mass kg; com m in the link's frame; inertia_com kg m^2 about it (INERTIA_NAMES); NaN where unknown."""

    mass: float = UNKNOWN
    com: Triple = (UNKNOWN, UNKNOWN, UNKNOWN)
    inertia_com: tuple[float, ...] = (UNKNOWN,) * len(INERTIA_NAMES)
    zero: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DhJoint:
    """One row of the table: a, d in m, alpha, theta in rad; drive_inertia in kg m^2 (kg), NaN if unknown."""

    name: str
    kind: JointKind
    a: float
    alpha: float
    d: float
    theta: float
    limits: Limits
    drive_inertia: float | None
    link: DhLink


@dataclass(frozen=True, slots=True)
class DhRobot:
    """gravity in m/s^2 in the base frame."""

    name: str
    convention: Convention
    gravity: Triple
    joints: tuple[DhJoint, ...]


def read_dh(text: str, source: str) -> DhRobot:
    """The file's content; InputError names everything that is wrong with it at once."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: not a TOML file: {error}", "give a URDF or a DH .toml file") from None
    problems: list[str] = []
    robot = _robot(table, problems)
    if problems or robot is None:
        raise InputError(f"{source}: " + "; ".join(problems), "see the DH format in docs/notation.md")
    return robot


def angle(value: object) -> float:
    """rad, from a number (rad) or a text such as "90 deg" or "1.5 rad"; ValueError on anything else."""
    if not isinstance(value, str):
        return finite(value)
    number_text, unit = value.strip()[:-3], value.strip()[-3:]
    if unit not in ("deg", "rad"):
        raise ValueError(f"'{value}' is no angle: write radians, or \"90 deg\"")
    try:
        number = finite(float(number_text))
    except ValueError:
        raise ValueError(f"'{value}' is no angle: write radians, or \"90 deg\"") from None
    return math.radians(number) if unit == "deg" else number


def finite(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"found {value!r}, expected a finite number")
    return float(value)


class _Table:
    """One TOML table that is read key by key; what is wrong goes to `problems`, under the table's name."""

    def __init__(self, value: object, where: str, keys: tuple[str, ...], problems: list[str]) -> None:
        self.where, self.problems = where, problems
        self.table: Mapping[str, Any] = value if isinstance(value, dict) else {}
        if not isinstance(value, dict):
            problems.append(f"{where}: found {value!r}, expected a table")
        for key in self.table:
            if key not in keys:
                problems.append(f"{where}: unknown key '{key}' (known: {', '.join(keys)})")

    def read(self, key: str, convert: Callable[[Any], Any], default: Any) -> Any:
        """The converted value, or `default` where it is missing or wrong."""
        if key not in self.table:
            return default
        try:
            return convert(self.table[key])
        except ValueError as error:
            self.problems.append(f"{self.where}: {key}: {error}")
            return default


def _robot(value: object, problems: list[str]) -> DhRobot | None:
    table = _Table(value, "robot", ROBOT_KEYS, problems)
    rows = table.read("joint", _list, [])
    if not rows:
        problems.append("no [[joint]] in it")
        return None
    joints = tuple(_joint(row, number, problems) for number, row in enumerate(rows, start=1))
    problems += naming_faults([joint.name for joint in joints], "joint")
    return DhRobot(
        name=table.read("name", _text, "robot"),
        convention=table.read("convention", _one_of("standard", "modified"), "standard"),
        gravity=table.read("gravity", _triple, (0.0, 0.0, -9.81)),
        joints=joints,
    )


def _joint(value: object, number: int, problems: list[str]) -> DhJoint:
    given = value.get("name") if isinstance(value, dict) else None
    name = given if isinstance(given, str) and given else f"joint{number}"
    table = _Table(value, f"joint '{name}'", JOINT_KEYS, problems)
    table.read("name", _text, "")
    kind: JointKind = table.read("type", _one_of("revolute", "prismatic"), "revolute")
    return DhJoint(
        name=name,
        kind=kind,
        a=table.read("a", finite, 0.0),
        alpha=table.read("alpha", angle, 0.0),
        d=table.read("d", finite, 0.0),
        theta=table.read("theta", angle, 0.0),
        limits=_limits(table.read("limits", _same, {}), kind, f"{table.where} limits", problems),
        drive_inertia=table.read("drive_inertia", _drive_inertia, None),
        link=_link(table.read("link", _same, {}), f"{table.where} link", problems),
    )


def _limits(value: object, kind: JointKind, where: str, problems: list[str]) -> Limits:
    table = _Table(value, where, LIMIT_KEYS, problems)
    convert = angle if kind == "revolute" else finite
    lower, upper = table.read("position", _range_of(convert), (-math.inf, math.inf))
    speed, acceleration, effort = (
        table.read(key, reader, math.inf)
        for key, reader in (("speed", convert), ("acceleration", convert), ("effort", finite))
    )
    return Limits(lower, upper, speed, acceleration, effort)


def _link(value: object, where: str, problems: list[str]) -> DhLink:
    table = _Table(value, where, LINK_KEYS, problems)
    inertia = _Table(table.read("inertia_com", _same, {}), f"{where} inertia_com", INERTIA_NAMES, problems)
    return DhLink(
        mass=table.read("mass", _not_negative, UNKNOWN),
        com=table.read("com", _triple, (UNKNOWN,) * 3),
        inertia_com=tuple(inertia.read(name, finite, UNKNOWN) for name in INERTIA_NAMES),
        zero=table.read("zero", _zero_names, ()),
    )


def _same(value: object) -> object:
    return value


def _text(value: object) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError(f"found {value!r}, expected a text")
    return value


def _list(value: object) -> list[object]:
    if not isinstance(value, list):
        raise ValueError(f"found {value!r}, expected a list")
    return value


def _triple(value: object) -> Triple:
    values = _list(value)
    if len(values) != 3:
        raise ValueError(f"found {value!r}, expected three numbers")
    x, y, z = (finite(v) for v in values)
    return (x, y, z)


def _not_negative(value: object) -> float:
    number = finite(value)
    if number < 0.0:
        raise ValueError(f"found {number:g}, expected no less than zero")
    return number


def _drive_inertia(value: object) -> float:
    return UNKNOWN if value == "unknown" else _not_negative(value)


def _zero_names(value: object) -> tuple[str, ...]:
    names = tuple(_text(name) for name in _list(value))
    unknown = [name for name in names if name not in ZERO_NAMES]
    if unknown:
        raise ValueError(f"unknown {', '.join(unknown)} (known: {', '.join(ZERO_NAMES)})")
    return names


def _one_of(*words: str) -> Callable[[object], str]:
    def convert(value: object) -> str:
        if value not in words:
            raise ValueError(f"found {value!r}, expected one of {', '.join(words)}")
        return str(value)

    return convert


def _range_of(convert: Callable[[Any], float]) -> Callable[[object], tuple[float, float]]:
    def read(value: object) -> tuple[float, float]:
        values = _list(value)
        if len(values) != 2 or convert(values[0]) > convert(values[1]):
            raise ValueError(f"found {value!r}, expected [lower, upper]")
        return convert(values[0]), convert(values[1])

    return read
