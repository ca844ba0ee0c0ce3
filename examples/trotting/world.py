"""The quadruped as MuJoCo sees it: the same URDF, by MuJoCo's own import, on a free joint, on a floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import mujoco
import numpy as np

Array = np.ndarray

PHYSICS_STEP = 5e-4
"""s; half of the controller's period."""
FOOT_RADIUS = 0.02
"""m, of the sphere about a foot's frame."""
FRICTION = 0.8
"""Of floor and feet."""
ADMIT = {"fusestatic": "false", "balanceinertia": "true", "boundinertia": "1e-9"}
"""Fixed links stay, as feet are. ANYmal's base link weighs a milligram, its own inertia is one that no body has (1e-6 kg m^2
in all nine places), and MuJoCo takes it only balanced; what the base weighs is on a link beside it."""


@dataclass(frozen=True, slots=True)
class State:
    """As psdmc and Pinocchio have it: q (19,) with the quaternion x y z w, v (18,) with the base's velocities along its own
    axes."""

    q: Array
    v: Array


class World:
    """A robot of `joints` (the package's order) and `feet` (names of links)."""

    def __init__(self, urdf: str, base: str, joints: Sequence[str], feet: Sequence[str]) -> None:
        spec = mujoco.MjSpec.from_string(_on_a_free_joint(urdf, base))
        spec.option.timestep = PHYSICS_STEP
        spec.worldbody.add_geom(
            name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1], friction=[FRICTION, 0.005, 1e-4]
        )
        for foot in feet:
            spec.body(foot).add_geom(
                name=foot,
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[FOOT_RADIUS, 0, 0],
                mass=0.0,
                friction=[FRICTION, 0.005, 1e-4],
            )
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.base = base
        self.positions = np.array([self.model.joint(name).qposadr[0] for name in joints])
        self.rates = np.array([self.model.joint(name).dofadr[0] for name in joints])
        self.feet = [self.model.geom(foot).id for foot in feet]

    def place(self, joints: Array) -> None:
        """At rest, level, with these joint positions and the lowest foot on the floor."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        self.data.qpos[self.positions] = joints
        mujoco.mj_kinematics(self.model, self.data)
        self.data.qpos[2] = FOOT_RADIUS - min(self.data.geom_xpos[foot][2] for foot in self.feet)
        mujoco.mj_forward(self.model, self.data)

    def state(self) -> State:
        """MuJoCo's quaternion is w x y z, and its linear velocity along the world's axes."""
        place, turn = self.data.qpos[:3], self.data.qpos[3:7]
        to_world = np.empty(9)
        mujoco.mju_quat2Mat(to_world, turn)
        linear = to_world.reshape(3, 3).T @ self.data.qvel[:3]
        q = np.concatenate([place, turn[[1, 2, 3, 0]], self.data.qpos[self.positions]])
        return State(q, np.concatenate([linear, self.data.qvel[3:6], self.data.qvel[self.rates]]))

    def push(self, force: float) -> None:
        """From now on: N on the base along the world's y."""
        self.data.xfrc_applied[self.model.body(self.base).id, 1] = force

    def advance(self, tau: Array, seconds: float) -> None:
        self.data.qfrc_applied[self.rates] = tau
        mujoco.mj_step(self.model, self.data, nstep=round(seconds / PHYSICS_STEP))

    def forces(self) -> Array:
        """(feet, 3) N that the floor exerts on each foot now, along the world's axes."""
        found, wrench = np.zeros((len(self.feet), 3)), np.empty(6)
        for number, contact in enumerate(self.data.contact):
            mujoco.mj_contactForce(self.model, self.data, number, wrench)
            force = contact.frame.reshape(3, 3).T @ wrench[:3]
            for side, sign in zip(contact.geom, (-1.0, 1.0), strict=True):
                if side in self.feet:
                    found[self.feet.index(side)] += sign * force
        return found


def _on_a_free_joint(urdf: str, base: str) -> str:
    """The URDF without shapes (MuJoCo would ask for meshes), its base on a link `world` by a floating joint."""
    root = ElementTree.fromstring(urdf)
    for link in root.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    root.append(ElementTree.Element("link", name="world"))
    joint = ElementTree.SubElement(root, "joint", name="root_joint", type="floating")
    ElementTree.SubElement(joint, "parent", link="world")
    ElementTree.SubElement(joint, "child", link=base)
    options = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(options, "compiler", ADMIT)
    return ElementTree.tostring(root, encoding="unicode")
