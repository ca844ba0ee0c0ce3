"""Random robots that branch, as URDF text and options, one per seed: limbs of the links and joints that chains are made
of, plates fixed anywhere, links without a body, joints that follow others or are locked, floating bases, chains cut out.

Names tell nothing of what hangs on what, and the file has its parts in any order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from campaign_robots import (
    KIND_SHARES,
    KINDS,
    STYLES,
    Mimic,
    RandomRobot,
    Scale,
    body_link,
    fixed_joint,
    is_mixed_seed,
    moving_joint,
    robot_text,
    scales_of,
)

FEWEST, MOST = 3, 16
"""Joints that move; sizes are drawn log-uniformly."""

LIMB = 0.5
"""Share of bodies that hang on the one drawn before; the others hang on any, or on the base."""

PLATES, LIGHT, SHUFFLED = 0.2, 0.08, 0.5
"""Shares of bodies with a plate between them and their parent, of links that carry others and have no body, and of files
whose parts are in no order."""

FOLLOWING, LOCKED, FLOATING, CUT = 0.35, 0.3, 0.3, 0.15
"""Shares of robots."""

STILL = 0.06
"""Share of mimic joints whose multiplier is zero."""

BASE = "base"


@dataclass(slots=True)
class Drawing:
    """What a tree is made of so far.

    names    of bodies, without 'link' and 'joint' before them
    parents  indices of bodies; -1: the base
    follows  of joints by their index
    """

    names: list[str]
    parents: list[int]
    tilts: list[float] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    options: dict[str, Any] = field(default_factory=dict)
    mimics: dict[int, Mimic] = field(default_factory=dict)
    held: dict[str, float] = field(default_factory=dict)
    is_light: bool = False

    @property
    def joints(self) -> list[str]:
        return [f"joint{name}" for name in self.names]

    def path(self, body: int) -> list[int]:
        """From the body up to one on the base."""
        return [] if body < 0 else [body, *self.path(self.parents[body])]


def random_tree(seed: int) -> RandomRobot:
    """The robot of a seed: nothing else decides it."""
    rng = np.random.default_rng([50, seed])
    n = int(np.exp(rng.uniform(np.log(FEWEST), np.log(MOST + 1))))
    style = str(rng.choice(STYLES))
    letters = rng.permutation(list("abcdefghijklmnopqrstuvwxyz"))
    drawing = Drawing([f"{letters[k]}{k}" for k in range(n)], _parents(rng, n))
    _options(rng, drawing)
    is_mixed = is_mixed_seed(seed) and not drawing.options.get("floating")
    scales = scales_of(seed, n) if is_mixed else (Scale(),) * n
    _bodies(rng, drawing, style, scales)
    if rng.random() < SHUFFLED:
        rng.shuffle(drawing.parts)
    joints = drawing.joints
    return RandomRobot(
        seed, robot_text(seed, drawing.parts), style, tuple(joints), tuple(drawing.tilts), is_mixed,
        drawing.options, {joints[k]: one for k, one in drawing.mimics.items()}, drawing.held,
        drawing.is_light,
    )  # fmt: skip


def _parents(rng: np.random.Generator, n: int) -> list[int]:
    """Of a tree that branches somewhere."""
    parents = [-1]
    for k in range(1, n):
        parents.append(k - 1 if rng.random() < LIMB else int(rng.integers(-1, k)))
    if parents == list(range(-1, n - 1)):
        parents[-1] = int(rng.integers(-1, n - 2))
    return parents


def _options(rng: np.random.Generator, drawing: Drawing) -> None:
    if rng.random() < FOLLOWING:
        _follow(rng, drawing)
    if rng.random() < FLOATING:
        drawing.options["floating"] = True
    if rng.random() < LOCKED:
        _lock(rng, drawing)
    if not drawing.options and not drawing.mimics and rng.random() < CUT:
        _cut(rng, drawing)


def _follow(rng: np.random.Generator, drawing: Drawing) -> None:
    """Some joints mimic others, which may come later, be of another type, or mimic others themselves; never in a ring."""
    n = len(drawing.names)
    for joint in rng.permutation(n)[: int(rng.integers(1, max(2, n // 2)))].tolist():
        leader = int(rng.integers(n))
        if joint in _led_by(drawing, leader):
            continue
        ratio = (
            0.0 if rng.random() < STILL else float(np.round(rng.uniform(0.2, 2.0) * rng.choice([-1, 1]), 3))
        )
        offset = float(np.round(rng.uniform(-0.5, 0.5), 3)) if rng.random() < 0.5 else 0.0
        drawing.mimics[joint] = Mimic(drawing.joints[leader], ratio, offset)


def _led_by(drawing: Drawing, joint: int) -> list[int]:
    """The joint and all that it follows."""
    if joint not in drawing.mimics:
        return [joint]
    return [joint, *_led_by(drawing, drawing.joints.index(drawing.mimics[joint].leader))]


def _lock(rng: np.random.Generator, drawing: Drawing) -> None:
    """One or two joints, as long as two others stay that follow none."""
    for joint in rng.permutation(len(drawing.names))[: int(rng.integers(1, 3))].tolist():
        own = [k for k in range(len(drawing.names)) if k not in drawing.mimics]
        left = [k for k in own if drawing.joints[k] not in drawing.held and k != joint]
        if len(left) >= 2:
            drawing.held[drawing.joints[joint]] = float(np.round(rng.uniform(-1.5, 1.5), 3))
    if drawing.held:
        drawing.options["lock"] = dict(drawing.held)


def _cut(rng: np.random.Generator, drawing: Drawing) -> None:
    """A chain from the base, or from a link on the way, to a link; other joints stay at zero."""
    path = drawing.path(int(rng.integers(len(drawing.names))))
    first = int(rng.integers(1, len(path) + 1))
    drawing.options["tip"] = f"link{drawing.names[path[0]]}"
    drawing.options["base"] = f"link{drawing.names[path[first]]}" if first < len(path) else BASE
    moving = path[:first]
    drawing.held |= {joint: 0.0 for k, joint in enumerate(drawing.joints) if k not in moving}


def _bodies(rng: np.random.Generator, drawing: Drawing, style: str, scales: Sequence[Scale]) -> None:
    floating = drawing.options.get("floating")
    parts, names = drawing.parts, drawing.names
    parts.append(body_link(rng, BASE, 1.0, Scale()) if floating else f"<link name='{BASE}'/>")
    for k, (name, above) in enumerate(zip(names, drawing.parents, strict=True)):
        kind = str(rng.choice(KINDS, p=KIND_SHARES))
        size, scale = 0.75 ** len(drawing.path(above)), scales[max(0, above)]
        parent = f"link{names[above]}" if above >= 0 else BASE
        if rng.random() < PLATES:
            parts.append(fixed_joint(rng, name, parent, scale, drawing.tilts))
            parts.append(body_link(rng, f"plate{name}", 0.4 * size, scale))
            parent = rng.choice([parent, f"plate{name}"])
        joint = moving_joint(rng, name, kind, parent, style, scale, drawing.tilts)
        parts.append(joint.replace("</joint>", _mimic(drawing.mimics.get(k)) + "</joint>"))
        if k in drawing.parents and rng.random() < LIGHT:
            drawing.is_light = True
            parts.append(f"<link name='link{name}'/>")
        else:
            parts.append(body_link(rng, f"link{name}", size, scales[k]))


def _mimic(mimics: Mimic | None) -> str:
    if mimics is None:
        return ""
    offset = f" offset='{mimics.offset!r}'" if mimics.offset else ""
    return f"<mimic joint='{mimics.leader}' multiplier='{mimics.ratio!r}'{offset}/>"
