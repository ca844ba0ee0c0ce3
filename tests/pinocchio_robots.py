"""Robots of the example-robot-data wheel as Pinocchio reads them, floating or fixed, and mechanisms of the same numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin
from installed import in_wheel

from psdmc.robot.joints import PRISMATIC, REVOLUTE, WIDE_TYPES
from psdmc.robot.mechanism import BASE, PARAMETERS_PER_LINK, Joint, Mechanism, Placement
from psdmc.robot.urdf.urdf_draft import link_rotation

FILES = {
    "anymal_b": "anymal_b_simple_description/robots/anymal.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "allegro": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "ur10": "ur_description/urdf/ur10_robot.urdf",
    "baxter": "baxter_description/urdf/baxter.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
}
WIDE = {joint.pinocchio: joint for joint in WIDE_TYPES.values()}
EXACT = 1e-11
"""Entries of placements that are within this of a whole number are that: angles of the file are rounded."""


@dataclass(frozen=True, eq=False)
class PinocchioRobot:
    """Pinocchio's model and the mechanism, joints in its order.

    A continuous joint has one angle here and its cosine and sine there.
    """

    model: pin.Model
    mechanism: Mechanism

    @property
    def data(self) -> pin.Data:
        return self.model.createData()

    def theirs(self, q: np.ndarray) -> np.ndarray:
        """Positions of ours as Pinocchio's."""
        found, used = np.zeros(self.model.nq), 0
        for joint, own in zip(self.mechanism.joints, list(self.model.joints)[1:], strict=True):
            part = q[used : used + joint.type.nq]
            used += joint.type.nq
            is_round = own.nq == 2
            found[own.idx_q : own.idx_q + own.nq] = [np.cos(part[0]), np.sin(part[0])] if is_round else part
        return found

    def motion(self, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(count, nq) positions and (count, nv) rates and accelerations."""
        rng = np.random.default_rng(seed)
        types = self.mechanism.types
        q = np.concatenate([t.normalized(rng.uniform(-2.0, 2.0, (t.nq, count))) for t in types])
        qd, qdd = rng.uniform(-2.0, 2.0, (2, count, self.mechanism.nv))
        return np.ascontiguousarray(q.T), qd, qdd

    def each(self, function, q: np.ndarray, *rates: np.ndarray) -> np.ndarray:
        data = self.data
        rows = zip(q, *rates, strict=True)
        return np.array(
            [np.array(function(self.model, data, self.theirs(row), *rest)) for row, *rest in rows]
        )


def path_of(name: str) -> str:
    return str(in_wheel(f"robots/{FILES[name]}"))


@cache
def robot_at_hand(name: str, floating: bool) -> PinocchioRobot:
    root = (pin.JointModelFreeFlyer(),) if floating else ()
    model = pin.buildModelFromUrdf(path_of(name), *root)
    return of_model(model)


def of_model(model: pin.Model) -> PinocchioRobot:
    """The mechanism of a Pinocchio model, whose placements are rounded in place."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model), np.zeros(model.nv))
    joints, turns = [], [np.eye(3)]
    for i in range(1, model.njoints):
        place = model.jointPlacements[i]
        place = pin.SE3(_rounded(place.rotation), place.translation)
        model.jointPlacements[i] = place
        kind, turn = _kind(model.joints[i].shortname(), np.reshape(data.joints[i].S, (6, -1)))
        turns.append(turn)
        # A joint frame of ours is theirs, turned so that z is the axis.
        about = Placement(place.rotation, place.translation)
        before = Placement(turns[model.parents[i]].T, np.zeros(3)).inverse()
        ours = before @ about @ Placement(turn.T, np.zeros(3))
        ours = Placement(_rounded(ours.rotation), ours.translation)
        joints.append(Joint(model.names[i], f"link{i}", kind, ours, Placement(turn, np.zeros(3))))
    parameters = np.array(
        [np.append(inertia.toDynamicParameters(), 0.0) for inertia in list(model.inertias)[1:]]
    )
    n = len(joints)
    free = np.delete(np.eye(PARAMETERS_PER_LINK * n), range(10, PARAMETERS_PER_LINK * n, 11), axis=1)
    parents = tuple(int(parent) - 1 for parent in list(model.parents)[1:])
    tip = next(i for i in range(n) if i not in parents)
    model.armature = np.zeros(model.nv)
    mechanism = Mechanism(
        model.name, "urdf", "universe", joints[tip].link_name, tuple(joints), parameters, free,
        np.array(model.gravity.linear), joints[tip].link_frame, parents=parents, tip_body=tip,
    )  # fmt: skip
    assert all(parent == BASE or parent < i for i, parent in enumerate(parents))
    return PinocchioRobot(model, mechanism)


def _kind(name: str, subspace: np.ndarray):
    wide = name.removeprefix("JointModel")
    if wide in WIDE:
        return WIDE[wide], np.eye(3)
    turns = np.any(subspace[3:, 0])
    axis = subspace[3:, 0] if turns else subspace[:3, 0]
    return (REVOLUTE if turns else PRISMATIC), _rounded(link_rotation(axis))


def _rounded(rotation: np.ndarray) -> np.ndarray:
    near = np.round(rotation)
    return np.where(np.abs(rotation - near) < EXACT, near, rotation) + 0.0
