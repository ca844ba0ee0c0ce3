"""Reads an MJCF file by MuJoCo's own compiler, which resolves defaults, includes, inertias of shapes and reference
positions.

The compiled model is converted to a URDF of the same tree (psdmc/robot/mjcf/to_urdf.py). So all functions for URDFs work.
A model file contains this URDF, which can be read again without MuJoCo and the included files.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.robot.limits import listed, shown
from psdmc.robot.mjcf.constraints import (
    mimic_joints,
    mjcf_loops,
    of_balls,
    refuse_armatures,
    refuse_constraints,
    refuse_references,
)
from psdmc.robot.mjcf.copies import refuse_many_copies
from psdmc.robot.mjcf.mujoco_model import Names, acting, gravity, is_active, is_odd, kept_warnings, named
from psdmc.robot.mjcf.to_urdf import tree_text

NOT_A_NUMBER = "NaN"
"""What MuJoCo's warning of such a number has in it."""

MOST_LISTED = 12
"""Bodies that a message names."""

NO_INERTIA = "mass and inertia of moving bodies must be larger"
"""What MuJoCo says of a moving body without them."""

LEAST = 2.0**-46
"""kg, kg m^2: above MuJoCo's mjMINVAL (1e-15), and a number that no file has."""

REASON = 300
"""Characters of MuJoCo's own message that an error repeats."""


@dataclass(frozen=True, slots=True)
class MjcfRobot:
    """The result of reading an MJCF file. `text` is a URDF of the tree, and `gravity` is in m/s^2 along the world's
    axes. `is_free` says whether the root link is on a free joint. `loops` are tables of closed loops."""

    text: str
    gravity: tuple[float, float, float]
    is_free: bool
    loops: tuple[dict[str, Any], ...] = ()


def read_mjcf(path: Path, source: str, root: str | None = None) -> MjcfRobot:
    """Return the robot in an MJCF file.

    root   the robot's first body if several separate bodies move; the others are left out

    Raises InputError if MuJoCo is not installed or rejects the file, or if the file has elements that psdmc does not
    model.
    """
    try:
        import mujoco
    except ImportError:
        raise InputError(
            f"{source}: an MJCF file, which MuJoCo reads, and MuJoCo is not installed",
            "pip install 'psdmc[mjcf]', or give a URDF",
        ) from None
    refuse_many_copies(path, source)
    model, warned = _compiled(mujoco, path, source)
    names = Names.of(mujoco, model)
    if root is not None:
        # The world's other moving bodies are left out.
        roots = _moving_roots(model)
        if root not in [names.body(b) for b in roots]:
            raise InputError(
                f"{source}: --root {shown(root)} is none of the bodies under the world that move",
                f"choose one of {_listed_roots(mujoco, model, names)}",
            )
        if not hasattr(getattr(mujoco, "MjSpec", None), "delete"):
            raise InputError(
                f"{source}: --root needs a newer MuJoCo than {mujoco.__version__}", "pip install -U mujoco"
            )
        others = [b for b in roots if names.body(b) != root]
        if others:
            model, warned = _compiled(mujoco, path, source, others)
            warned = [*warned, f"left out by --root {root}: {listed([names.body(b) for b in others])}"]
            names = Names.of(mujoco, model)
    free = _floating_joint(mujoco, model, names, source)
    refuse_constraints(mujoco, model, names, source)
    refuse_references(mujoco, model, names, source)
    refuse_armatures(mujoco, model, names, source)
    notes = [f"MJCF, as MuJoCo {mujoco.__version__} compiles it", *left_out(mujoco, model, names), *warned]
    mimics = mimic_joints(mujoco, model, names)
    return MjcfRobot(
        tree_text(mujoco, model, names, mimics, free, notes),
        gravity(mujoco, model),
        free is not None,
        tuple(mjcf_loops(mujoco, model, names, free, source)),
    )


def _compiled(mujoco: Any, path: Path, source: str, left_out: Sequence[int] = ()) -> tuple[Any, list[str]]:
    """MuJoCo's model without these of the world's own bodies, and notes of what it warned of."""
    try:
        with kept_warnings(mujoco) as said:
            model = _with_massless(mujoco, path, left_out)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise InputError(
            f"{source}: MuJoCo refuses it: {reason[:REASON]}",
            "files that it includes, and its meshes, must be where it says: try MuJoCo's own viewer",
        ) from None
    if any(NOT_A_NUMBER in text for text in said):
        raise InputError(f"{source}: a number of it is NaN", "write a number there")
    return model, [f"MuJoCo warns: {text[:REASON]}" for text in said]


def _without(mujoco: Any, path: Path, left_out: Sequence[int], least: float = 0.0) -> Any:
    """The file's model without some bodies, with all that is about them; keyframes would have too many numbers.

    least   kg, kg m^2, what moving bodies without inertia get
    """
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.boundmass = spec.compiler.boundinertia = least
    whole = spec.compile()
    if not left_out:
        return whole
    roots = [b for b in range(1, whole.nbody) if whole.body_parentid[b] == 0]
    gone = [body for b, body in zip(roots, list(spec.worldbody.bodies), strict=True) if b in left_out]
    for element in [*spec.keys, *gone]:
        spec.delete(element)
    return spec.compile()


def _moving_roots(model: Any) -> list[int]:
    """The world's own bodies that joints move, or that carry such."""
    found: dict[int, None] = {}
    for b in range(1, model.nbody):
        if model.body_jntnum[b]:
            found[int(model.body_rootid[b])] = None
    return list(found)


def _listed_roots(mujoco: Any, model: Any, names: Names) -> str:
    free = {
        int(b)
        for b, kind in zip(model.jnt_bodyid, model.jnt_type, strict=True)
        if kind == mujoco.mjtJoint.mjJNT_FREE
    }
    return ", ".join(
        f"{shown(names.body(b))}{' (free)' if b in free else ''}" for b in _moving_roots(model)[:MOST_LISTED]
    )


def _with_massless(mujoco: Any, path: Path, left_out: Sequence[int]) -> Any:
    """The compiled file without some bodies. MuJoCo refuses moving bodies without inertia: for the compiler those get the
    least that it takes, which is taken away again. ValueError where MuJoCo refuses the file for another reason."""
    try:
        if left_out:
            return _without(mujoco, path, left_out)
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as refused:
        if NO_INERTIA not in str(refused) or not hasattr(mujoco, "MjSpec"):
            raise
        model = _without(mujoco, path, left_out, LEAST)
        bare, least = model.body_mass == LEAST, model.body_inertia == LEAST
        # Mass in a point, or none about an axis, which psdmc takes from nobody.
        if (least.any(axis=1) & ~bare).any():
            raise
        model.body_mass[bare], model.body_inertia[bare] = 0.0, 0.0
        return model


def _floating_joint(mujoco: Any, model: Any, names: Names, source: str) -> int | None:
    """The body on a free joint that all others move with; None where the robot stands."""
    free = [
        int(model.jnt_bodyid[j]) for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE
    ]
    if not free:
        return None
    roots = _moving_roots(model)
    if len(roots) > 1:
        raise InputError(
            f"{source}: bodies {_listed_roots(mujoco, model, names)} move independently, and psdmc reads one robot",
            f"choose one of them, such as --root {shlex.quote(names.body(roots[0]))}",
        )
    return free[0]


def left_out(mujoco: Any, model: Any, names: Names) -> list[str]:
    """Return notes, with names, on elements that the rigid-body model leaves out, such as actuators."""
    joints, bodies = range(model.njnt), range(model.nbody)
    found = {
        "actuators are not modelled: efforts are those of the joints": _names(
            mujoco, model, "ACTUATOR", range(len(model.actuator_trntype))
        ),
        "damping of actuators is not modelled": _names(
            mujoco, model, "ACTUATOR", np.flatnonzero(acting(model, "actuator", "damping"))
        ),
        "tendons without forces of their own are left out": _names(
            mujoco, model, "TENDON", range(model.ntendon)
        ),
        "equality constraints that are not active are left out": _names(
            mujoco, model, "EQUALITY", (k for k in range(model.neq) if not is_active(mujoco, model, k))
        ),
        "springs of joints are not modelled": [
            names.joint(int(j)) for j in np.flatnonzero(acting(model, "jnt", "stiffness"))
        ],
        "damping and friction that is negative, not linear or of a free joint is not modelled": [
            names.joint(j) for j in joints if _resists_oddly(mujoco, model, j)
        ],
        "limits of efforts differ by direction, the smaller that is not zero is taken for both": [
            names.joint(j)
            for j in joints
            if model.jnt_actfrclimited[j] and model.jnt_actfrcrange[j].sum() != 0.0
        ],
        "compensation of gravity is not modelled": [
            names.body(b) for b in bodies if model.body_gravcomp[b] != 0.0
        ],
        "bodies that a program moves (mocap) stand where they are": [
            names.body(b) for b in bodies if model.body_mocapid[b] >= 0
        ],
        "q of ball joints is a quaternion x y z w, MuJoCo's w x y z": [
            names.joint(j) for j in of_balls(mujoco, model)
        ],
        "limits of ball joints are not read": [
            names.joint(j) for j in of_balls(mujoco, model) if model.jnt_limited[j]
        ],
    }
    notes = [f"{what}: {listed(which)}" for what, which in found.items() if which]
    coupled = mimic_joints(mujoco, model, names)
    if coupled:
        notes.append(f"equality constraints of joints hold exactly: {listed(list(coupled))}")
    if model.opt.density > 0.0 or model.opt.viscosity > 0.0:
        notes.append("forces of the medium (density, viscosity) are not modelled")
    return [*notes, *(["plugins are not modelled"] if model.nplugin else [])]


def _resists_oddly(mujoco: Any, model: Any, j: int) -> bool:
    """Whether a joint has damping or friction that the text made of the file has no word for."""
    dof = int(model.jnt_dofadr[j])
    of = acting if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE else is_odd
    return any(bool(of(model, "dof", word)[dof]) for word in ("damping", "frictionloss"))


def _names(mujoco: Any, model: Any, kind: str, numbers: Iterable[int]) -> list[str]:
    return [named(mujoco, model, kind, k) or f"number {k}" for k in map(int, numbers)]
