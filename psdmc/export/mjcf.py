"""Writes an MJCF without shapes, with what a URDF cannot hold: gravity, and drive inertia as `armature`."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from psdmc.export.bodies import Body, Written
from psdmc.export.elements import exact
from psdmc.robot.inertia import inertia_matrix
from psdmc.robot.mechanism import BASE, Array, Placement

COMPILER = {
    "angle": "radian",
    "autolimits": "true",
    "balanceinertia": "false",
    "boundmass": "0",
    "boundinertia": "0",
    "inertiafromgeom": "false",
}
MARK = " ".join(f'{name}="{value}"' for name, value in COMPILER.items())
"""Text by which psdmc knows an MJCF as its own."""
FULL = (0, 2, 5, 1, 3, 4)
"""Order of MuJoCo's fullinertia, xx yy zz xy xz yz, in INERTIA_NAMES."""


def mjcf_of(what: Written) -> Element:
    """Return the element <mujoco>. A mimic joint becomes an equality constraint, fulfilled approximately."""
    root = Element("mujoco", model=what.name)
    SubElement(root, "compiler", COMPILER)
    SubElement(root, "option", gravity=exact(what.gravity))
    world = SubElement(root, "worldbody")
    elements: list[Element] = []
    for body in what.bodies:
        outer = _base(world, what, body) if body.parent == BASE else elements[body.parent]
        elements.append(_body(outer, body))
    for frame in what.frames:
        _place(SubElement(elements[frame.joint], "site", name=frame.name), frame.placement)
    mimics = [(body, body.mimic) for body in what.bodies if body.mimic is not None]
    equality = SubElement(root, "equality") if mimics else None
    for body, mimic in mimics:
        if equality is not None and mimic.leader is not None:
            leader = what.bodies[mimic.leader].joint.name
            bent = exact([mimic.offset, mimic.ratio, 0.0, 0.0, 0.0])
            SubElement(equality, "joint", joint1=body.joint.name, joint2=leader, polycoef=bent)
    return root


def _base(world: Element, what: Written, body: Body) -> Element:
    """Return the element that contains a body of the base: for a free body, the world itself."""
    if not body.joint.type.about_z:
        return world
    found = world.find("body")
    if found is not None:
        return found
    names = {each.name for each in what.bodies}
    name = what.base
    while name in names or name == RESERVED:
        name += "_"
    base = SubElement(world, "body", name=name)
    _place(base, what.world or Placement.identity())
    return base


RESERVED = "world"
"""MuJoCo's own name of the outermost body."""
LEAST_MASS = 1e-14
"""kg, and kg m^2: MuJoCo takes no moving body without mass, or without inertia about an axis; the least that is written."""


def _place(element: Element, place: Placement) -> None:
    element.set("pos", exact(place.translation))
    element.set("quat", exact(quaternion_of(place.rotation)))


def _body(outer: Element, body: Body) -> Element:
    element = SubElement(outer, "body", name=body.name)
    _place(element, body.origin)
    if not body.joint.type.about_z:
        SubElement(element, "freejoint", name=body.joint.name)
    else:
        SubElement(element, "joint", _joint(body))
    mass, com, six = body.inertial or (LEAST_MASS, np.zeros(3), np.zeros(6))
    xx, yy, zz, *products = np.array(six)[list(FULL)]
    lift = max(0.0, LEAST_MASS - float(np.linalg.eigvalsh(inertia_matrix(np.array(six)))[0]))
    full = exact([xx + lift, yy + lift, zz + lift, *products])
    SubElement(element, "inertial", pos=exact(com), mass=exact([mass]), fullinertia=full)
    return element


def _joint(body: Body) -> dict[str, str]:
    limits, friction = body.joint.limits, body.friction
    found = {"name": body.joint.name, "type": body.joint.type.mujoco, "axis": exact(body.axis)}
    if math.isfinite(limits.lower) and math.isfinite(limits.upper) and limits.lower < limits.upper:
        found["range"] = exact([limits.lower, limits.upper])
    if math.isfinite(limits.effort) and limits.effort > 0.0:
        found["actuatorfrcrange"] = exact([-limits.effort, limits.effort])
    if body.drive > 0.0:
        found["armature"] = exact([body.drive])
    if friction is not None:
        found |= {"damping": exact([friction.damping]), "frictionloss": exact([friction.constant])}
    return found


def quaternion_of(rotation: Array) -> tuple[float, float, float, float]:
    """Return the unit quaternion (w, x, y, z) of a rotation, with w not negative.

    The largest component is computed first, so that no digits are lost.
    """
    r = rotation
    trace = float(np.trace(r))
    diagonal = [trace, float(r[0, 0]), float(r[1, 1]), float(r[2, 2])]
    k = int(np.argmax(diagonal))
    if k == 0:
        w = 1.0 + trace
        found = np.array([w, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    else:
        i = k - 1
        j, m = (i + 1) % 3, (i + 2) % 3
        found = np.zeros(4)
        found[0] = r[m, j] - r[j, m]
        found[1 + i] = 1.0 + 2.0 * r[i, i] - trace
        found[1 + j] = r[j, i] + r[i, j]
        found[1 + m] = r[m, i] + r[i, m]
    w, x, y, z = (found / np.linalg.norm(found)).tolist()
    return (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)
