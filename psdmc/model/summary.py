"""A summary of a model in a few lines of text, as HTML for notebooks, and parts of what `psdmc show` prints."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from psdmc.model import store
from psdmc.model.equations import BaseParameters
from psdmc.model.expansion import BLOCKS, Expansion, RowBlocks
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Joint, Mechanism

NAMED_JOINTS = 6
"""Joints that a repr names."""

_FRAMES = {"urdf": "URDF", "standard": "standard DH", "modified": "modified DH"}


class Model(store.Model, Protocol):
    """The attributes of a model that a summary shows. DynamicsModel itself imports this file."""

    @property
    def p(self) -> int | None: ...

    @property
    def l(self) -> int: ...  # noqa: E743  the paper's letter

    @property
    def base_parameters(self) -> BaseParameters: ...

    def expanded(self) -> Expansion: ...


class Sizes(NamedTuple):
    """Number of monomials by kind of acceleration."""

    gravity: int
    acceleration: int
    centrifugal: int
    coriolis: int


def sizes_of(E: NDArray[np.uint8]) -> Sizes:
    """Return the number of monomials in E (5n, p) by kind: gravity, acceleration, centrifugal and Coriolis."""
    rows = RowBlocks.of(E.shape[0] // BLOCKS)
    speeds, accelerations = E[rows.qd], E[rows.qdd]
    accelerating, moving = accelerations.any(axis=0), speeds.any(axis=0)
    squared = (speeds == 2).any(axis=0)
    return Sizes(
        int(np.count_nonzero(~moving & ~accelerating)),
        int(np.count_nonzero(accelerating)),
        int(np.count_nonzero(squared)),
        int(np.count_nonzero(moving & ~squared)),
    )


def term_texts(model: Model) -> Iterator[str]:
    """Return every monomial of the torques as text, in the order of E: 'g s2 c3', 'qdd1 c2^2', 'qd1 qd2 s2 c2'.

    s2 is sin q2 and c2 is cos q2; g is the strength of gravity.
    """
    exponents = model.expanded().E
    n = model.mechanism.nv
    rows = RowBlocks.of(n)
    names = [f"{symbol}{j + 1}" for symbol in ("q", "s", "c", "qd", "qdd") for j in range(n)]
    order = np.concatenate([np.arange(len(names))[each] for each in (rows.qdd, rows.qd, rows.position)])
    for column in exponents.T:
        factors = [names[r] + ("^2" if column[r] == 2 else "") for r in order if column[r]]
        is_gravity = not column[rows.rates].any()
        yield " ".join(["g", *factors] if is_gravity else factors)


def text_summary(model: Model) -> str:
    """Return a summary of the model in at most twelve lines of text: robot, joints, gravity, sizes, certificate, source."""
    return "\n  ".join([_title(model.mechanism), *_facts(model)])


def html_summary(model: Model) -> str:
    """Return the model as HTML: the summary as text, then tables of joints and base parameters. Names are escaped."""
    facts = "".join(f"<li>{escape(fact)}</li>" for fact in _facts(model))
    heads = ("", "joint", "link", "type", "position", "speed", "effort")
    head = "".join(f"<th>{text}</th>" for text in heads)
    cells = ([str(i), *_cells(joint)] for i, joint in enumerate(model.mechanism.joints))
    rows = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in cells)
    return (
        f"<div><p><b>{escape(_title(model.mechanism))}</b></p><ul>{facts}</ul>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
        f"<details><summary>{model.l} base parameters</summary>{model.base_parameters._repr_html_()}</details></div>"
    )


def _title(robot: Mechanism) -> str:
    ends = f"to {shown(robot.tip_name)}" if robot.is_serial else f"with {len(robot.leaves)} ends"
    frames = _FRAMES.get(robot.convention, robot.convention)
    return (
        f"DynamicsModel {shown(robot.name)}: {len(robot)} joints, "
        f"{shown(robot.base_name)} {ends}, {frames} frames"
    )


def _facts(model: Model) -> list[str]:
    robot = model.mechanism
    lengths = [] if robot.nq == robot.nv == len(robot) else [f"nq = {robot.nq}, nv = {robot.nv}"]
    monomials = "no E and P" if model.p is None else f"p = {model.p} monomials"
    known = "unknown" if model.theta_b is None else "known"
    error = float(model.certificate.max(initial=0.0))
    source = model.provenance.get("source_name")
    named = [f"{shown(joint.name)} {joint.type.word}" for joint in robot.joints[:NAMED_JOINTS]]
    more = len(robot) - len(named)
    return [
        f"joints: {', '.join(named)}" + (f" and {more} more" if more else ""),
        *lengths,
        f"gravity: {numbers_text(robot.gravity.tolist())} m/s^2 in the {robot.base_frame}",
        f"{monomials}, l = {model.l} base parameters, theta_b {known}",
        f"largest torque error against Newton-Euler: {error:.1e}, relative",
        *([f"source: {shown(source)}"] if source else []),
    ]


def _cells(joint: Joint) -> list[str]:
    limits, unit = joint.limits, joint.type.position_unit
    return [
        joint.name,
        joint.link_name,
        joint.type.word,
        range_text(limits.lower, limits.upper, unit),
        limit_text(limits.speed, f"{unit}/s"),
        limit_text(limits.effort, joint.type.effort_unit),
    ]


def numbers_text(values: Sequence[float]) -> str:
    """Numbers with six digits, separated by spaces."""
    return " ".join(f"{value:g}" for value in values)


def range_text(lower: float, upper: float, unit: str) -> str:
    """A range with its unit, or 'none'."""
    if math.isinf(lower) and math.isinf(upper):
        return "none"
    return f"{lower:.4g} .. {upper:.4g} {unit}"


def limit_text(value: float, unit: str) -> str:
    """A limit with its unit, or 'none'."""
    return "none" if math.isinf(value) else f"{value:.4g} {unit}"


def joined_units(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return, for each quantity's name, its units as one text, each unit once: 'Nm, N'.

    pairs  (name, unit) of the quantity at each joint
    """
    found: dict[str, dict[str, None]] = {}
    for name, unit in pairs:
        found.setdefault(name, {})[unit] = None
    return {name: ", ".join(units) for name, units in found.items()}
