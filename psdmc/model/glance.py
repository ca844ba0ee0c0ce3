"""A summary of a model in at most twelve lines of text, and as HTML for notebooks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Protocol

from psdmc.model.model_parts import ModelParts
from psdmc.model.parameter_table import BaseParameters
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Joint, Mechanism

MOST_JOINTS = 6
"""Joints that a repr names."""

_FRAMES = {"urdf": "URDF", "standard": "standard DH", "modified": "modified DH"}


class Model(ModelParts, Protocol):
    """The attributes of a model that the functions `text` and `html` show."""

    @property
    def p(self) -> int | None: ...

    @property
    def l(self) -> int: ...  # noqa: E743  the paper's letter

    @property
    def base_parameters(self) -> BaseParameters: ...


def text(model: Model) -> str:
    """Return a summary of the model in lines of text: robot, joints, gravity, sizes, certificate, source."""
    return "\n  ".join([_title(model.mechanism), *_facts(model)])


def html(model: Model) -> str:
    """Return the model as HTML: the summary of `text`, then tables of joints and base parameters. Names are escaped."""
    facts = "".join(f"<li>{escape(fact)}</li>" for fact in _facts(model))
    return (
        f"<div><p><b>{escape(_title(model.mechanism))}</b></p><ul>{facts}</ul>"
        f"{joints_html(model.mechanism.joints)}"
        f"<details><summary>{model.l} base parameters</summary>{model.base_parameters._repr_html_()}</details></div>"
    )


def joints_html(joints: Sequence[Joint]) -> str:
    """Return an HTML table of joints with their links, types and limits."""
    heads = ("", "joint", "link", "type", "position", "speed", "effort")
    rows = [[str(i), *_cells(joint)] for i, joint in enumerate(joints)]
    return table_html(heads, rows)


def table_html(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of texts, escaped."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def joints_text(joints: Sequence[Joint]) -> str:
    """Return text with the names and types of the first joints, and with the number of further joints."""
    named = [f"{shown(joint.name)} {joint.type.word}" for joint in joints[:MOST_JOINTS]]
    more = len(joints) - len(named)
    return ", ".join(named) + (f" and {more} more" if more else "")


def numbers_text(values: Sequence[float]) -> str:
    """Numbers with six digits, separated by spaces."""
    return " ".join(f"{value:g}" for value in values)


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
    return [
        f"joints: {joints_text(robot.joints)}",
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


def range_text(lower: float, upper: float, unit: str) -> str:
    """A range with its unit, or 'none'."""
    if math.isinf(lower) and math.isinf(upper):
        return "none"
    return f"{lower:.4g} .. {upper:.4g} {unit}"


def limit_text(value: float, unit: str) -> str:
    """A limit with its unit, or 'none'."""
    return "none" if math.isinf(value) else f"{value:.4g} {unit}"
