"""Finds elements of an MJCF file that change how the robot moves: mimic joints and closed loops.

It also finds the elements that psdmc rejects by name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.robot.limits import ANGLE, DRIVE_INERTIA, LENGTH, joined, shown
from psdmc.robot.mjcf.mujoco_model import (
    Names,
    acting,
    armatures,
    armatures_elsewhere,
    is_active,
    named,
    reflected,
)

REMEDY = "take them out of the file: psdmc models trees of rigid bodies"


@dataclass(frozen=True, slots=True)
class Mimic:
    """Describes a mimic joint of an MJCF file: its position q is ratio times that of `leader`, plus offset."""

    leader: str
    ratio: float
    offset: float


def refuse_constraints(mujoco: Any, model: Any, names: Names, source: str) -> None:
    """Raise InputError with the names of all constraints and joints that psdmc cannot model."""
    faults = [
        *_other_equalities(mujoco, model),
        *_mimicked_twice(mujoco, model, names),
        *_tendons(mujoco, model),
        *_wide_drives(mujoco, model, names),
    ]
    if model.nflex:
        faults.append("deformable bodies (flex)")
    if faults:
        raise InputError(f"{source}: not modelled: {joined(faults)}", REMEDY)
    inertias = armatures(mujoco, model)
    heavy = [
        f"free joint {shown(names.joint(j))} has armature {inertias[j]:g}"
        for j in range(model.njnt)
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE and inertias[j] > 0.0
    ]
    if heavy:
        raise InputError(
            f"{source}: {joined(heavy)}, which psdmc does not model for free joints",
            'set armature="0" there, or write <freejoint>, which takes none from the defaults',
        )


def refuse_references(mujoco: Any, model: Any, names: Names, source: str) -> None:
    """Raise InputError with the names of joints whose reference position is outside the accepted range. At larger
    angles, sine and cosine lose digits."""
    ranges = {int(mujoco.mjtJoint.mjJNT_HINGE): ANGLE, int(mujoco.mjtJoint.mjJNT_SLIDE): LENGTH}
    found = []
    for j in range(model.njnt):
        reference, of = float(model.qpos0[model.jnt_qposadr[j]]), ranges.get(int(model.jnt_type[j]))
        if of is not None and (fault := of.fault(reference)):
            found.append(f"joint {shown(names.joint(j))}: ref {reference:g} {fault}")
    if found:
        raise InputError(f"{source}: {joined(found)}", "write an angle within a few turns")


def refuse_armatures(mujoco: Any, model: Any, names: Names, source: str) -> None:
    """Raise InputError with the names of joints and actuators that have negative armatures, and of joints whose drive
    inertia is out of range. MuJoCo accepts them."""
    own = [(j, float(model.dof_armature[model.jnt_dofadr[j]])) for j in range(model.njnt)]
    found = [f"joint {shown(names.joint(j))}: armature {value:g}" for j, value in own if value < 0.0]
    found += [
        f"actuator {_name(mujoco, model, 'ACTUATOR', k)}: armature {reflected(model, k):g} at its joint"
        for k in range(len(model.actuator_trntype))
        if reflected(model, k) < 0.0
    ]
    faults = [f"{what}, expected 0 or more" for what in found] or [
        f"joint {shown(names.joint(j))}: drive inertia {inertia:g} {fault}"
        for j, inertia in enumerate(armatures(mujoco, model).tolist())
        if (fault := DRIVE_INERTIA.fault(inertia))
    ]
    if faults:
        raise InputError(
            f"{source}: {joined(faults)}", "correct the armatures of the joint and of its actuators"
        )


def _other_equalities(mujoco: Any, model: Any) -> Iterator[str]:
    for k in range(model.neq):
        is_loop = int(model.eq_type[k]) in loop_kinds(mujoco)
        if is_active(mujoco, model, k) and not is_loop and not _is_linear(mujoco, model, k):
            kind = mujoco.mjtEq(model.eq_type[k]).name.removeprefix("mjEQ_").lower()
            yield f"equality constraint {_name(mujoco, model, 'EQUALITY', k)} ({kind})"


def _is_linear(mujoco: Any, model: Any, k: int) -> bool:
    """Whether an equality constraint makes one joint follow another linearly."""
    both = model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[k] >= 0
    return bool(both) and not model.eq_data[k, 2:5].any()


def _mimicked_twice(mujoco: Any, model: Any, names: Names) -> Iterator[str]:
    own = [
        int(model.eq_obj1id[k])
        for k in range(model.neq)
        if is_active(mujoco, model, k) and _is_linear(mujoco, model, k)
    ]
    for j in sorted(j for j in set(own) if own.count(j) > 1):
        yield f"{own.count(j)} equality constraints of joint {shown(names.joint(j))}"


def _tendons(mujoco: Any, model: Any) -> Iterator[str]:
    words = ("armature", "stiffness", "damping", "frictionloss")
    found = {word: acting(model, "tendon", word) for word in words}
    drives = [int(model.actuator_trnid[k, 0]) for k in armatures_elsewhere(mujoco, model)]
    for k in range(model.ntendon):
        forces = [word for word in words if found[word][k]]
        forces += ["armature of an actuator"] if k in drives else []
        if forces:
            yield f"tendon {_name(mujoco, model, 'TENDON', k)} ({', '.join(forces)})"


def _wide_drives(mujoco: Any, model: Any, names: Names) -> Iterator[str]:
    inertias = armatures(mujoco, model)
    for k in of_balls(mujoco, model):
        if inertias[k] > 0.0:
            yield f"armature of ball joint {shown(names.joint(k))}, a drive's inertia about three axes"


def of_balls(mujoco: Any, model: Any) -> list[int]:
    """Return the numbers of the ball joints among the joints of MuJoCo's model."""
    return [k for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_BALL]


def mimic_joints(mujoco: Any, model: Any, names: Names) -> dict[str, Mimic]:
    """Return the joints that follow another joint by an equality constraint q1 - ref1 = c0 + c1 (q2 - ref2). Here ref1
    and ref2 are the reference positions of the joints."""
    found = {}
    for k in range(model.neq):
        if not (is_active(mujoco, model, k) and _is_linear(mujoco, model, k)):
            continue
        own, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        shift, ratio = model.eq_data[k, :2].tolist()
        ref, leaders = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (own, leader))
        found[names.joint(own)] = Mimic(names.joint(leader), ratio, ref + shift - ratio * leaders)
    return found


def _name(mujoco: Any, model: Any, kind: str, number: int) -> str:
    name = named(mujoco, model, kind, number)
    return shown(name) if name else f"number {number}"


# Closed loops: the equality constraints `connect` and `weld`, as tables [[loop]] (closed_loops.py).
#
# MuJoCo computes such a constraint between two bodies from eq_data. For `connect`, these are the anchors in both bodies.
# For `weld`, they are the anchor in the second body, the anchor in the first body, and the second body's quaternion
# relative to the first one. Between two sites, a constraint keeps the frames of the sites together.
def loop_kinds(mujoco: Any) -> dict[int, int]:
    """Return the number of closed rows by the type of an equality constraint."""
    return {int(mujoco.mjtEq.mjEQ_CONNECT): 3, int(mujoco.mjtEq.mjEQ_WELD): 6}


def mjcf_loops(mujoco: Any, model: Any, names: Names, free: int | None, source: str) -> list[dict[str, Any]]:
    """Return a table for each equality constraint `connect` or `weld` that is active.

    free  the body that floats in the world; None: the robot stands

    Raises InputError if a constraint holds a body that the robot does not have.
    """
    kinds = loop_kinds(mujoco)
    world = names.body(0) if free is None else "universe"
    found = []
    for k in range(model.neq):
        if not is_active(mujoco, model, k) or int(model.eq_type[k]) not in kinds:
            continue
        name = named(mujoco, model, "EQUALITY", k) or f"equality{k}"
        ends = list(_ends(mujoco, model, k))
        root = 0 if free is None else int(model.body_rootid[free])
        outside = [body for body, _, _ in ends if body and root and int(model.body_rootid[body]) != root]
        if outside:
            raise InputError(
                f"{source}: equality constraint {shown(name)} holds body {shown(names.body(outside[0]))} of no robot",
                'write active="false" there',
            )
        first, second = (
            {
                "link": names.body(body) if body else world,
                "xyz": place.tolist(),
                "quaternion": np.roll(turn, -1).tolist(),
            }
            for body, place, turn in ends
        )
        found.append({"name": name, "rows": kinds[int(model.eq_type[k])], "first": first, "second": second})
    return found


def _ends(mujoco: Any, model: Any, k: int) -> Iterator[tuple[int, Any, Any]]:
    """Body, position and quaternion (w, x, y, z) of both frames in their bodies."""
    data = model.eq_data[k]
    is_weld = model.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
    for number, place in zip(
        (int(model.eq_obj1id[k]), int(model.eq_obj2id[k])),
        (data[3:6], data[:3]) if is_weld else (data[:3], data[3:6]),
        strict=True,
    ):
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
            yield int(model.site_bodyid[number]), model.site_pos[number], model.site_quat[number]
        else:
            is_turned = is_weld and number == int(model.eq_obj1id[k])
            yield number, place, data[6:10] if is_turned else np.array([1.0, 0.0, 0.0, 0.0])
