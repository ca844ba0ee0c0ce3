"""The tree of a compiled MJCF in MJCF's own words, without shapes, meshes and includes: what `check` gives to MuJoCo again.

It stands beside the URDF that psdmc makes of the same model, and shares no computation with it: every number is copied from
MuJoCo's arrays to the attribute that MuJoCo fills that array from.
"""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import ArrayLike

from psdmc.robot.mjcf_names import Names
from psdmc.robot.mjcf_terms import armatures

COMPILER = {
    "angle": "radian",
    "autolimits": "false",
    "balanceinertia": "false",
    "boundmass": "0",
    "boundinertia": "0",
    "fusestatic": "false",
    "inertiafromgeom": "false",
}
"""Settings by which MuJoCo keeps these numbers."""


def kept_tree(mujoco: Any, model: Any, names: Names) -> Element:
    """A <mujoco> element: bodies, inertias, joints, their drives' inertias and gravity."""
    root = Element("mujoco", model="kept")
    SubElement(root, "compiler", COMPILER)
    SubElement(root, "option", gravity=_numbers(model.opt.gravity))
    drives = armatures(mujoco, model)
    elements = [SubElement(root, "worldbody")]
    for body in range(1, model.nbody):
        place = {"pos": _numbers(model.body_pos[body]), "quat": _numbers(model.body_quat[body])}
        element = SubElement(elements[model.body_parentid[body]], "body", {"name": names.body(body), **place})
        elements.append(element)
        _inertial(element, model, body)
        first = int(model.body_jntadr[body])
        for j in range(first, first + int(model.body_jntnum[body])):
            _joint(element, mujoco, model, j, names.joint(j), drives[j])
    return root


def _inertial(element: Element, model: Any, body: int) -> None:
    if model.body_mass[body] > 0.0 or model.body_inertia[body].any():
        words = {"pos": "ipos", "quat": "iquat", "mass": "mass", "diaginertia": "inertia"}
        values = {word: getattr(model, f"body_{array}")[body] for word, array in words.items()}
        SubElement(element, "inertial", {word: _numbers(value) for word, value in values.items()})


def _joint(element: Element, mujoco: Any, model: Any, j: int, name: str, drive: float) -> None:
    kinds = mujoco.mjtJoint
    kind = kinds(model.jnt_type[j]).name.removeprefix("mjJNT_").lower()
    joint = SubElement(element, "joint", name=name, type=kind)
    if kind == "free":
        return
    joint.set("pos", _numbers(model.jnt_pos[j]))
    joint.set("armature", _numbers(drive))
    if kind != "ball":
        joint.set("axis", _numbers(model.jnt_axis[j]))
        joint.set("ref", _numbers(model.qpos0[model.jnt_qposadr[j]]))


def _numbers(values: ArrayLike) -> str:
    """All digits of one or several numbers."""
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))
