"""MuJoCo's inverse dynamics, called in C from the library in its wheel."""

from __future__ import annotations

import ctypes
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from psdmc.bench.case import Case, refuse_unlike
from psdmc.bench.contestant import Contestant, Unavailable, source
from psdmc.bench.machine import built, cxx, version_of
from psdmc.dynamics.parameters import inertia_matrix, joint_frame_map
from psdmc.errors import InputError, ToolchainError
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import BASE, DRIVE, FREE_RATES, Array, Mechanism

RIVAL = "MuJoCo"
FUNCTIONS = ("inverse_dynamics", "nonlinear_effects")

OTHER_BIAS = "a floating base's rates are along the world's axes there, which makes its bias another"


def contestants(case: Case, flags: tuple[str, ...]) -> list[Contestant | Unavailable]:
    """Return MuJoCo's functions for one robot. A robot with drive inertia (motors and gears) is refused, because
    MuJoCo's Newton-Euler recursion leaves drive inertia out. A robot with a link without mass is refused, too."""
    if case.has_drive_inertia:
        return [Unavailable(RIVAL, "its mj_rne leaves drive inertia out")]
    if np.any(case.chain.parameters[:, 0] <= 0.0):
        return [Unavailable(RIVAL, "it wants mass on every link")]
    robot = mjcf(case.chain)
    library = _compiled(flags)
    if ctypes.CDLL(str(library)).setup(robot.encode()) != case.chain.nv:
        return [Unavailable(RIVAL, "it refuses this robot's inertia")]
    found: list[Contestant | Unavailable] = [
        Contestant(RIVAL, name, library, name, case.chain.nv, convention="MuJoCo", robot=robot)
        for name in FUNCTIONS
        if name == "inverse_dynamics" or not case.is_wide
    ]
    return [*found, *([Unavailable(f"{RIVAL}, nonlinear_effects", OTHER_BIAS)] if case.is_wide else [])]


def _compiled(flags: tuple[str, ...]) -> Path:
    folder = _mujoco()
    library = next(iter(sorted(folder.glob("libmujoco.so*"))), None)
    if library is None:
        raise ToolchainError("this MuJoCo came without its C library", "install the wheel 'mujoco'")
    command = [
        cxx(),
        "-std=c++17",
        *flags,
        "-DNDEBUG",
        "-shared",
        "-isystem",
        str(folder / "include"),
        "mujoco_c.cpp",
    ]
    command += [str(library), f"-Wl,-rpath,{folder}", "-o", "mujoco_c.so"]
    sources = {name: source(name) for name in ("mujoco_c.cpp", "loops.hpp")}
    return built("mujoco_c.so", command, sources, [version_of("mujoco")])


def _mujoco() -> Path:
    found = find_spec("mujoco")
    if found is None or found.origin is None:
        raise ToolchainError("the wheel 'mujoco' is not installed", "pip install mujoco")
    return Path(found.origin).parent


def mjcf(chain: Mechanism) -> str:
    """Return the robot as MuJoCo's XML, with one body per joint. Each body's frame is psdmc's joint frame.

    Raise InputError if MuJoCo has no such joint, or allows a free joint only at another place in the tree.
    """
    refuse_unlike(chain)
    _refuse_moved_root(chain)
    root = ElementTree.Element("mujoco", model="robot")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="false")
    ElementTree.SubElement(root, "option", gravity=_text(chain.gravity))
    world = ElementTree.SubElement(root, "worldbody")
    bodies: list[ElementTree.Element] = []
    for joint, parent, row in zip(chain.joints, chain.parents, chain.parameters, strict=True):
        body = ElementTree.SubElement(
            world if parent == BASE else bodies[parent],
            "body",
            pos=_text(joint.placement.translation),
            quat=_text(quaternion(joint.placement.rotation)),
        )
        moving = ElementTree.SubElement(body, "joint", type=joint.type.mujoco)
        if joint.type.about_z:
            moving.set("axis", "0 0 1")
        _add_inertia(body, joint_frame_map(joint.link_frame) @ row[:DRIVE])
        bodies.append(body)
    return ElementTree.tostring(root, encoding="unicode")


def _refuse_moved_root(chain: Mechanism) -> None:
    """MuJoCo's free joints are on the world, and their positions are the body's in the world."""
    for joint, parent in zip(chain.joints, chain.parents, strict=True):
        placed = np.any(joint.placement.translation) or np.any(joint.placement.rotation != np.eye(3))
        if joint.type.nv == FREE_RATES and (parent != BASE or placed):
            raise InputError(
                f"its free joints are on the world, and {shown(joint.name)} is elsewhere", "leave it out"
            )


def _add_inertia(body: ElementTree.Element, x: Array) -> None:
    """Add a body's inertia about its centre of mass, as MuJoCo's format requires."""
    mass, com = float(x[0]), x[1:4] / x[0]
    about_com = inertia_matrix(x) - mass * (com @ com * np.eye(3) - np.outer(com, com))
    full = about_com[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    ElementTree.SubElement(body, "inertial", pos=_text(com), mass=repr(mass), fullinertia=_text(full))


def quaternion(rotation: Array) -> Array:
    """Return the (4,) unit quaternion w x y z of a rotation, from the largest of its four squares (Shepperd 1978)."""
    m = rotation
    squares = np.array([np.trace(m), m[0, 0], m[1, 1], m[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array([1.0 + np.trace(m), m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    else:
        i = k - 1
        j, l = (i + 1) % 3, (i + 2) % 3
        q = np.zeros(4)
        q[0] = m[l, j] - m[j, l]
        q[1 + i] = 1.0 + m[i, i] - m[j, j] - m[l, l]
        q[1 + j], q[1 + l] = m[j, i] + m[i, j], m[l, i] + m[i, l]
    unit: Array = q / np.linalg.norm(q)
    return unit


def _text(values: Array) -> str:
    return " ".join(repr(value) for value in np.ravel(values).tolist())
