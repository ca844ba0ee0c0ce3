"""Reads the files of a virtual (simulated) robot. These are the plant file with motors, friction, sensors and cable
harness, and the DH table or URDF that it names.

This module has its own code to read a DH table, and Pinocchio reads a URDF. So the virtual robot shares no code with
the calibration that it tests.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.calibration.logs.foreign_bytes import LARGEST_TOML, SHORTER, decoding, listed, opened, quoted
from psdmc.calibration.logs.toml_tables import (
    TomlTable,
    is_number,
    read_toml,
    require_none,
    shown,
    toml_content,
)
from psdmc.errors import InputError
from psdmc.files import read_rest
from psdmc.friction.law import Term
from psdmc.friction.laws import LAWS
from psdmc.friction.own import laws_of, read_law
from psdmc.friction.terms import WITH_STATE, named
from psdmc.robot.dh import read_dh
from psdmc.robot.urdf.read_urdf import read_urdf
from psdmc.robot.urdf.tree import default_tip

Triple = tuple[float, float, float]
WHAT = "a plant (.toml), such as examples/plants/denso_virtual.toml"
HINT = "compare it with examples/plants/denso_virtual.toml"

KEYS = ("robot", "tip", "sensors", "harness", "friction", "sign_speed", "joint")
SIGN_SPEED = 0.03
"""rad/s (m/s) over which friction without a state changes sign."""
SMALLEST, LARGEST = 1e-9, 1e9
"""Of a motor's or friction's numbers in SI: wider than any joint, narrow enough that nothing overflows."""
LARGEST_DELAY = 1.0
"""s, between a motion and its current."""
FINEST = 1e-12
"""rad or A, step of a sensor: doubles of ordinary angles cannot represent finer ones."""
LARGEST_LENGTH = 1e3
"""m, of a link;  also m/s^2 of gravity."""
LARGEST_BODY = 1e6
"""kg, kg m^2 of a link or drive."""
ROUNDED = 1e-12
"""Share of an inertia's largest entry by which a principal moment may be negative: rounding."""
ENCODERS = ("both", "motor", "link")
"""Sides of an elastic joint whose position a robot measures."""
MOVABLE = ("revolute", "continuous", "prismatic")
"""Types of a URDF's joints that a plant can move."""
SLIDES = {"revolute": False, "prismatic": True}
"""By a row's type."""
LARGEST_URDF = 16 * 1024**2
"""Bytes: a thousand times an ordinary robot's."""
LARGEST_PLANT = 100
"""Joints of a virtual robot."""


@dataclass(frozen=True, slots=True)
class JointTruth:
    """The motor and friction of one joint: torque constant K_t (N m/A), and values of the plant's friction laws by
    name, SI.

    drive_inertia    kg m^2 (kg) at the joint, for a URDF, which cannot state it; a DH table states its own
    joint_stiffness  N m/rad (N/m) between motor and link; 0: the joint is rigid
    joint_damping    N m s/rad (N s/m) between motor and link
    """

    name: str
    torque_constant: float
    friction: Mapping[str, float]
    drive_inertia: float = 0.0
    joint_stiffness: float = 0.0
    joint_damping: float = 0.0


@dataclass(frozen=True, slots=True)
class Sensors:
    """The imperfections of the sensors.

    position_step   rad, quantisation
    current_noise   A RMS, white
    current_step    A, quantisation
    effort_delay    s; the current in a row belongs to a motion this much later
    encoders        sides of elastic joints whose positions are logged: both, motor or link
    """

    position_step: float = 0.0
    current_noise: float = 0.0
    current_step: float = 0.0
    effort_delay: float = 0.0
    encoders: str = "both"


@dataclass(frozen=True, slots=True)
class Harness:
    """A cable harness, which no model in psdmc has: a spring that saturates at `torque` (N m) beyond `angle` (rad)."""

    joints: tuple[str, ...]
    torque: float
    angle: float = 1.0


@dataclass(frozen=True, slots=True)
class PlantRow:
    """One joint of a standard DH table, and the link after the joint.

    slides         True: prismatic joint; False: revolute joint
    a, d           m, lengths of the DH convention
    alpha, theta   rad, angles of the DH convention
    drive_inertia  kg m^2, or kg for a prismatic joint
    mass           kg
    com            m, centre of mass of the link in the link's frame
    inertia_com    kg m^2, inertia matrix of the link about its centre of mass, along the axes of the link's frame
    """

    name: str
    slides: bool
    a: float
    alpha: float
    d: float
    theta: float
    drive_inertia: float
    mass: float
    com: Triple
    inertia_com: tuple[Triple, Triple, Triple]


@dataclass(frozen=True, slots=True)
class PlantRobot:
    """The rows of a DH table, and gravity in m/s^2 along the axes of the base frame."""

    name: str
    gravity: Triple
    rows: tuple[PlantRow, ...]


@dataclass(frozen=True, slots=True)
class PlantUrdf:
    """The text of a URDF. Joints that the plant does not list stay at zero.

    tip  link that carries a load
    """

    name: str
    text: str
    tip: str


@dataclass(frozen=True, slots=True)
class Plant:
    """The content of a plant file and of the robot file that it names.

    terms       friction terms of the joints
    sign_speed  rad/s (m/s) over which friction without a state changes sign
    """

    robot: PlantRobot | PlantUrdf
    joints: tuple[JointTruth, ...]
    sensors: Sensors
    harness: Harness | None
    terms: tuple[Term, ...]
    sign_speed: float


def read_plant(path: Path) -> Plant:
    """Return a plant (virtual robot) from its file. Raises InputError with the table and key that is missing or wrong."""
    return plant_of(read_toml(path, WHAT), path)


def plant_of(content: dict[str, Any], path: Path) -> Plant:
    """Return the plant (virtual robot) from the content of its file; `path` is the path of that file."""
    faults: list[str] = []
    table = TomlTable(content, "plant", KEYS, faults)
    where = path.parent / table.text("robot")
    rows = table.items("joint")
    if len(rows) > LARGEST_PLANT:
        faults.append(f"{len(rows)} joints, expected at most {LARGEST_PLANT}")
        rows = []
    terms = _terms(table, path.parent, faults)
    speed = table.number("sign_speed", SMALLEST, LARGEST, SIGN_SPEED)
    joints = tuple(_truth(row, f"joint {k}", terms, faults) for k, row in enumerate(rows, start=1))
    sensors = _sensors(table.content.get("sensors", {}), faults)
    names = [joint.name for joint in joints]
    held = _harness(table.content["harness"], names, faults) if table.has("harness") else None
    tip = table.text("tip") if table.has("tip") else None
    is_table = where.suffix.lower() == ".toml"
    if is_table and tip is not None:
        faults.append("tip: found with a DH table, whose last link is the tip; expected with a URDF only")
    if is_table and any(joint.drive_inertia for joint in joints):
        faults.append("drive_inertia: found with a DH table, which states its own; expected with a URDF only")
    if sensors.encoders != "both" and not any(joint.joint_stiffness for joint in joints):
        faults.append("sensors: encoders: found without a joint_stiffness, expected an elastic joint")
    require_none(faults, str(path), HINT)
    if not is_table:
        return Plant(read_plant_urdf(where, names, tip), joints, sensors, held, terms, speed)
    robot = read_plant_robot(where)
    wanted = [row.name for row in robot.rows]
    if names != wanted:
        raise InputError(
            f"{path}: joints {listed([quoted(name) for name in names]) or 'none'}, its robot {where.name} has "
            f"{listed([quoted(name) for name in wanted])}",
            "a plant lists its robot's joints, all of them, in their order",
        )
    return Plant(robot, joints, sensors, held, terms, speed)


def plant_texts(path: str | Path) -> tuple[bytes, bytes]:
    """Return the bytes on which a plant (virtual robot) depends: those of its own file and of the robot file."""
    path = Path(path)
    robot = path.parent / str(read_toml(path, WHAT).get("robot"))
    return _bytes_of(path), _bytes_of(robot, LARGEST_URDF)


def _bytes_of(path: Path, limit: int = LARGEST_TOML) -> bytes:
    with opened(path, limit) as file:
        return read_rest(file, limit, str(path), SHORTER)


def _terms(table: TomlTable, folder: Path, faults: list[str]) -> tuple[Term, ...]:
    """Friction of the joints: by default the law with a state; else a list of laws, of values of laws with a number, and
    of Python files with a law each."""
    words = table.items("friction") if table.has("friction") else list(WITH_STATE)
    files = [word for word in words if isinstance(word, str) and word.endswith(".py")]
    own = laws_of([read_law(folder / word) for word in files])
    found = [Term(law) for law in own.values()]
    for word in words:
        if word in files:
            continue
        by_value = named(word, LAWS) if isinstance(word, str) else None
        law = LAWS.get(word) if isinstance(word, str) else None
        if by_value is not None:
            found.append(by_value[0])
        elif law is not None and law.number is None:
            found.append(Term(law))
        else:
            faults.append(
                f"friction: found {shown(word)}, expected a law ({', '.join(LAWS)}), a value of a law with its number, or a "
                "law's Python file"
            )
    return tuple(dict.fromkeys(found))


def _truth(value: object, where: str, terms: Sequence[Term], faults: list[str]) -> JointTruth:
    pairs = [pair for term in terms for pair in zip(term.names, term.law.values, strict=True)]
    own = ("drive_inertia", "joint_stiffness", "joint_damping")
    keys = ("name", "torque_constant", *(name for name, _ in pairs), *own)
    table = TomlTable(value, where, keys, faults)
    name = table.text("name")
    table.where = f"joint {quoted(name)}" if name else where
    if table.has("joint_damping") and not table.has("joint_stiffness"):
        faults.append(
            f"{table.where}: joint_damping: found without joint_stiffness, expected both or neither"
        )
    return JointTruth(
        name=name,
        torque_constant=table.number("torque_constant", SMALLEST, LARGEST),
        friction={
            key: table.number(key, max(value.low, -LARGEST), min(value.high, LARGEST)) for key, value in pairs
        },
        drive_inertia=table.number("drive_inertia", 0.0, LARGEST_BODY, 0.0),
        joint_stiffness=table.number("joint_stiffness", SMALLEST, LARGEST, 0.0),
        joint_damping=table.number("joint_damping", 0.0, LARGEST, 0.0),
    )


def _sensors(value: object, faults: list[str]) -> Sensors:
    keys = tuple(field.name for field in fields(Sensors))
    table = TomlTable(value, "sensors", keys, faults)
    steps = [table.number(key, 0.0, LARGEST, 0.0) for key in ("position_step", "current_step")]
    for key, step in zip(("position_step", "current_step"), steps, strict=True):
        if 0.0 < step < FINEST:
            faults.append(f"sensors: {key}: found {step:g}, expected 0 or at least {FINEST:g}")
    return Sensors(
        position_step=steps[0],
        current_noise=table.number("current_noise", 0.0, LARGEST, 0.0),
        current_step=steps[1],
        effort_delay=table.number("effort_delay", 0.0, LARGEST_DELAY, 0.0),
        encoders=table.word("encoders", ENCODERS, "both"),
    )


def _harness(value: object, names: Sequence[str], faults: list[str]) -> Harness:
    table = TomlTable(value, "harness", ("joints", "torque", "angle"), faults)
    joints = table.items("joints")
    odd = [quoted(str(name)) for name in joints if name not in names]
    if odd or not joints:
        faults.append(f"harness: joints: found {listed(odd) or 'none'}, expected some of {listed(names)}")
    return Harness(
        tuple(str(name) for name in joints),
        table.number("torque", 0.0, LARGEST),
        table.number("angle", SMALLEST, LARGEST, 1.0),
    )


def read_plant_urdf(path: Path, names: Sequence[str], tip: str | None) -> PlantUrdf:
    """Return a virtual robot's URDF. Raises InputError if it is none, or lacks the plant's joints or the tip."""
    data = _bytes_of(path, LARGEST_URDF)
    with decoding(str(path), "a robot (.toml or .urdf)"):
        text = data.decode("utf-8-sig")
    robot = read_urdf(text, str(path))
    movable = [joint.name for joint in robot.joints if joint.type in MOVABLE and joint.mimic is None]
    odd = [quoted(name) for name in names if name not in movable]
    if odd or not names:
        raise InputError(
            f"{path}: no joint(s) {listed(odd) or 'in the plant'} that turn or slide on their own",
            f"it has {listed([quoted(name) for name in movable]) or 'none'}",
        )
    if tip is None:
        tip, _ = default_tip(robot, robot.root, str(path))
    if tip not in robot.inertials:
        raise InputError(f"{path}: no link {quoted(tip)}", "give tip = the link that carries a load")
    return PlantUrdf(robot.name, text, tip)


def read_plant_robot(path: Path) -> PlantRobot:
    """Return a virtual robot's DH table. Raises InputError if it is none, or a value is unknown."""
    data = _bytes_of(path)
    content = toml_content(data, str(path), "a robot as a DH table (.toml)")
    with decoding(str(path), "a DH table"):
        read_dh(data.decode("utf-8-sig").replace("\r\n", "\n"), str(path))  # refuses what is malformed
    faults: list[str] = []
    if content.get("convention", "standard") != "standard":
        faults.append("a virtual robot needs standard DH")
    rows = tuple(_row(joint, faults) for joint in content["joint"])
    gravity = content.get("gravity", [0.0, 0.0, -9.81])
    if any(abs(x) > LARGEST_LENGTH for x in gravity):
        faults.append(f"gravity: expected numbers of at most {LARGEST_LENGTH:g}")
    require_none(faults, str(path), "a virtual robot has to know everything: see docs/robot_files.md")
    return PlantRobot(
        str(content.get("name", "robot")), (float(gravity[0]), float(gravity[1]), float(gravity[2])), rows
    )


def _row(joint: dict[str, Any], faults: list[str]) -> PlantRow:
    """One joint of a well-formed table; unknown and absurd values go to the faults."""
    where = f"joint {quoted(str(joint.get('name', '')))}"
    keys = tuple(joint)
    table = TomlTable(
        {"drive_inertia": 0.0, "a": 0.0, "d": 0.0} | joint, where, (*keys, "drive_inertia", "a", "d"), faults
    )
    link = joint.get("link", {})
    body = TomlTable(link, f"{where}: link", tuple(link), faults)
    about = link.get("inertia_com", {})
    inertia = TomlTable(about, f"{where}: inertia_com", tuple(about), faults)
    xx, yy, zz, xy, xz, yz = (
        inertia.number(name, -LARGEST_BODY, LARGEST_BODY) for name in ("xx", "yy", "zz", "xy", "xz", "yz")
    )
    matrix = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    largest = max(abs(entry) for row in matrix for entry in row)
    if float(np.linalg.eigvalsh(matrix)[0]) < -ROUNDED * largest:
        faults.append(f"{where}: inertia_com: no body has it: it has a negative principal moment")
    return PlantRow(
        name=str(joint.get("name", "")),
        slides=SLIDES[str(joint.get("type", "revolute"))],
        a=table.number("a", -LARGEST_LENGTH, LARGEST_LENGTH),
        alpha=_angle(joint.get("alpha", 0.0)),
        d=table.number("d", -LARGEST_LENGTH, LARGEST_LENGTH),
        theta=_angle(joint.get("theta", 0.0)),
        drive_inertia=table.number("drive_inertia", 0.0, LARGEST_BODY),
        mass=body.number("mass", 0.0, LARGEST_BODY),
        com=body.triple("com", LARGEST_LENGTH),
        inertia_com=matrix,
    )


def _angle(value: float | str) -> float:
    """rad, from a number or a text such as "90 deg" or "1.5 rad", already known to be one of these."""
    if is_number(value):
        return float(value)
    text = str(value).strip()
    number = float(text[:-3])
    return math.radians(number) if text.endswith("deg") else number
