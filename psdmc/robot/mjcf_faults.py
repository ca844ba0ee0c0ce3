"""What an MJCF file has beside a tree of rigid bodies: refused by name where it changes how the tree moves, noted where
it is a force, a drive or a picture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from psdmc.errors import InputError
from psdmc.robot.limits import ANGLE, LENGTH, joined, shown
from psdmc.robot.mjcf_names import Names, named
from psdmc.robot.tree import listed

REMEDY = "take them out of the file: psdmc models trees of rigid bodies"


@dataclass(frozen=True, slots=True)
class Follows:
    """q of a joint is ratio times that of `leader`, plus offset."""

    leader: str
    ratio: float
    offset: float


def refuse_constraints(mujoco: Any, model: Any, names: Names, source: str) -> None:
    """InputError that names all constraints and joints that psdmc has no model of."""
    faults = [*_loops(mujoco, model), *_tendons(mujoco, model), *_balls(mujoco, model, names)]
    if model.nflex:
        faults.append("deformable bodies (flex)")
    if faults:
        raise InputError(f"{source}: not modelled: {joined(faults)}", REMEDY)


def refuse_references(mujoco: Any, model: Any, names: Names, source: str) -> None:
    """InputError that names joints whose reference position is no place that sine and cosine are exact for."""
    ranges = {int(mujoco.mjtJoint.mjJNT_HINGE): ANGLE, int(mujoco.mjtJoint.mjJNT_SLIDE): LENGTH}
    found = []
    for j in range(model.njnt):
        reference, of = float(model.qpos0[model.jnt_qposadr[j]]), ranges.get(int(model.jnt_type[j]))
        if of is not None and (fault := of.fault(reference)):
            found.append(f"joint {shown(names.joint(j))}: ref {reference:g} {fault}")
    if found:
        raise InputError(f"{source}: {joined(found)}", "write an angle within a few turns")


def refuse_armatures(model: Any, names: Names, source: str) -> None:
    """InputError that names joints with negative armatures, which MuJoCo takes."""
    armatures = [(j, float(model.dof_armature[model.jnt_dofadr[j]])) for j in range(model.njnt)]
    found = [f"joint {shown(names.joint(j))}: armature {value:g}" for j, value in armatures if value < 0.0]
    if found:
        raise InputError(
            f"{source}: {joined(found)}, expected 0 or more", "give the inertia of the joint's drive"
        )


def _loops(mujoco: Any, model: Any) -> Iterator[str]:
    for k in range(model.neq):
        if model.eq_active0[k] and not _is_linear(mujoco, model, k):
            kind = mujoco.mjtEq(model.eq_type[k]).name.removeprefix("mjEQ_").lower()
            yield f"equality constraint {_name(mujoco, model, 'EQUALITY', k)} ({kind})"


def _is_linear(mujoco: Any, model: Any, k: int) -> bool:
    """Whether an equality constraint makes one joint follow another linearly."""
    both = model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[k] >= 0
    return bool(both) and not model.eq_data[k, 2:5].any()


def _tendons(mujoco: Any, model: Any) -> Iterator[str]:
    for k in range(model.ntendon):
        forces = [
            word
            for word in ("armature", "stiffness", "damping", "frictionloss")
            if getattr(model, f"tendon_{word}")[k] > 0.0
        ]
        if forces:
            yield f"tendon {_name(mujoco, model, 'TENDON', k)} ({', '.join(forces)})"


def _balls(mujoco: Any, model: Any, names: Names) -> Iterator[str]:
    for k in _of_balls(mujoco, model):
        if model.dof_armature[model.jnt_dofadr[k]] > 0.0:
            yield f"armature of ball joint {shown(names.joint(k))}, a drive's inertia about three axes"


def _of_balls(mujoco: Any, model: Any) -> list[int]:
    return [k for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_BALL]


def followers(mujoco: Any, model: Any, names: Names) -> dict[str, Follows]:
    """Joints that an equality constraint makes follow another: q1 - ref1 = c0 + c1 (q2 - ref2)."""
    found = {}
    for k in range(model.neq):
        if not (model.eq_active0[k] and _is_linear(mujoco, model, k)):
            continue
        own, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        shift, ratio = model.eq_data[k, :2].tolist()
        ref, leaders = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (own, leader))
        found[names.joint(own)] = Follows(names.joint(leader), ratio, ref + shift - ratio * leaders)
    return found


def left_out(mujoco: Any, model: Any, names: Names) -> list[str]:
    """Notes on what the model of rigid bodies leaves out, by name."""
    joints, bodies = range(model.njnt), range(model.nbody)
    found = {
        "actuators are not modelled: efforts are those of the joints": _names(
            mujoco, model, "ACTUATOR", range(model.nu)
        ),
        "tendons without forces of their own are left out": _names(
            mujoco, model, "TENDON", range(model.ntendon)
        ),
        "equality constraints that are not active are left out": _names(
            mujoco, model, "EQUALITY", (k for k in range(model.neq) if not model.eq_active0[k])
        ),
        "springs of joints are not modelled": [
            names.joint(j) for j in joints if model.jnt_stiffness[j] != 0.0
        ],
        "compensation of gravity is not modelled": [
            names.body(b) for b in bodies if model.body_gravcomp[b] != 0.0
        ],
        "bodies that a program moves (mocap) stand where they are": [
            names.body(b) for b in bodies if model.body_mocapid[b] >= 0
        ],
        "q of ball joints is a quaternion x y z w, MuJoCo's w x y z": [
            names.joint(j) for j in _of_balls(mujoco, model)
        ],
        "limits of ball joints are not read": [
            names.joint(j) for j in _of_balls(mujoco, model) if model.jnt_limited[j]
        ],
        "drive inertia of a free joint is left out": [
            names.joint(j)
            for j in joints
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE
            and model.dof_armature[model.jnt_dofadr[j]] > 0.0
        ],
    }
    notes = [f"{what}: {listed(which)}" for what, which in found.items() if which]
    followed = followers(mujoco, model, names)
    if followed:
        notes.append(f"equality constraints of joints hold exactly: {listed(list(followed))}")
    if model.opt.density > 0.0 or model.opt.viscosity > 0.0:
        notes.append("forces of the medium (density, viscosity) are not modelled")
    return [*notes, *(["plugins are not modelled"] if model.nplugin else [])]


def _names(mujoco: Any, model: Any, kind: str, numbers: Iterable[int]) -> list[str]:
    return [named(mujoco, model, kind, k) or f"number {k}" for k in numbers]


def _name(mujoco: Any, model: Any, kind: str, number: int) -> str:
    name = named(mujoco, model, kind, number)
    return shown(name) if name else f"number {number}"
