"""The robot as MuJoCo sees it: the same URDF, somebody else's physics."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from controller import Controller
from reference import Array, Trajectory

PHYSICS_STEP = 2.5e-4
"""s; with the fourth-order Runge-Kutta method its error lies far below the controller's."""


@dataclass(frozen=True, slots=True)
class Payload:
    """A rigid load on the tip link: kg, m and kg m^2 about its centre of mass, along the tip link's axes."""

    mass: float
    com: tuple[float, float, float]
    inertia: float

    def link(self) -> list[ElementTree.Element]:
        """As URDF: a link, and the fixed joint that holds it (its parent is filled in by the plant)."""
        text = (
            f'<robot><link name="payload"><inertial><origin xyz="{" ".join(map(str, self.com))}"/>'
            f'<mass value="{self.mass}"/><inertia ixx="{self.inertia}" iyy="{self.inertia}" izz="{self.inertia}"'
            ' ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="payload_mount" type="fixed">'
            '<parent link=""/><child link="payload"/></joint></robot>'
        )
        return list(ElementTree.fromstring(text))


@dataclass(frozen=True, slots=True)
class Run:
    """One closed loop: times (k,), errors q_ref - q and torques, each (k, n)."""

    time: Array
    error: Array
    tau: Array


class Plant:
    """MuJoCo's model of a URDF; its joints in the order that the controller knows."""

    def __init__(self, urdf: str, joints: Sequence[str], tip: str, payload: Payload | None = None) -> None:
        self.model = mujoco.MjModel.from_xml_string(_without_shapes(urdf, tip, payload))
        own = [self.model.joint(k).name for k in range(self.model.njnt)]
        if sorted(own) != sorted(joints):
            raise SystemExit(
                f"MuJoCo finds the joints {own}, the package has {list(joints)}: only one chain, please"
            )
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.model.opt.timestep = PHYSICS_STEP
        self.data = mujoco.MjData(self.model)
        self.at = np.array([self.model.joint(name).dofadr[0] for name in joints])

    def run(self, controller: Controller, wanted: Trajectory, period: float) -> Run:
        """From rest on the reference; the controller is called every `period` s, and its torque held."""
        times = np.arange(round(wanted.end / period), dtype=np.float64) * period
        self._reset(wanted(0.0).q)
        rows = []
        for time in times:
            reference = wanted(time)
            q, qd = self.data.qpos[self.at], self.data.qvel[self.at]
            tau = controller(reference, q, qd)
            self.data.qfrc_applied[self.at] = tau
            mujoco.mj_step(self.model, self.data, nstep=round(period / PHYSICS_STEP))
            rows.append((reference.q - q, tau))
        error, tau = (np.array(column, np.float64) for column in zip(*rows, strict=True))
        return Run(times, error, tau)

    def _reset(self, q: Array) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.at] = q
        mujoco.mj_forward(self.model, self.data)

    def gravity(self, q: Array) -> Array:
        """Torques (n,) that hold the robot still, by MuJoCo."""
        self._reset(q)
        return np.asarray(self.data.qfrc_bias[self.at], np.float64)

    def mass_matrix(self, q: Array) -> Array:
        """M(q), (n, n), by MuJoCo."""
        self._reset(q)
        columns = []
        for unit in np.eye(self.model.nv)[self.at]:
            column = np.empty(self.model.nv)
            mujoco.mj_mulM(self.model, self.data, column, unit)
            columns.append(column[self.at])
        return np.array(columns).T


def _without_shapes(urdf: str, tip: str, payload: Payload | None) -> str:
    """The URDF without meshes (MuJoCo would ask for their files) and contacts, with the payload on its tip."""
    root = ElementTree.fromstring(urdf)
    for link in root.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    if payload is not None:
        root.extend(payload.link())
        root.find("joint[@name='payload_mount']/parent").set("link", tip)  # type: ignore[union-attr]
    return ElementTree.tostring(root, encoding="unicode")
