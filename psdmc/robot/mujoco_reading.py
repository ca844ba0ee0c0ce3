"""MuJoCo's reading of a URDF, where MuJoCo is installed: a second reference, whose parser and algorithm are not
Pinocchio's."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from psdmc.robot.limits import shown
from psdmc.robot.load import LoadedRobot
from psdmc.robot.lock import held_positions
from psdmc.robot.mechanism import DRIVE, Array
from psdmc.robot.pinocchio_text import JOINT_PREFIX, dynamics_of
from psdmc.robot.reference import has_assumptions
from psdmc.robot.urdf import read_urdf
from psdmc.robot.urdf_chain import STANDARD_GRAVITY
from psdmc.robot.urdf_words import ATTRIBUTES
from psdmc.robot.xml_text import parse_xml

COMPILER = {
    "angle": "radian",
    "balanceinertia": "false",
    "boundmass": "0",
    "boundinertia": "0",
    "inertiafromgeom": "false",
    "fusestatic": "true",
    "discardvisual": "true",
}
"""Settings by which MuJoCo keeps the file's numbers; bodies without a joint are merged into those that they hang on."""

REASON = 160
"""Characters of MuJoCo's own message that an error repeats."""


class NotCompared(Exception):
    """MuJoCo cannot read this robot; the message says why."""


def mujoco_version() -> str:
    """Of the MuJoCo that is installed; NotCompared where there is none."""
    return str(_mujoco().__version__)


def mujoco_torques(loaded: LoadedRobot, q: Array, qd: Array, qdd: Array) -> Array:
    """(k, n) torques of the robot's own bodies as MuJoCo reads the file, at states (k, n), N m (N).

    NotCompared where MuJoCo is not installed, or does not read this file.
    """
    mujoco = _mujoco()
    model = _model(mujoco, loaded)
    held = _held(loaded)

    def numbers(names: Iterable[str]) -> list[int]:
        return [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, JOINT_PREFIX + name) for name in names]

    joints, others = numbers(loaded.mechanism.joint_names), numbers(held)
    if -1 in [*joints, *others] or model.nv != len(joints) + len(others):
        raise NotCompared("MuJoCo finds other joints")
    places, speeds = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    model.dof_armature[speeds] = loaded.mechanism.parameters[:, DRIVE]
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[others]] = list(held.values())
    torques = np.zeros_like(q)
    for k in range(len(q)):
        data.qpos[places], data.qvel[speeds], data.qacc[speeds] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        torques[k] = data.qfrc_inverse[speeds]
    return torques


def _held(loaded: LoadedRobot) -> dict[str, float]:
    """Joints that are locked elsewhere than at zero: MuJoCo has them, without rates, and their torques are not asked for."""
    if loaded.source_format != "urdf":
        return {}
    robot = read_urdf(loaded.source_text, loaded.source_name)
    held = held_positions(robot, loaded.options.lock, loaded.source_name)
    return {name: value for name, value in held.items() if value != 0.0}


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError:
        raise NotCompared("MuJoCo is not installed") from None
    return mujoco


def _model(mujoco: Any, loaded: LoadedRobot) -> Any:
    """MuJoCo's model, all but the chain's joints fixed, without contacts and limits."""
    if loaded.source_format != "urdf":
        raise NotCompared("MuJoCo reads no DH tables")
    if has_assumptions(loaded):
        raise NotCompared("MuJoCo cannot be told of parameters assumed zero")
    root = parse_xml(loaded.source_text, loaded.source_name, "robot")
    if any(element.get("quat_xyzw") is not None for element in root.iter("origin")):
        raise NotCompared("MuJoCo reads no quat_xyzw")
    moving = [*loaded.mechanism.joint_names, *_held(loaded)]
    _drop_still_bodies(root, moving)
    dropped = _massless(root)
    if dropped:
        raise NotCompared(f"MuJoCo drops inertia without mass, as link {shown(dropped)} has it")
    text = dynamics_of(root, moving, {})
    SubElement(SubElement(text, "mujoco"), "compiler", COMPILER)
    try:
        model = mujoco.MjModel.from_xml_string(tostring(text, encoding="unicode"))
    except ValueError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise NotCompared(f"MuJoCo refuses it: {shown(reason[:REASON])}") from None
    model.opt.gravity[:] = loaded.options.gravity or STANDARD_GRAVITY
    disabled = mujoco.mjtDisableBit
    model.opt.disableflags |= disabled.mjDSBL_CONSTRAINT
    return model


def _drop_still_bodies(root: Element, moving: Collection[str]) -> None:
    """Take the bodies of links that no joint moves out: they have no part in any torque, and MuJoCo looks at them."""
    above = {}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            above[child.get("link")] = joint.get("name", ""), parent.get("link")
    for link in root.findall("link"):
        name, inertial = link.get("name"), link.find("inertial")
        while name in above and above[name][0] not in moving:
            name = above[name][1]
        if name not in above and inertial is not None:
            link.remove(inertial)


def _massless(root: Element) -> str | None:
    """The first link with inertia but no mass, which MuJoCo leaves out where it merges links."""
    for link in root.findall("link"):
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        if mass is None or inertia is None or float(mass.get("value", "0")) != 0.0:
            continue
        if any(float(inertia.get(name, "0")) for name in ATTRIBUTES["inertia"]):
            return link.get("name")
    return None
