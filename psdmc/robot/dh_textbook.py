"""A DH table read a second time, independently, to check the first reading: the textbook's 4 x 4 matrices.

Standard (Denavit, Hartenberg 1955; Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, eq. 3.10) and modified
(Craig, Introduction to Robotics, eq. 3.6). The joint variable is added to theta, or to d; either leaves a rotation
about z (a displacement along z) that commutes to the outer end of a standard row and to the inner end of a modified
one, where Pinocchio's joint is.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio

from psdmc.robot.mechanism import Array

MODELS = {"revolute": pinocchio.JointModelRZ, "prismatic": pinocchio.JointModelPZ}
"""Pinocchio's joints by a row's type. Written here again, because this reader shares nothing with the other."""


def dh_model(text: str, gravity: Sequence[float] | None) -> pinocchio.Model:
    """Pinocchio's model of a table that read_dh has accepted, links called link1, link2 and so on.

    gravity   m/s^2 in the base frame instead of the table's; bodies that the table leaves open in part are zero
    """
    table = tomllib.loads(text)
    is_modified = table.get("convention", "standard") == "modified"
    model = pinocchio.Model()
    model.name = str(table.get("name", "robot"))
    ends = {"base": (pinocchio.SE3.Identity(), 0, 0)}
    last = "base"
    for number, row in enumerate(table["joint"], start=1):
        before, parent, frame = ends[row.get("parent", last)]
        kind = MODELS[row.get("type", "revolute")]()
        whole = pinocchio.SE3((modified_matrix if is_modified else standard_matrix)(*_numbers(row)))
        place, link = (before * whole, pinocchio.SE3.Identity()) if is_modified else (before, whole)
        last = row.get("name", f"joint{number}")
        parent = model.addJoint(parent, kind, place, last)
        model.appendBodyToJoint(parent, _body(row.get("link", {})), link)
        frame = model.addFrame(
            pinocchio.Frame(f"link{number}", parent, frame, link, pinocchio.FrameType.BODY)
        )
        ends[last] = link, parent, frame
    model.gravity.linear = np.array(
        table.get("gravity", (0.0, 0.0, -9.81)) if gravity is None else gravity, float
    )
    return model


def standard_matrix(theta: float, d: float, a: float, alpha: float) -> Array:
    """(4, 4) Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha), multiplied out."""
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def modified_matrix(theta: float, d: float, a: float, alpha: float) -> Array:
    """(4, 4) Rot(x, alpha) Trans(x, a) Rot(z, theta) Trans(z, d), multiplied out."""
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [ct, -st, 0.0, a],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _numbers(row: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """theta, d, a, alpha of a row, in rad and m."""
    theta, alpha = _radians(row.get("theta", 0.0)), _radians(row.get("alpha", 0.0))
    return theta, float(row.get("d", 0.0)), float(row.get("a", 0.0)), alpha


def _radians(value: float | str) -> float:
    if not isinstance(value, str):
        return float(value)
    text = value.strip()
    return float(text[:-3]) * (math.pi / 180.0 if text.endswith("deg") else 1.0)


def _body(link: Mapping[str, Any]) -> pinocchio.Inertia:
    """The row's body in its link's frame; zero where something is left out."""
    six = link.get("inertia_com", {})
    if not {"mass", "com"} <= set(link) or len(six) < 6:
        return pinocchio.Inertia.Zero()
    com, mass = np.array(link["com"], float), float(link["mass"])
    xx, xy, yy, xz, yz, zz = (float(six[name]) for name in ("xx", "xy", "yy", "xz", "yz", "zz"))
    about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about_frame = about_com + mass * (com @ com * np.eye(3) - np.outer(com, com))
    entries = about_frame[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    # Pinocchio divides by the mass: a body without any gets the smallest one.
    divisor = mass or float(np.finfo(float).tiny)
    return pinocchio.Inertia.FromDynamicParameters(np.array([divisor, *(mass * com), *entries]))
