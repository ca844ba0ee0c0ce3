"""Converts the tree of a compiled MJCF to the text of a URDF, with all digits of every number.

MuJoCo places a body in its parent, then moves it by its joints one after the other. Each joint moves about or along an
axis through a point of the body by q - ref. URDF has one joint per link, about the origin of the link.

So a body with k joints becomes a chain of k links, each at the anchor of its joint. A fixed link follows if the last
anchor is not the body's origin. Each joint frame is rotated (or shifted) by -ref, so that the q of the URDF's joint
equals MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.limits import TINIEST, free_name
from psdmc.robot.mjcf.constraints import Mimic
from psdmc.robot.mjcf.mujoco_model import Names, armatures
from psdmc.robot.urdf.urdf_words import BALL, DRIVE, MJCF, NOTE

Array = NDArray[np.float64]
UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(slots=True)
class _Writer:
    """The text under way. `armatures`: kg m^2 (kg) of each joint; `links`, `joints`: names that are taken."""

    mujoco: Any
    model: Any
    names: Names
    mimics: Mapping[str, Mimic]
    root: Element
    armatures: Array
    links: set[str] = field(default_factory=set)
    joints: set[str] = field(default_factory=set)

    def link(self, name: str, body: int | None = None) -> None:
        """Add a link to the URDF, with the inertia of a body of the MJCF if the body has one. Without a body, add a
        link with zero inertia, which lies between two joints of one body."""
        element = SubElement(self.root, "link", name=name)
        if body is not None and not (self.model.body_mass[body] > 0.0 or self.model.body_inertia[body].any()):
            return
        inertial = SubElement(element, "inertial")
        if body is None:
            SubElement(inertial, "mass", value="0")
            SubElement(inertial, "inertia", {f"i{name}": "0" for name in INERTIA_NAMES})
            return
        _origin(inertial, self.model.body_ipos[body], self.model.body_iquat[body])
        SubElement(inertial, "mass", value=_number(self.model.body_mass[body]))
        xx, yy, zz = self.model.body_inertia[body]
        moments = {"ixx": _number(xx), "iyy": _number(yy), "izz": _number(zz)}
        SubElement(inertial, "inertia", moments | {"ixy": "0", "ixz": "0", "iyz": "0"})

    def joint(self, name: str, kind: str, parent: str, child: str, place: tuple[Array, Array]) -> Element:
        element = SubElement(self.root, "joint", name=name, type=kind)
        _origin(element, *place)
        SubElement(element, "parent", link=parent)
        SubElement(element, "child", link=child)
        return element


def tree_text(
    mujoco: Any,
    model: Any,
    names: Names,
    mimics: Mapping[str, Mimic],
    free: int | None,
    notes: Sequence[str],
) -> str:
    """Return the text of a URDF with the tree of a compiled MJCF.

    mimics   the mimic joints
    free     the body that becomes the root link, on a free joint
    notes    sentences that the URDF carries for the command `show`
    """
    # The model's own name is the first of its names.
    robot = Element(
        "robot",
        name=(model.names[: model.names.index(b"\0")].decode(errors="replace") or "robot"),
        version="1.1",
    )
    for note in notes:
        SubElement(robot, NOTE, text=note)
    drives = armatures(mujoco, model)
    writer = _Writer(mujoco, model, names, mimics, robot, drives, set(names.bodies), set(names.joints))
    root = 0 if free is None else free
    writer.link(names.body(root), root)
    for body in range(1, model.nbody):
        if body != root and _is_below(model, body, root):
            _body(writer, body)
    SubElement(robot, MJCF).append(kept_tree(mujoco, model, names))
    indent(robot)
    return tostring(robot, encoding="unicode") + "\n"


def _is_below(model: Any, body: int, root: int) -> bool:
    while body not in (0, root):
        body = int(model.body_parentid[body])
    return body == root


def _body(writer: _Writer, body: int) -> None:
    """The links and joints of one body."""
    model, names = writer.model, writer.names
    parent, own = names.body(model.body_parentid[body]), names.body(body)
    place, turn, anchor = model.body_pos[body], model.body_quat[body], np.zeros(3)
    first = int(model.body_jntadr[body])
    joints = range(first, first + int(model.body_jntnum[body]))
    for j in joints:
        axis, point = model.jnt_axis[j], model.jnt_pos[j]
        last = j == joints[-1] and not point.any()
        child = own if last else free_name(f"{own}_{names.joint(j)}", writer.links)
        writer.link(child, body if last else None)
        origin = place + _rotated(writer.mujoco, turn, point - anchor)
        _moving(writer, j, parent, child, _at_reference(writer, j, origin, turn, axis))
        parent, place, turn, anchor = child, np.zeros(3), UNTURNED, point
    if parent == own:
        return
    writer.link(own, body)
    fixed = free_name(f"{own}_fixed", writer.joints)
    writer.joint(fixed, "fixed", parent, own, (place - _rotated(writer.mujoco, turn, anchor), turn))


def _at_reference(writer: _Writer, j: int, origin: Array, turn: Array, axis: Array) -> tuple[Array, Array]:
    """Shift a joint's frame so that its q is the file's; ball joints have no reference. The frame is turned about, or
    shifted along, its axis by minus the reference."""
    model, mujoco = writer.model, writer.mujoco
    if _is_ball(writer, j):
        return origin, turn
    reference = float(model.qpos0[model.jnt_qposadr[j]])
    if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE:
        return origin - reference * _rotated(mujoco, turn, axis), turn
    back, product = np.zeros(4), np.zeros(4)
    mujoco.mju_axisAngle2Quat(back, np.array(axis), -reference)
    mujoco.mju_mulQuat(product, turn, back)
    return origin, product


def _moving(writer: _Writer, j: int, parent: str, child: str, place: tuple[Array, Array]) -> None:
    model, name = writer.model, writer.names.joint(j)
    if _is_ball(writer, j):
        element = writer.joint(name, "floating", parent, child, place)
        _dynamics(writer, j, element)
        SubElement(element, BALL)
        return
    slides = model.jnt_type[j] == writer.mujoco.mjtJoint.mjJNT_SLIDE
    limited, forced = bool(model.jnt_limited[j]), bool(model.jnt_actfrclimited[j])
    kind = "prismatic" if slides else "revolute" if limited else "continuous"
    element = writer.joint(name, kind, parent, child, place)
    SubElement(element, "axis", xyz=_numbers(model.jnt_axis[j]))
    limits: dict[str, str] = {}
    if limited:
        limits |= dict(zip(("lower", "upper"), map(_number, model.jnt_range[j]), strict=True))
    if forced:
        # The effort that a joint has in both directions; where it has but one, what it has in that.
        least, most = model.jnt_actfrcrange[j]
        both = min(-least, most)
        limits["effort"] = _number(both if both > 0.0 else max(abs(least), abs(most)))
    if limits:
        SubElement(element, "limit", limits)
    _dynamics(writer, j, element)
    if name in writer.mimics:
        rule = writer.mimics[name]
        numbers = {"multiplier": _number(rule.ratio), "offset": _number(rule.offset)}
        SubElement(element, "mimic", {"joint": rule.leader, **numbers})
    if writer.armatures[j] > 0.0:
        SubElement(element, DRIVE, inertia=_number(writer.armatures[j]))


def _is_ball(writer: _Writer, j: int) -> bool:
    return bool(writer.model.jnt_type[j] == writer.mujoco.mjtJoint.mjJNT_BALL)


def _dynamics(writer: _Writer, j: int, element: Element) -> None:
    model, dof = writer.model, int(writer.model.jnt_dofadr[j])
    damping, friction = model.dof_damping[dof], model.dof_frictionloss[dof]
    if damping > 0.0 or friction > 0.0:
        SubElement(element, "dynamics", damping=_number(damping), friction=_number(friction))


def _origin(parent: Element, place: Array, turn: Array) -> None:
    w, x, y, z = turn
    SubElement(parent, "origin", xyz=_numbers(place), quat_xyzw=_numbers((x, y, z, w)))


def _rotated(mujoco: Any, turn: Array, vector: Array) -> Array:
    found = np.zeros(3)
    mujoco.mju_rotVecQuat(found, np.array(vector), np.array(turn))
    return found


def _numbers(values: Array | Sequence[float]) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: Any) -> str:
    """All digits of a number; what is smaller than URDFs may have is zero."""
    plain = float(value)
    return repr(plain) if abs(plain) >= TINIEST else "0"


# The same model in MJCF's own words. It shares no computation with the URDF above: every number is copied from MuJoCo's
# arrays to the attribute that MuJoCo fills that array from.
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
    """Return a <mujoco> element with only the compiled model's bodies, inertias, joints, drives and gravity."""
    root = Element("mujoco", model="kept")
    SubElement(root, "compiler", COMPILER)
    SubElement(root, "option", gravity=_kept_numbers(model.opt.gravity))
    drives = armatures(mujoco, model)
    elements = [SubElement(root, "worldbody")]
    for body in range(1, model.nbody):
        place = {
            "pos": _kept_numbers(model.body_pos[body]),
            "quat": _kept_numbers(model.body_quat[body]),
        }
        element = SubElement(elements[model.body_parentid[body]], "body", {"name": names.body(body), **place})
        elements.append(element)
        if model.body_mass[body] > 0.0 or model.body_inertia[body].any():
            words = {"pos": "ipos", "quat": "iquat", "mass": "mass", "diaginertia": "inertia"}
            values = {word: getattr(model, f"body_{array}")[body] for word, array in words.items()}
            SubElement(element, "inertial", {word: _kept_numbers(value) for word, value in values.items()})
        first = int(model.body_jntadr[body])
        for j in range(first, first + int(model.body_jntnum[body])):
            _joint(element, mujoco, model, j, names.joint(j), drives[j])
    return root


def _joint(element: Element, mujoco: Any, model: Any, j: int, name: str, drive: float) -> None:
    kinds = mujoco.mjtJoint
    kind = kinds(model.jnt_type[j]).name.removeprefix("mjJNT_").lower()
    joint = SubElement(element, "joint", name=name, type=kind)
    if kind == "free":
        return
    joint.set("pos", _kept_numbers(model.jnt_pos[j]))
    joint.set("armature", _kept_numbers(drive))
    if kind != "ball":
        joint.set("axis", _kept_numbers(model.jnt_axis[j]))
        joint.set("ref", _kept_numbers(model.qpos0[model.jnt_qposadr[j]]))


def _kept_numbers(values: ArrayLike) -> str:
    """All digits of one or several numbers."""
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))
