"""Torques of a robot file as Pinocchio reads it: nothing of psdmc is used to read it."""

from __future__ import annotations

import math
import os
import tomllib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from xml.etree.ElementTree import fromstring, tostring

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from psdmc.model.dynamics_model import DynamicsModel

Array = NDArray[np.float64]

STATES = 3
SEED = 6


def torque_error(text: str, source_format: str, model: DynamicsModel) -> float | None:
    """Largest difference at three states over the largest torque.

    None where there is nothing to compare: theta_b is unknown, Pinocchio refuses the file, or numbers overflow.
    """
    if model.theta_b is None:
        return None
    try:
        reference = _urdf_model(text) if source_format == "urdf" else _dh_model(text)
    except (ValueError, RuntimeError):  # how Pinocchio refuses a file, and a body that cannot be
        return None
    if reference is None or not set(model.joint_names) <= set(reference.names):
        return None
    rng = np.random.default_rng(SEED)
    q, qd, qdd = (rng.uniform(-2.0, 2.0, (STATES, model.n)) for _ in range(3))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = np.array(
            [_rnea(reference, model.joint_names, *state) for state in zip(q, qd, qdd, strict=True)]
        )
        largest = float(np.abs(expected).max())
        if not 1e-200 < largest < 1e200:
            return None
        return float(np.abs(model.inverse_dynamics(q, qd, qdd) - expected).max()) / largest


def _rnea(reference: Any, names: tuple[str, ...], q: Array, qd: Array, qdd: Array) -> Array:
    """Torques of these joints; all others rest at neutral."""
    columns = [reference.joints[reference.getJointId(name)].idx_v for name in names]
    full = [np.zeros(reference.nv) for _ in range(3)]
    for vector, values in zip(full, (q, qd, qdd), strict=True):
        vector[columns] = values
    at = pin.integrate(reference, pin.neutral(reference), full[0])
    tau: Array = pin.rnea(reference, reference.createData(), at, full[1], full[2])[columns]
    return tau


def _urdf_model(text: str) -> Any:
    """White space around attributes is dropped, as urdfdom reads "9.4 " as nothing; pictures are left out."""
    root = fromstring(text)
    for element in root.iter():
        for name, value in element.attrib.items():
            element.set(name, value.strip())
    for link in root.findall("link"):
        for picture in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(picture)
    with _quiet():
        return pin.buildModelFromXML(tostring(root, encoding="unicode"))


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
    for number, row in enumerate(rows, start=1):
        turns = row.get("type", "revolute") == "revolute"
        placement, rest = _placements(row, table.get("convention", "standard") == "standard")
        kind = pin.JointModelRZ() if turns else pin.JointModelPZ()
        parent = model.addJoint(parent, kind, before * placement, row.get("name", f"joint{number}"))
        model.appendBodyToJoint(parent, _body(row["link"]), rest)
        armature = np.array(model.armature)
        armature[-1] = row.get("drive_inertia", 0.0)
        model.armature = armature
        before = rest
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
