"""Converts positions and rates between the conventions of psdmc and of MuJoCo. psdmc follows Pinocchio. MuJoCo need
not be installed.

                       psdmc, Pinocchio                          MuJoCo
quaternion             x, y, z, w                                w, x, y, z
linear rate of a base  along the base's axes                     along the world's axes
angular rate           along the body's axes                     along the body's axes
mimic joint            no entry of its own                       entries of its own
order of joints        the model's `joint_names`                 that of the MjModel

Arrays may have any leading axes, which broadcast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import model_of
from psdmc.real_arrays import real_array
from psdmc.robot.coordinates import MimicMap
from psdmc.robot.joints.quaternion import inverse, rotation_of
from psdmc.robot.joints.scalars import unit
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import BASE, Array, Mechanism

KINDS = ("free", "ball", "slide", "hinge")
"""MuJoCo's types of joints, by their numbers (mjtJoint)."""

OF_QUATERNION = {"free": (0, 1, 2, 4, 5, 6, 3), "ball": (1, 2, 3, 0)}
"""Places of a joint's coordinates among MuJoCo's."""


def to_qpos(model: DynamicsModel | str | Path, q: ArrayLike, mj_model: Any = None) -> Array:
    """Convert joint positions q, (..., nq), to MuJoCo's qpos, (..., nq of MuJoCo), and return qpos.

    The order of the joints can differ. Quaternions are x, y, z, w in q, and w, x, y, z in qpos.

    model     the model that q belongs to, or the path of its file
    mj_model  the robot's MjModel (MuJoCo's model). Its joints are matched with the joints of `model` by name. Joints
              that `model` does not have get their values from qpos0 of the MjModel. None: MuJoCo has the same joints
              as `model`, in the same order

    Raises InputError if q has another shape, if `mj_model` lacks a joint of `model`, or if `model` has a joint that does
    not exist in MuJoCo, such as a planar joint.
    """
    layout = _Layout.of("to_qpos", model, mj_model)
    values = layout.checked("q", q, layout.nq)
    values = layout.mimic_map.positions(values) if layout.mimic_map else values
    found = np.broadcast_to(layout.rest, (*values.shape[:-1], len(layout.rest))).copy()
    found[..., layout.places] = values
    return found


def from_qpos(model: DynamicsModel | str | Path, qpos: ArrayLike, mj_model: Any = None) -> Array:
    """Convert MuJoCo's qpos, (..., nq of MuJoCo), to the joint positions q, (..., nq), of a model, and return q.

    Entries of qpos for mimic joints and for joints that the model lacks have no effect. `to_qpos` explains the arguments
    `model` and `mj_model`.
    """
    layout = _Layout.of("from_qpos", model, mj_model)
    return np.asarray(layout.checked("qpos", qpos, len(layout.rest))[..., layout.places[layout.own_places]])


def to_qvel(model: DynamicsModel | str | Path, q: ArrayLike, qd: ArrayLike, mj_model: Any = None) -> Array:
    """Convert joint rates qd, (..., nv), at joint positions q, (..., nq), to MuJoCo's qvel, (..., nv of MuJoCo).

    q and qd are in psdmc's convention. A floating base's linear velocity is along the base's axes in qd, and along the
    world's axes in qvel. Joints that only MuJoCo has get the rate zero. `to_qpos` explains the arguments `model` and
    `mj_model`.
    """
    layout = _Layout.of("to_qvel", model, mj_model)
    rates = layout.checked("qd", qd, layout.nv)
    rates = layout.mimic_map.rates(rates) if layout.mimic_map else rates
    here, rates = layout.broadcast(layout.checked("q", q, layout.nq), rates, "qd")
    found = np.zeros((*rates.shape[:-1], layout.rates))
    found[..., layout.speeds] = layout.turned(here, rates, back=False)
    return found


def from_qvel(
    model: DynamicsModel | str | Path, q: ArrayLike, qvel: ArrayLike, mj_model: Any = None
) -> Array:
    """Convert MuJoCo's qvel, (..., nv of MuJoCo), at joint positions q, (..., nq), to joint rates qd, (..., nv).

    q and qd are in psdmc's convention. For a state of MuJoCo, first compute q = from_qpos(model, qpos). `to_qpos`
    explains the arguments `model` and `mj_model`.
    """
    layout = _Layout.of("from_qvel", model, mj_model)
    here, rates = layout.broadcast(
        layout.checked("q", q, layout.nq), layout.checked("qvel", qvel, layout.rates), "qvel"
    )
    return layout.turned(here, rates[..., layout.speeds[layout.own_speeds]], back=True)


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """Where MuJoCo has what the joints of a model have.

    what        the function that is called, for errors
    mimic_map   how all joints move with the model's coordinates; None where each has its own
    rest        (nq of MuJoCo,) positions of joints that the model has not
    rates       nv of MuJoCo
    places      of all joints' coordinates, and
    speeds      of all joints' rates
    own_places  which of these are the model's coordinates, and
    own_speeds  its rates
    free        whether the first joint is a free one
    """

    what: str
    mimic_map: MimicMap | None
    rest: Array
    rates: int
    places: NDArray[np.intp]
    speeds: NDArray[np.intp]
    own_places: NDArray[np.intp]
    own_speeds: NDArray[np.intp]
    free: bool

    @staticmethod
    def of(what: str, model: DynamicsModel | str | Path, mj_model: Any) -> _Layout:
        chain = model_of(model).mechanism
        kinds = [joint.type.mujoco for joint in chain.joints]
        _refuse(what, chain, kinds)
        nq, nv = ([getattr(joint.type, word) for joint in chain.joints] for word in ("nq", "nv"))
        if mj_model is None:
            rest, rates = np.zeros(sum(nq)), sum(nv)
            at, first = np.cumsum([0, *nq[:-1]]), np.cumsum([0, *nv[:-1]])
        else:
            joints = _found(what, chain, kinds, mj_model)
            rest, rates = np.array(mj_model.qpos0, float), int(mj_model.nv)
            at, first = mj_model.jnt_qposadr[joints], mj_model.jnt_dofadr[joints]
        orders = [OF_QUATERNION.get(kind, (0,)) for kind in kinds]
        return _Layout(
            what,
            MimicMap.of(chain.coordinates, chain.types) if chain.has_mimic_joints else None,
            rest,
            rates,
            _joined(int(start) + k for start, order in zip(at, orders, strict=True) for k in order),
            _joined(int(start) + k for start, count in zip(first, nv, strict=True) for k in range(count)),
            _own(chain, nq),
            _own(chain, nv),
            kinds[0] == "free",
        )

    @property
    def nq(self) -> int:
        return len(self.own_places)

    @property
    def nv(self) -> int:
        return len(self.own_speeds)

    def checked(self, name: str, values: ArrayLike, size: int) -> Array:
        """Return an argument of a conversion as an array of floats, (..., size). `name` is the argument's name. Raises
        InputError if the last axis does not have the length `size`."""
        array = real_array(f"{self.what}: {name}", values)
        if array.shape[-1:] != (size,):
            raise InputError(
                f"{self.what}: {name} has shape {array.shape}, expected (..., {size})",
                "give the entries of one state along the last axis; the model's and MuJoCo's numbers may differ",
            )
        return array

    def broadcast(self, q: Array, rates: Array, name: str) -> tuple[Array, Array]:
        try:
            lead = np.broadcast_shapes(q.shape[:-1], rates.shape[:-1])
        except ValueError:
            raise InputError(
                f"{self.what}: shapes do not broadcast: q {q.shape}, {name} {rates.shape}",
                "give as many positions as rates, or one of either",
            ) from None
        return tuple(np.broadcast_to(x, (*lead, x.shape[-1])) for x in (q, rates))  # type: ignore[return-value]

    def turned(self, q: Array, rates: Array, back: bool) -> Array:
        """Convert joint rates at q to or from MuJoCo's axes. The linear velocity of a floating base is rotated from the
        base's axes to the world's axes; if `back` is true, from the world's axes to the base's axes."""
        if not self.free:
            return np.array(rates)
        quaternion = unit([q[..., k] for k in range(3, 7)])
        rows = rotation_of(inverse(quaternion) if back else quaternion)
        linear = [row[0] * rates[..., 0] + row[1] * rates[..., 1] + row[2] * rates[..., 2] for row in rows]
        return np.concatenate([np.stack(linear, axis=-1), rates[..., 3:]], axis=-1)


def _refuse(what: str, chain: Mechanism, kinds: Sequence[str]) -> None:
    """InputError for joints that MuJoCo has not, or has elsewhere."""
    for k, (joint, kind) in enumerate(zip(chain.joints, kinds, strict=True)):
        if kind not in KINDS:
            raise InputError(
                f"{what}: joint {shown(joint.name)} {joint.type.verb}, and MuJoCo has no such joint",
                "replace it in the robot's file by hinges and slides",
            )
        place = joint.placement
        moved = np.any(place.rotation != np.eye(3)) or place.translation.any()
        if kind == "free" and (k or chain.parents[k] != BASE or moved):
            raise InputError(
                f"{what}: joint {shown(joint.name)} is free, but not in the world's frame, as MuJoCo's free joints are",
                "derive the model with the floating link as root",
            )


def _found(what: str, chain: Mechanism, kinds: Sequence[str], mj_model: Any) -> list[int]:
    """MuJoCo's numbers of the chain's joints: by name, a free one by its type."""
    if not hasattr(mj_model, "jnt_qposadr"):
        raise InputError(
            f"{what}: a {type(mj_model).__name__} was given where an MjModel is expected",
            "mujoco.MjModel.from_xml_path(file) gives one",
        )
    theirs = [KINDS[number] for number in mj_model.jnt_type]
    names = {mj_model.joint(j).name: j for j in range(mj_model.njnt)}
    free = [j for j, kind in enumerate(theirs) if kind == "free"]
    found = []
    for joint, kind in zip(chain.joints, kinds, strict=True):
        number = free[0] if kind == "free" and len(free) == 1 else names.get(joint.name)
        if number is None or theirs[number] != kind:
            what_there = (
                "has no such joint" if number is None else f"has a {theirs[number]} joint of that name"
            )
            raise InputError(
                f"{what}: joint {shown(joint.name)} is a {kind} joint, and the MjModel {what_there}",
                "give the MjModel of the same robot, with the same names of joints; name all joints in an MJCF file",
            )
        found.append(number)
    return found


def _own(chain: Mechanism, counts: Sequence[int]) -> NDArray[np.intp]:
    """Return the positions, among all joints' entries, of those of joints that are no mimic joints. `counts` is by joint."""
    starts = np.cumsum([0, *counts])
    return _joined(starts[i] + k for i in chain.own_joints for k in range(counts[i]))


def _joined(numbers: Any) -> NDArray[np.intp]:
    return np.array(list(numbers), np.intp)
