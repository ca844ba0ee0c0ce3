"""Computes a robot's torques with MuJoCo, if it is installed. MuJoCo is a second reference besides Pinocchio: it reads
files and computes torques by other code."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from psdmc.robot.limits import shown
from psdmc.robot.load import LoadedRobot
from psdmc.robot.mechanism import DRIVE, Array, Mechanism
from psdmc.robot.mjcf.mujoco_model import kept_warnings
from psdmc.robot.placement import from_quaternion
from psdmc.robot.reference_model import has_assumptions
from psdmc.robot.urdf.dependent_joints import held_positions
from psdmc.robot.urdf.pinocchio_text import JOINT_PREFIX, dynamics_of
from psdmc.robot.urdf.read_urdf import read_urdf
from psdmc.robot.urdf.urdf_draft import STANDARD_GRAVITY
from psdmc.robot.urdf.urdf_words import ATTRIBUTES, MJCF, SPACE
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

UNSURE = "MuJoCo needs all inertial parameters, and some are unknown or assumed zero"
"""Why a robot is not compared."""

REASON = 160
"""Characters of MuJoCo's own message that an error repeats."""


States = tuple[Array, Array, Array]
"""q (k, nq), qd and qdd (k, nv)."""


class NotCompared(Exception):
    """An exception: MuJoCo is not installed or cannot read a robot. The message says why."""


def mujoco_version() -> str:
    """Return the version of the installed MuJoCo. Raises NotCompared if there is none."""
    return str(_mujoco().__version__)


def mujoco_torques(loaded: LoadedRobot, q: Array, qd: Array, qdd: Array) -> Array:
    """Return the torques (k, nv), N m (N), that MuJoCo computes from the robot's file. They are for k states q (k, nq),
    qd and qdd (k, nv).

    Raises NotCompared if MuJoCo is not installed, or does not read this file.
    """
    mujoco = _mujoco()
    chain, own = loaded.mechanism, _own_file(loaded)
    if own is not None:
        return _file_torques(mujoco, loaded, own, (q, qd, qdd))
    model = _model(mujoco, loaded)
    held = _held(loaded)

    def numbers(names: Iterable[str]) -> list[int]:
        return [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, JOINT_PREFIX + name) for name in names]

    rates = [kind.nv for kind in chain.types]
    joints, others = numbers(chain.joint_names), numbers(held)
    if -1 in [*joints, *others] or model.nv != sum(rates) + len(others):
        raise NotCompared("MuJoCo finds other joints")
    places = _entries(model.jnt_qposadr[joints], [kind.nq for kind in chain.types])
    speeds = _entries(model.jnt_dofadr[joints], rates)
    model.dof_armature[speeds] = np.repeat(chain.parameters[:, DRIVE], rates)
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[others]] = list(held.values())
    return _inverse(mujoco, model, data, (places, speeds), _free_joint(chain), (q, qd, qdd))


def _inverse(
    mujoco: Any, model: Any, data: Any, of: tuple[list[int], list[int]], free: bool, states: States
) -> Array:
    """(k, nv) torques of the robot whose coordinates and rates MuJoCo has at the places `of`; `free`: the first joint is."""
    (places, speeds), (q, qd, qdd) = of, to_mujoco(*states) if free else states
    torques = np.zeros_like(qd)
    for k in range(len(q)):
        data.qpos[places], data.qvel[speeds], data.qacc[speeds] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        torques[k] = data.qfrc_inverse[speeds]
    return force_from_mujoco(q, torques) if free else torques


def _own_file(loaded: LoadedRobot) -> Element | None:
    """The MJCF that the robot was read from, as MuJoCo compiled it; None of other files."""
    if loaded.source_format != "urdf" or SPACE not in loaded.source_text:
        return None
    kept = parse_xml(loaded.source_text, loaded.source_name, "robot").find(MJCF)
    return None if kept is None else kept.find("mujoco")


def _file_torques(mujoco: Any, loaded: LoadedRobot, own: Element, states: States) -> Array:
    """The torques of the file's own bodies and joints; joints that are not the robot's are where it locks them."""
    if loaded.options.assume_zero or np.isnan(loaded.mechanism.parameters).any():
        raise NotCompared(UNSURE)
    model = _compiled(mujoco, tostring(own, encoding="unicode"), loaded)
    kinds, chain = mujoco.mjtJoint, loaded.mechanism
    free = _free_joint(chain)
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
    is_free = [kind == kinds.mjJNT_FREE for kind in model.jnt_type]
    if free != any(is_free):
        raise NotCompared("in MuJoCo's file another body is free, or none")
    joints = [
        is_free.index(True) if free and k == 0 else _place(names, name)
        for k, name in enumerate(chain.joint_names)
    ]
    rates = [kind.nv for kind in chain.types]
    speeds = _entries(model.jnt_dofadr[joints], rates)
    places = _entries(model.jnt_qposadr[joints], [kind.nq for kind in chain.types])
    if loaded.options.drive_inertia is not False:
        model.dof_armature[speeds] = np.repeat(chain.parameters[:, DRIVE], rates)
    data, held = mujoco.MjData(model), _held(loaded)
    for j, name in enumerate(names):
        if model.jnt_type[j] == kinds.mjJNT_HINGE or model.jnt_type[j] == kinds.mjJNT_SLIDE:
            data.qpos[model.jnt_qposadr[j]] = held.get(name, 0.0)
    # A ball joint's quaternion is x y z w here, and w x y z there; to_mujoco turns the floating base's.
    for k, kind in enumerate(chain.types):
        if kind.mujoco == "ball":
            start = sum(one.nq for one in chain.types[:k])
            places[start : start + 4] = [*places[start + 1 : start + 4], places[start]]
    return _inverse(mujoco, model, data, (places, speeds), free, states)


def _place(names: Sequence[str], name: str) -> int:
    if name not in names:
        raise NotCompared(f"MuJoCo finds no joint {shown(name)}")
    return names.index(name)


def _free_joint(chain: Mechanism) -> bool:
    """Whether the first joint is free, and no other; NotCompared where MuJoCo has no such joints, or means others."""
    kinds = [joint.type.mujoco for joint in chain.joints]
    if "none" in kinds:
        raise NotCompared(f"MuJoCo has no joint like {shown(chain.joints[kinds.index('none')].name)}")
    if "free" in kinds[1:]:
        raise NotCompared("MuJoCo's free joints are compared where they come first")
    root = chain.joints[0].placement
    is_world = np.all(root.rotation == np.eye(3)) and not root.translation.any()
    if "free" in kinds and not is_world:
        raise NotCompared("MuJoCo's free joints are about the world's frame")
    return "free" in kinds


def _entries(first: Array, counts: Sequence[int]) -> list[int]:
    """Where several joints' entries are: so many from each of these places."""
    return [int(start) + k for start, count in zip(first, counts, strict=True) for k in range(count)]


def to_mujoco(q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
    """Return k states q (k, nq), qd and qdd (k, nv) of a robot with a floating base, in MuJoCo's conventions.

    The quaternion becomes (w, x, y, z). The linear rates become those along the world's axes. The acceleration of the
    base's origin is a + w x v along the base's axes, for rates v, w and their derivatives a.
    """
    turn = _rotations(q[:, [6, 3, 4, 5]])
    linear, angular = qd[:, :3], qd[:, 3:6]
    return (
        np.concatenate([q[:, :3], q[:, [6, 3, 4, 5]], q[:, 7:]], axis=1),
        np.concatenate([_turned(turn, linear), qd[:, 3:]], axis=1),
        np.concatenate([_turned(turn, qdd[:, :3] + np.cross(angular, linear)), qdd[:, 3:]], axis=1),
    )


def force_from_mujoco(q: Array, tau: Array) -> Array:
    """Return joint efforts (k, nv) for k states with the force on the floating base along the axes of the base.
    MuJoCo's efforts have the force along the world's axes; `q` is in MuJoCo's convention."""
    back = np.swapaxes(_rotations(q[:, 3:7]), 1, 2)
    return np.concatenate([_turned(back, tau[:, :3]), tau[:, 3:]], axis=1)


def _rotations(wxyz: Array) -> Array:
    """(k, 3, 3) of quaternions (k, 4)."""
    return np.array([from_quaternion(x, y, z, w) for w, x, y, z in wxyz])


def _turned(turn: Array, v: Array) -> Array:
    return np.asarray(np.einsum("kij,kj->ki", turn, v))


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
        raise NotCompared(UNSURE)
    root = parse_xml(loaded.source_text, loaded.source_name, "robot")
    if any(element.get("quat_xyzw") is not None for element in root.iter("origin")):
        raise NotCompared("MuJoCo reads no quat_xyzw")
    moving = [*loaded.mechanism.joint_names, *_held(loaded)]
    if loaded.options.floating:
        # The root link on a floating joint, which MuJoCo makes a free one.
        free = SubElement(root, "joint", name=loaded.mechanism.joint_names[0], type="floating")
        SubElement(root, "link", name=loaded.mechanism.base_name)
        SubElement(free, "parent", link=loaded.mechanism.base_name)
        SubElement(free, "child", link=loaded.mechanism.joints[0].link_name)
    _drop_still_bodies(root, moving)
    dropped = _massless(root)
    if dropped:
        raise NotCompared(f"MuJoCo drops inertia without mass, as link {shown(dropped)} has it")
    text = dynamics_of(root, moving, {})
    SubElement(SubElement(text, "mujoco"), "compiler", COMPILER)
    return _compiled(mujoco, tostring(text, encoding="unicode"), loaded)


def _compiled(mujoco: Any, text: str, loaded: LoadedRobot) -> Any:
    """MuJoCo's model of a text, without constraints; NotCompared where it refuses it."""
    try:
        with kept_warnings(mujoco):
            model = mujoco.MjModel.from_xml_string(text)
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
