"""Reads MuJoCo's model of a robot: MuJoCo's warnings, values that several of its arrays store together, and names.

The values are drive inertias, force coefficients, active constraints and gravity. If the installed version of MuJoCo
does not have an array, its values count as zero.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.robot.limits import free_name


@contextmanager
def kept_warnings(mujoco: Any) -> Iterator[list[str]]:
    """Collect MuJoCo's warnings until the end of the block, one line each. MuJoCo gives some of them to a callback, and
    others to Python's warnings; those come last. By itself MuJoCo would print them and write MUJOCO_LOG.TXT."""
    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: said.append(" ".join(str(text).split())))
    try:
        with warnings.catch_warnings(record=True) as raised:
            warnings.simplefilter("always", UserWarning)
            yield said
    finally:
        mujoco.set_mju_user_warning(before)
        for one in raised:
            text = " ".join(str(one.message).split())
            if not issubclass(one.category, UserWarning):
                warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
            elif text not in said:
                said.append(text)


Array = NDArray[np.float64]


def armatures(mujoco: Any, model: Any) -> Array:
    """Return the drive inertia at each of MuJoCo's joints (njnt,), in kg m^2 (kg). It is the joint's armature plus each
    actuator's armature times the square of the gear ratio."""
    found = np.array(model.dof_armature[model.jnt_dofadr], dtype=float)
    for k in _with_armature(model):
        if model.actuator_trntype[k] in _joint_transmissions(mujoco):
            found[model.actuator_trnid[k, 0]] += reflected(model, k)
    return found


def armatures_elsewhere(mujoco: Any, model: Any) -> list[int]:
    """Return the actuators that have an armature (rotor inertia) but act on no joint, such as on a tendon."""
    return [k for k in _with_armature(model) if model.actuator_trntype[k] not in _joint_transmissions(mujoco)]


def reflected(model: Any, actuator: int) -> float:
    """Return an actuator's inertia at the joint: its armature times the square of the gear ratio."""
    armature, gear = float(model.actuator_armature[actuator]), float(model.actuator_gear[actuator, 0])
    return armature * gear * gear if armature else 0.0


def acting(model: Any, kind: str, word: str) -> NDArray[np.bool_]:
    """Return for each object of one kind whether a force of the given kind acts on it. The force may have any sign, and
    may be nonlinear in position or velocity.

    kind  objects to examine: jnt (joints), dof (degrees of freedom), tendon or actuator
    word  kind of force: stiffness, damping or frictionloss
    """
    return np.asarray(_of(model, kind, word) != 0.0) | is_odd(model, kind, word)


def is_odd(model: Any, kind: str, word: str) -> NDArray[np.bool_]:
    """Return for each object of one kind whether the force of the given kind is nonlinear or has the wrong sign. URDF
    cannot express such forces.

    kind  objects to examine, as in `acting`
    word  kind of force, as in `acting`
    """
    powers = getattr(model, f"{kind}_{word}poly", None)
    linear = _of(model, kind, word)
    return np.asarray(linear < 0.0) | (powers != 0.0).any(axis=1) if powers is not None else linear < 0.0


def is_active(mujoco: Any, model: Any, equality: int) -> bool:
    """Return whether an equality constraint is active: the file may switch off one, or all."""
    bits = mujoco.mjtDisableBit
    off = int(model.opt.disableflags) & int(bits.mjDSBL_EQUALITY | bits.mjDSBL_CONSTRAINT)
    return bool(model.eq_active0[equality]) and not off


def gravity(mujoco: Any, model: Any) -> tuple[float, float, float]:
    """Return gravity in m/s^2 along the world's axes; zero if the file switches it off."""
    if int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        return 0.0, 0.0, 0.0
    x, y, z = model.opt.gravity.tolist()
    return x, y, z


def _with_armature(model: Any) -> list[int]:
    return [k for k in range(model.nu) if _of(model, "actuator", "armature")[k] != 0.0]


def _joint_transmissions(mujoco: Any) -> tuple[int, int]:
    kinds = mujoco.mjtTrn
    return int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)


def _of(model: Any, kind: str, word: str) -> Array:
    found = getattr(model, f"{kind}_{word}", None)
    if found is not None:
        return np.asarray(found)
    counts = {"jnt": model.njnt, "dof": model.nv, "tendon": model.ntendon}
    return np.zeros(len(model.actuator_trntype) if kind == "actuator" else counts[kind])


@dataclass(frozen=True, slots=True)
class Names:
    """Names of bodies and joints by MuJoCo's numbers; those without a name get a new one."""

    bodies: tuple[str, ...]
    joints: tuple[str, ...]

    @staticmethod
    def of(mujoco: Any, model: Any) -> Names:
        bodies = [named(mujoco, model, "BODY", k) for k in range(model.nbody)]
        joints = [named(mujoco, model, "JOINT", k) for k in range(model.njnt)]
        return Names(_each_once(bodies, "body"), _each_once(joints, "joint"))

    def body(self, number: int) -> str:
        return self.bodies[int(number)]

    def joint(self, number: int) -> str:
        return self.joints[int(number)]


def named(mujoco: Any, model: Any, kind: str, number: int) -> str:
    """Return the name of an object in the file, or '' if it has none; `kind` is BODY, JOINT, TENDON and so on."""
    return mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), number) or ""


def _each_once(names: list[str], kind: str) -> tuple[str, ...]:
    """The names, nameless objects called by kind and number."""
    taken = {name for name in names if name}
    return tuple(name or free_name(f"{kind}{number}", taken) for number, name in enumerate(names))
