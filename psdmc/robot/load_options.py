"""The options that define a robot together with its file, such as base, tip and gravity, with checks of every value."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from psdmc.errors import InputError
from psdmc.robot import limits
from psdmc.robot.limits import shown

DEFAULT_SNAP = 1e-5
"""rad: pi/2 written as 1.5708 is 3.7e-6 away, pi as 3.1416 is 7.3e-6; no arm is calibrated that finely."""

LATER = ("contacts", "loops", "frames", "tool", "lock", "floating", "root", "xacro_args", "unknown")
"""Options that the first versions did not have."""

TOOL = "tool"
"""Name of the frame that the option `tool` places."""

POINT, SURFACE = 3, 6
"""Rows of a contact: its point is held, or its orientation too."""

MAX_SNAP = 0.1
"""rad: a robot whose axes may move by more is another robot."""


@dataclass(frozen=True, slots=True)
class LoadOptions:
    """The options that define the robot together with the file. All are plain values, which a model file can contain,
    so the robot can be read again.

    base, tip      names of the first and last link of a chain in a URDF; None for both: the whole robot
    gravity        m/s^2 in the URDF's root frame or the DH base frame; None: the file's own, or (0, 0, -9.81)
    drive_inertia  True: the drive inertia of each joint is a parameter of unknown value; numbers: the values, one per
                   joint, kg m^2 (kg)
    assume_zero    parameters assumed zero, such as "link5:mx" or "link5:Ixz@com"
    snap           rad; 0 keeps the file's rotations except for floating-point noise
    frames         names of the links whose frames become named frames, for which psdmc generates poses and Jacobians;
                   empty: the tip
    tool           x y z (m), roll pitch yaw (rad) of an additional frame 'tool' in the tip frame; None: no such frame
    lock           joints of a URDF that are locked: positions by name, rad or m
    floating       whether the root link of a URDF is on a free joint
    root           the robot's first body in an MJCF with several separate bodies; None: all bodies
    xacro_args     values of a xacro file's arguments
    unknown        links of a URDF whose inertia is unknown, whatever the file says; "all", or "missing": links without
                   any
    contacts       frames that can touch the world, which `frames` contains: "foot" is a point, "foot:6" a surface
    loops          tables of closed loops (closed_loops.py), in addition to those of the file
    """

    base: str | None = None
    tip: str | None = None
    gravity: tuple[float, float, float] | None = None
    drive_inertia: bool | tuple[float, ...] = False
    assume_zero: tuple[str, ...] = ()
    snap: float = DEFAULT_SNAP
    frames: tuple[str, ...] = ()
    tool: tuple[float, ...] | None = None
    lock: dict[str, float] = field(default_factory=dict)
    floating: bool = False
    root: str | None = None
    xacro_args: dict[str, str] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    loops: tuple[Mapping[str, Any], ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the keyword arguments of load_robot_text as plain JSON values.

        Options that newer versions added are included only if they are used. So models without them keep the hash of
        earlier versions.
        """
        plain = asdict(self)
        return {name: value for name, value in plain.items() if name not in LATER or value}


def checked_options(**given: Any) -> LoadOptions:
    """Return the options as LoadOptions after a check of every value. Raises InputError for the first wrong option."""
    options = LoadOptions(
        **{name: CHECKS[name](value) if name in CHECKS else value for name, value in given.items()}
    )
    options = _with_contacts(options)
    if options.floating and (options.base is not None or options.tip is not None):
        raise InputError(
            "--floating puts the whole robot on a free joint, --base and --tip cut a chain out of it",
            "leave --base and --tip out; --lock holds joints",
        )
    return options


def _name_of(option: str, what: str) -> Callable[[object], str | None]:
    def checked(value: object) -> str | None:
        if value is not None and not isinstance(value, str):
            raise InputError(f"{option} is {shown(value)}, expected a {what}'s name", "give a text")
        return value

    return checked


def _texts(values: Any, said: str, expected: str, hint: str) -> tuple[str, ...]:
    """Check a list of texts. One text is refused, as a sequence of others; so are tables and sets, whose order says
    nothing."""
    if isinstance(values, str | Mapping | Set | Iterator) or not _all_are_texts(values):
        raise InputError(f"{said} {shown(values)}, expected {expected}", hint)
    return tuple(values)


def _floating(floating: object) -> bool:
    if not isinstance(floating, bool):
        raise InputError(f"floating is {shown(floating)}, expected True or False", "the default is False")
    return floating


def _each_once(what: str, names: Sequence[str]) -> None:
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    if twice:
        raise InputError(f"{what} {shown(twice[0])} is named twice", "name each once")


def _frames(frames: object) -> tuple[str, ...]:
    found = _texts(frames, "frames are", "links' names", "such as tcp,camera")
    _each_once("frame", found)
    return found


def parsed_contact(text: str) -> tuple[str, int]:
    """Return a contact's name and rows from a text: "lf_foot" (a point, 3) or "lf_foot:6" (a surface, 6)."""
    name, colon, rows = text.rpartition(":")
    if not colon or not rows.isdecimal():
        return text, POINT
    if rows not in (str(POINT), str(SURFACE)):
        raise InputError(
            f"contact {shown(text)} has {shown(rows)} rows, expected {POINT} or {SURFACE}",
            f"{shown(name + ':3')} is a point, {shown(name + ':6')} a surface",
        )
    return name, int(rows)


def _contacts(contacts: object) -> tuple[str, ...]:
    found = _texts(contacts, "contacts are", "links' names", 'such as ["lf_foot", "rf_foot:6"]')
    _each_once("contact", [parsed_contact(text)[0] for text in found])
    return found


def _loops(tables: object) -> tuple[Mapping[str, Any], ...]:
    """Plain tables with lists and numbers for NumPy's; their contents are checked with the robot's links."""
    plain = _plain(tables)
    faults = [
        (number, key, value)
        for number, table in enumerate(tables if isinstance(tables, list | tuple) else (), start=1)
        if isinstance(table, Mapping)
        for key, value in table.items()
        if _plain([value]) is None
    ]
    if plain is None and faults:
        number, key, value = faults[0]
        raise InputError(
            f"loops: table {number}: {key} is {shown(value)}, expected texts and finite numbers",
            "give lists, texts and numbers, as in TOML",
        )
    if not isinstance(plain, list) or not all(isinstance(table, dict) for table in plain):
        raise InputError(
            f"loops are {shown(tables)}, expected tables of loops",
            'such as [{"rows": ["x", "z"], "first": "link3", "second": "base"}], or the path of a TOML file',
        )
    return tuple(plain)


def _plain(value: object) -> Any:
    """A value as JSON gives it back; None if JSON cannot hold it."""
    try:
        return json.loads(json.dumps(value, allow_nan=False, default=lambda own: own.tolist()))
    except (AttributeError, TypeError, ValueError, RecursionError):
        return None


def _with_contacts(options: LoadOptions) -> LoadOptions:
    """The options whose frames have those of the contacts behind them; `tool` places a frame of its own."""
    names = [parsed_contact(text)[0] for text in options.contacts]
    tool = () if options.tool is None else (TOOL,)
    frames = (*options.frames, *(name for name in names if name not in (*options.frames, *tool)))
    placed = [name for name in (*frames, *tool) if name in names]
    if placed != names:
        raise InputError(
            f"contacts are in the order {', '.join(map(shown, names))}, the same frames in the order "
            f"{', '.join(map(shown, placed))}",
            f"name frames and contacts in one order{f', {shown(TOOL)} last' if tool else ''}",
        )
    return replace(options, frames=frames)


def _tool(tool: Sequence[float] | None) -> tuple[float, ...] | None:
    if tool is None:
        return None
    values = _floats(tool)
    if values is None or len(values) != 6:
        raise InputError(
            f"tool {_listed(tool)} is not six finite numbers", "x y z in m, roll pitch yaw in rad"
        )
    ranges = (*[limits.LENGTH] * 3, *[limits.ANGLE] * 3)
    faults = [
        f"{value:g} {fault}" for of, value in zip(ranges, values, strict=True) if (fault := of.fault(value))
    ]
    if faults:
        raise InputError(f"tool: {faults[0]}", "x y z in m, roll pitch yaw in rad")
    return values


def _lock(lock: Mapping[str, float] | None) -> dict[str, float]:
    if lock is None:
        return {}
    hint = 'such as {"elbow": 0.5}, in rad or m'
    if not isinstance(lock, Mapping) or not _all_are_texts(lock):
        raise InputError(f"lock is {shown(lock)}, expected positions by joint", hint)
    values = _floats(lock.values())
    if values is None:
        raise InputError(f"lock is {shown(dict(lock))}, expected finite positions", hint)
    return dict(zip(lock, values, strict=True))


def _xacro_args(given: Mapping[str, object] | None) -> dict[str, str]:
    """Values as texts, as they are on a command line."""
    if given is None:
        return {}
    if (
        not isinstance(given, Mapping)
        or not _all_are_texts(given)
        or not all(isinstance(value, str | int | float) for value in given.values())
    ):
        raise InputError(
            f"xacro_args is {shown(given)}, expected texts or numbers by argument", 'such as {"name": "ur5e"}'
        )
    return {
        name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in given.items()
    }


def _all_are_texts(values: object) -> bool:
    return isinstance(values, Iterable) and all(isinstance(value, str) for value in values)


def _gravity(gravity: Sequence[float] | None) -> tuple[float, float, float] | None:
    if gravity is None:
        return None
    hint = "for example --gravity 0 0 -9.81"
    values = _floats(gravity)
    if values is None or len(values) != 3:
        raise InputError(f"gravity {_listed(gravity)} is not three finite numbers", hint)
    fault = limits.gravity_fault(values)
    if fault:
        raise InputError(f"gravity {_listed(values)} {fault}", hint)
    return (values[0], values[1], values[2])


def _drive_inertia(drive_inertia: bool | Sequence[float]) -> bool | tuple[float, ...]:
    if isinstance(drive_inertia, bool):
        return drive_inertia
    values = _floats(drive_inertia)
    if values is None or not all(value >= 0.0 for value in values):
        found = _listed(drive_inertia)
        raise InputError(f"drive inertias {found} are not all finite and positive", "in kg m^2 (kg)")
    faults = [f"{value:g} {fault}" for value in values if (fault := limits.DRIVE_INERTIA.fault(value))]
    if faults:
        raise InputError(f"drive inertia {faults[0]}", "in kg m^2 (kg)")
    return values


def _snap(snap: float) -> float:
    if not isinstance(snap, int | float) or not 0.0 <= snap <= MAX_SNAP:
        raise InputError(
            f"snap is {shown(snap)} rad, expected 0 to {MAX_SNAP:g}", f"the default is {DEFAULT_SNAP:g}"
        )
    return float(snap)


def _floats(values: object) -> tuple[float, ...] | None:
    """Finite floats from a sequence, None where it is none or holds something else."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        return None
    try:
        found = tuple(float(value) for value in values)
    except (TypeError, ValueError, OverflowError):
        return None
    return found if all(math.isfinite(value) for value in found) else None


def _listed(values: object) -> str:
    return (
        shown(list(values)) if isinstance(values, Iterable) and not isinstance(values, str) else shown(values)
    )


CHECKS: dict[str, Callable[[Any], Any]] = {
    "base": _name_of("base", "link"),
    "tip": _name_of("tip", "link"),
    "root": _name_of("root", "body"),
    "assume_zero": lambda texts: _texts(texts, "assume-zero is", "texts", "such as link5:mx"),
    "unknown": lambda links: tuple(
        dict.fromkeys(_texts(links, "unknown is", "links' names", 'such as ["forearm"], or "all"'))
    ),
    "floating": _floating,
    "drive_inertia": _drive_inertia,
    "gravity": _gravity,
    "snap": _snap,
    "frames": _frames,
    "contacts": _contacts,
    "loops": _loops,
    "tool": _tool,
    "lock": _lock,
    "xacro_args": _xacro_args,
}
"""By option: what checks its value and returns it as LoadOptions holds it."""
