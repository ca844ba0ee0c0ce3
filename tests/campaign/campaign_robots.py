"""Random robots as URDF text, one per seed: any joints, right angles and nearly right ones, rotated inertias.

The text is all that psdmc, Pinocchio and MuJoCo get to see; each reads it by itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Array = np.ndarray

RIGHT = (0.0, math.pi / 2, -math.pi / 2, math.pi)
ROUNDED = (1.5708, -1.5708, 3.1416, 1.570796)
"""Right angles as files round them."""

TILTS = (1e-9, 1e-1)
"""rad; tilts between nearly parallel axes are log-uniform between these, or exactly zero."""

STYLES = ("tidy", "parallel", "tilted", "rounded", "oblique", "mixed")
"""What the angles between axes are like: right angles; all parallel but for tilts; right angles and tilts; right angles
as files round them; any; and one of these anew for every joint."""

LENGTHS = (0.05, 0.6)
"""m, from one joint to the next along an axis of the frame, where not zero or nearly so."""

KINDS = ("revolute", "continuous", "prismatic")
KIND_SHARES = (0.65, 0.15, 0.2)
JOINT_SHARES = (1, 2, 3, 3, 3, 4, 2, 2, 2)
"""How often a robot has 1, 2 ... 9 joints."""

LARGEST = len(JOINT_SHARES)

MIXED = 10, 7
"""Robots whose seed leaves this remainder are of many scales:"""

SHRUNK, WEIGHED = (1e-6, 1.0), (1e-3, 1e3)
"""every link's lengths (its body's, and the way to the next joint), and its mass besides, are multiplied by factors drawn
log-uniformly from these."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Factors of one link's lengths and mass."""

    length: float = 1.0
    mass: float = 1.0


@dataclass(frozen=True, slots=True)
class Mimic:
    """q = ratio q_leader + offset"""

    leader: str
    ratio: float
    offset: float


@dataclass(frozen=True, slots=True)
class RandomRobot:
    """A robot's file, and how it is to be read.

    joints    names of movable joints, parents before what they carry
    tilts     rad, the tilts drawn, zeros left out
    is_mixed  links a million times as long, or as heavy, as their neighbours
    options   of load_robot_text
    follows   mimic joints by name
    held      positions, rad or m, of joints that do not move: those locked, and those beside a chain that is cut out
    is_light  some link that a joint moves has no body
    """

    seed: int
    text: str
    style: str
    joints: tuple[str, ...]
    tilts: tuple[float, ...]
    is_mixed: bool
    options: Mapping[str, Any] = field(default_factory=dict)
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    is_light: bool = False

    @property
    def is_floating(self) -> bool:
        return bool(self.options.get("floating"))

    def coordinate_of(self, joint: str) -> Mimic:
        """What moves a joint in the end: a joint that follows none, itself maybe, or one that is held, with ratio 0."""
        if joint in self.held:
            return Mimic(joint, 0.0, self.held[joint])
        if joint not in self.mimics:
            return Mimic(joint, 1.0, 0.0)
        own = self.mimics[joint]
        first = self.coordinate_of(own.leader)
        return Mimic(first.leader, own.ratio * first.ratio, own.ratio * first.offset + own.offset)


def random_robot(seed: int) -> RandomRobot:
    """The robot of a seed: nothing else decides it."""
    rng = np.random.default_rng([10, seed])
    n = int(rng.choice(np.arange(1, LARGEST + 1), p=np.array(JOINT_SHARES) / sum(JOINT_SHARES)))
    style = str(rng.choice(STYLES))
    is_mixed = is_mixed_seed(seed)
    scales = scales_of(seed, n) if is_mixed else (Scale(),) * n
    tilts: list[float] = []
    parts = ["<link name='base'/>"]
    previous = "base"
    for k in range(n):
        kind = str(rng.choice(KINDS, p=KIND_SHARES))
        if k and rng.random() < 0.15:
            parts += [
                fixed_joint(rng, str(k), previous, scales[k - 1], tilts),
                body_link(rng, f"plate{k}", 0.4, scales[k - 1]),
            ]
            previous = f"plate{k}"
        parts.append(moving_joint(rng, str(k), kind, previous, style, scales[max(0, k - 1)], tilts))
        parts.append(body_link(rng, f"link{k}", 0.75**k, scales[k]))
        previous = f"link{k}"
    text = robot_text(seed, parts)
    return RandomRobot(seed, text, style, tuple(f"joint{k}" for k in range(n)), tuple(tilts), is_mixed)


def is_mixed_seed(seed: int) -> bool:
    return seed % MIXED[0] == MIXED[1]


def robot_text(seed: int, parts: Sequence[str]) -> str:
    body = "\n".join(parts)
    return f"<?xml version='1.0'?>\n<robot name='random{seed}'>\n{body}\n</robot>\n"


def scales_of(seed: int, n: int) -> tuple[Scale, ...]:
    rng = np.random.default_rng([30, seed])
    pairs = zip(_log_uniform(rng, SHRUNK, n), _log_uniform(rng, WEIGHED, n), strict=True)
    return tuple(Scale(float(length), float(mass)) for length, mass in pairs)


def fixed_joint(rng: np.random.Generator, name: str, parent: str, scale: Scale, tilts: list[float]) -> str:
    """The joint mountNAME of link plateNAME."""
    place = _origin(_lengths(rng) * scale.length, _angles(rng, "mixed", tilts))
    ends = f"<parent link='{parent}'/><child link='plate{name}'/>"
    return f"<joint name='mount{name}' type='fixed'>{ends}{place}</joint>"


def moving_joint(
    rng: np.random.Generator,
    name: str,
    kind: str,
    parent: str,
    style: str,
    scale: Scale,
    tilts: list[float],
) -> str:
    """The joint jointNAME of link linkNAME."""
    place = _origin(_lengths(rng) * scale.length, _angles(rng, style, tilts))
    limit = "" if kind == "continuous" else "<limit lower='-3' upper='3' effort='100' velocity='3'/>"
    return (
        f"<joint name='joint{name}' type='{kind}'><parent link='{parent}'/><child link='link{name}'/>{place}"
        f"<axis xyz='{_numbers(_axis(rng))}'/>{limit}</joint>"
    )


def _axis(rng: np.random.Generator) -> Array:
    """Mostly z; one of the others; seldom oblique."""
    draw = rng.random()
    if draw < 0.9:
        axis = np.eye(3)[2 if draw < 0.7 else int(rng.integers(3))]
        return axis * (1.0 if rng.random() < 0.7 else -1.0)
    oblique = rng.normal(size=3)
    return np.asarray(oblique / np.linalg.norm(oblique))


def _lengths(rng: np.random.Generator) -> Array:
    """Each a decimal length, zero, or (nearly intersecting axes) a tiny one."""
    lengths = np.round(rng.uniform(*LENGTHS, 3) * rng.choice([-1.0, 1.0], 3), 4)
    draw = rng.random(3)
    tiny = _log_uniform(rng, TILTS, 3)
    return np.where(draw < 0.35, 0.0, np.where(draw < 0.45, tiny, lengths))


def _angles(rng: np.random.Generator, style: str, tilts: list[float]) -> Array:
    """Roll, pitch, yaw."""
    if style == "mixed":
        style = str(rng.choice(STYLES[:-1]))
    if style == "oblique":
        return rng.uniform(-math.pi, math.pi, 3)
    if style == "parallel":
        across = _tilts(rng, 2, tilts)
        return np.array([*across, rng.choice([0.0, math.pi / 2, rng.uniform(-math.pi, math.pi)])])
    plain = rng.choice(RIGHT, 3) * (rng.random(3) < 0.5)
    if style == "rounded":
        return np.where(plain != 0.0, rng.choice(ROUNDED, 3), 0.0)
    if style == "tilted":
        return plain * (rng.random(3) < 0.3) + _tilts(rng, 3, tilts)
    return plain


def _tilts(rng: np.random.Generator, count: int, tilts: list[float]) -> Array:
    """Tilts of either sign, some exactly zero, noted in `tilts`."""
    drawn = _log_uniform(rng, TILTS, count) * rng.choice([-1.0, 1.0], count) * (rng.random(count) < 0.6)
    tilts += [abs(float(tilt)) for tilt in drawn if tilt]
    return drawn


def _log_uniform(rng: np.random.Generator, limits: tuple[float, float], count: int) -> Array:
    low, high = np.log(limits)
    return np.exp(rng.uniform(low, high, count))


def body_link(rng: np.random.Generator, name: str, size: float, scale: Scale) -> str:
    """A physical body: principal moments of a box, centre of mass and axes anywhere."""
    mass = float(np.round(rng.uniform(1.0, 10.0) * size, 4)) * scale.mass
    a, b, c = (rng.uniform(0.05, 0.3, 3) * scale.length) ** 2 * mass / 12.0
    centre = np.round(rng.uniform(-0.15, 0.15, 3) * (rng.random(3) < 0.8), 4) * scale.length
    turn = rng.uniform(-math.pi, math.pi, 3) if rng.random() < 0.5 else np.zeros(3)
    moments = f"ixx='{float(b + c)!r}' iyy='{float(a + c)!r}' izz='{float(a + b)!r}' ixy='0' ixz='0' iyz='0'"
    return (
        f"<link name='{name}'><inertial>{_origin(centre, turn)}<mass value='{mass!r}'/>"
        f"<inertia {moments}/></inertial></link>"
    )


def _origin(xyz: Array, rpy: Array) -> str:
    return f"<origin xyz='{_numbers(xyz)}' rpy='{_numbers(rpy)}'/>"


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
