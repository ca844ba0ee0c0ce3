"""Torques of a robot file as Pinocchio reads it: nothing of psdmc is used to read it."""

from __future__ import annotations

import math
import os
import tomllib
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any
from xml.etree.ElementTree import fromstring, tostring

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load_options import LoadOptions

Array = NDArray[np.float64]

STATES = 3
SEED = 6
ROOT = 7, 6
"""Coordinates and rates of a floating base."""


def torque_error(
    text: str, source_format: str, model: DynamicsModel, options: LoadOptions | None = None
) -> float | None:
    """Largest difference at three states over the largest torque.

    None where there is nothing to compare: theta_b is unknown, parameters are assumed zero, Pinocchio refuses the file, or
    numbers overflow.
    """
    given = options or LoadOptions()
    if model.theta_b is None or given.assume_zero:
        return None
    try:
        reference = _urdf_model(text, given.floating) if source_format == "urdf" else _dh_model(text)
    except (ValueError, RuntimeError):  # how Pinocchio refuses a file, and a body that cannot be
        return None
    if reference is None or not set(model.joint_names) <= set(reference.names):
        return None
    follows = _mimics(text) if source_format == "urdf" else {}
    if source_format == "urdf":
        _take_kept_armatures(reference, text)
    reference = _as_told(reference, model.joint_names, given)
    rng = np.random.default_rng(SEED)
    q, qd, qdd = (rng.uniform(-2.0, 2.0, (STATES, size)) for size in (model.nq, model.nv, model.nv))
    if given.floating:
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        joints = _Joints(reference, model.joint_names, follows, given)
        expected = np.array([joints.torques(*state) for state in zip(q, qd, qdd, strict=True)])
        largest = float(np.abs(expected).max())
        if not 1e-200 < largest < 1e200:
            return None
        return float(np.abs(model.inverse_dynamics(q, qd, qdd) - expected).max()) / largest


def _take_kept_armatures(reference: Any, text: str) -> None:
    """URDF has no word for armatures: psdmc keeps those of an MJCF file in the MJCF that it appends to its URDF."""
    armature = np.array(reference.armature)
    for joint in fromstring(text).iter("joint"):
        if "armature" in joint.attrib and reference.existJointName(joint.get("name", "")):
            armature[reference.joints[reference.getJointId(joint.get("name"))].idx_v] = float(
                joint.get("armature", "0")
            )
    reference.armature = armature


def _as_told(reference: Any, names: tuple[str, ...], options: LoadOptions) -> Any:
    """With the gravity and the drive inertias that the options give."""
    if options.gravity is not None:
        reference.gravity.linear = np.array(options.gravity)
    if not isinstance(options.drive_inertia, bool):
        armature = np.array(reference.armature)
        driven = names[1:] if options.floating else names
        for name, value in zip(driven, options.drive_inertia, strict=True):
            armature[reference.joints[reference.getJointId(name)].idx_v] = value
        reference.armature = armature
    elif options.drive_inertia:
        reference.armature = np.zeros(reference.nv)
    return reference


class _Joints:
    """What every joint of Pinocchio's model does at a state of the robot's coordinates: those of its joints that follow no
    other, in order, behind a floating base's. Joints beside the robot rest, at neutral or where they are locked."""

    def __init__(
        self, reference: Any, names: tuple[str, ...], follows: Mapping[str, tuple[str, float, float]],
        options: LoadOptions,
    ) -> None:  # fmt: skip
        self.reference, self.follows, self.lock = reference, follows, options.lock
        self.first = ROOT if options.floating else (0, 0)
        self.names = names[1:] if options.floating else names
        self.own = [name for name in self.names if name not in follows]

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        reference, ratios = self.reference, np.zeros((self.reference.nv, len(qd)))
        ratios[: self.first[1], : self.first[1]] = np.eye(self.first[1])
        at = pin.neutral(reference)
        at[: self.first[0]] = q[: self.first[0]]
        for name, joint in zip(list(reference.names)[1:], list(reference.joints)[1:], strict=True):
            leader, ratio, offset = self._moved_by(name)
            moves = name in self.names and leader in self.own
            if moves:
                number = self.own.index(leader)
                ratios[joint.idx_v, self.first[1] + number] = ratio
                offset += ratio * q[self.first[0] + number]
            if joint.nv == 1 and (moves or leader in self.lock or (ratio == 0.0 and name in self.follows)):
                at[joint.idx_q : joint.idx_q + joint.nq] = (
                    [math.cos(offset), math.sin(offset)] if joint.nq == 2 else offset
                )
        tau = pin.rnea(reference, reference.createData(), at, ratios @ qd, ratios @ qdd)
        return np.asarray(ratios.T @ tau)

    def _moved_by(self, name: str) -> tuple[str, float, float]:
        """The joint that one follows in the end, with its ratio and offset; a locked one's position is all offset."""
        if name in self.lock:
            return name, 0.0, self.lock[name]
        if name not in self.follows:
            return name, 1.0, 0.0
        leader, ratio, offset = self.follows[name]
        first, own, start = self._moved_by(leader)
        return first, ratio * own, ratio * start + offset


def _mimics(text: str) -> dict[str, tuple[str, float, float]]:
    """Leader, multiplier and offset of each mimic joint that can move."""
    found = {}
    for joint in fromstring(text).findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type", "").strip() != "fixed":
            numbers = (
                float(mimic.get(name, default)) for name, default in (("multiplier", "1"), ("offset", "0"))
            )
            found[joint.get("name", "").strip()] = (mimic.get("joint", "").strip(), *numbers)
    return found


def _urdf_model(text: str, floating: bool = False) -> Any:
    """White space around attributes is dropped, as urdfdom reads "9.4 " as nothing; pictures are left out."""
    root = fromstring(text)
    for element in root.iter():
        for name, value in element.attrib.items():
            element.set(name, value.strip())
    for link in root.findall("link"):
        for picture in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(picture)
    with _quiet():
        free = [pin.JointModelFreeFlyer()] if floating else []
        return pin.buildModelFromXML(tostring(root, encoding="unicode"), *free)


@contextmanager
def _quiet() -> Iterator[None]:
    """What urdfdom says of a file that it refuses is not psdmc's noise."""
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


def _dh_model(text: str) -> Any:
    """A DH table with known bodies, joint by joint."""
    table = tomllib.loads(text)
    rows = table["joint"]
    if any(
        "zero" in row.get("link", {}) or len(row.get("link", {}).get("inertia_com", {})) < 6 for row in rows
    ):
        return None
    model = pin.Model()
    model.gravity.linear = np.array(table.get("gravity", (0.0, 0.0, -9.81)), dtype=float)
    parent, before = 0, pin.SE3.Identity()
    ends = {"base": (0, pin.SE3.Identity())}
    for number, row in enumerate(rows, start=1):
        if "parent" in row:
            parent, before = ends[row["parent"]]
        turns = row.get("type", "revolute") == "revolute"
        placement, rest = _placements(row, table.get("convention", "standard") == "standard")
        kind = pin.JointModelRZ() if turns else pin.JointModelPZ()
        parent = model.addJoint(parent, kind, before * placement, row.get("name", f"joint{number}"))
        model.appendBodyToJoint(parent, _body(row["link"]), rest)
        armature = np.array(model.armature)
        armature[-1] = row.get("drive_inertia", 0.0)
        model.armature = armature
        before = rest
        ends[row.get("name", f"joint{number}")] = (parent, rest)
    return model


def _placements(row: dict[str, Any], standard: bool) -> tuple[Any, Any]:
    """Before the joint's motion and after it, up to the link's frame."""
    twist = pin.SE3(
        pin.utils.rotate("x", _angle(row.get("alpha", 0.0))), np.array([row.get("a", 0.0), 0.0, 0.0])
    )
    turn = pin.SE3(
        pin.utils.rotate("z", _angle(row.get("theta", 0.0))), np.array([0.0, 0.0, row.get("d", 0.0)])
    )
    return (turn, twist) if standard else (twist * turn, pin.SE3.Identity())


def _angle(value: float | str) -> float:
    if not isinstance(value, str):
        return float(value)
    number, unit = float(value.strip()[:-3]), value.strip()[-3:]
    return math.radians(number) if unit == "deg" else number


def _body(link: dict[str, Any]) -> Any:
    i = link["inertia_com"]
    matrix = np.array([[i["xx"], i["xy"], i["xz"]], [i["xy"], i["yy"], i["yz"]], [i["xz"], i["yz"], i["zz"]]])
    return pin.Inertia(float(link["mass"]), np.array(link["com"], dtype=float), matrix.astype(float))
