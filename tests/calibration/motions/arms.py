"""A three-joint URDF with shapes and effort limits, for planned motions, and Pinocchio's own reading of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

LENGTH = 0.5


def urdf(effort: float = 60.0, shapes: bool = True) -> str:
    """A column that turns, and two links of boxes that can hit its foot."""

    def link(name: str, mass: float, size: tuple[float, float, float], z: float) -> str:
        edges = " ".join(map(str, size))
        box = f'<collision><origin xyz="0 0 {z}"/><geometry><box size="{edges}"/></geometry></collision>'
        inertia = '<inertia ixx="0.05" iyy="0.06" izz="0.02" ixy="0.001" ixz="0" iyz="0.002"/>'
        body = f'<inertial><origin xyz="0.01 0.02 {z}"/><mass value="{mass}"/>{inertia}</inertial>'
        return f'<link name="{name}">{body}{box if shapes else ""}</link>'

    def joint(name: str, parent: str, child: str, xyz: str, axis: str, reach: float) -> str:
        limit = f'<limit lower="{-reach}" upper="{reach}" velocity="3" effort="{effort}"/>'
        return (
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'
        )

    return (
        '<robot name="crane">'
        + link("base", 1.0, (0.9, 0.9, 0.1), 0.05)
        + link("column", 4.0, (0.1, 0.1, 0.3), 0.25)
        + link("upper", 3.0, (0.08, 0.08, 0.4), 0.25)
        + link("lower", 2.0, (0.06, 0.06, 0.4), 0.25)
        + joint("turn", "base", "column", "0 0 0", "0 0 1", 3.0)
        + joint("lift", "column", "upper", "0 0.12 0.45", "0 1 0", 2.6)
        + joint("bend", "upper", "lower", f"0 0.1 {LENGTH}", "0 1 0", 2.9)
        + "</robot>"
    )


def pinocchio_of(folder: Path, text: str) -> tuple[Any, Any]:
    """Pinocchio's model and shapes of the file as it reads it alone, all pairs that are no neighbours."""
    file = folder / "crane.urdf"
    file.write_text(text, encoding="utf-8")
    model = pin.buildModelFromUrdf(str(file))
    shapes = pin.buildGeomFromUrdf(model, str(file), pin.GeometryType.COLLISION)
    shapes.addAllCollisionPairs()
    for pair in list(shapes.collisionPairs):
        a, b = sorted(shapes.geometryObjects[k].parentJoint for k in (pair.first, pair.second))
        if model.parents[b] == a:
            shapes.removeCollisionPair(pair)
    return model, shapes


def torques(model: Any, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """(N, n) by Pinocchio's recursion."""
    data = model.createData()
    return np.array([pin.rnea(model, data, a, b, c) for a, b, c in zip(q, qd, qdd, strict=True)])
