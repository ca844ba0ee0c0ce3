"""Notes on what an MJCF file has beside a tree of rigid bodies: forces, drives and constraints that do not act."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from psdmc.robot.mjcf_faults import followers, of_balls
from psdmc.robot.mjcf_names import Names, named
from psdmc.robot.mjcf_terms import acting, is_active, is_odd
from psdmc.robot.tree import listed


def left_out(mujoco: Any, model: Any, names: Names) -> list[str]:
    """Notes on what the model of rigid bodies leaves out, by name."""
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
    followed = followers(mujoco, model, names)
    if followed:
        notes.append(f"equality constraints of joints hold exactly: {listed(list(followed))}")
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
