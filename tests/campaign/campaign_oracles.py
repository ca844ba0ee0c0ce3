"""Inverse dynamics of a URDF text by Pinocchio and by MuJoCo, each through its own reader."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio

from psdmc.robot.chain import Chain

Array = np.ndarray

MODELS = {"revolute": pinocchio.JointModelRZ, "prismatic": pinocchio.JointModelPZ}


class Pinocchio:
    """rnea, and the mass matrix's condition number."""

    def __init__(self, model: pinocchio.Model) -> None:
        self.model, self.data = model, model.createData()

    @staticmethod
    def of_text(text: str) -> Pinocchio:
        return Pinocchio(pinocchio.buildModelFromXML(text))

    @staticmethod
    def of_chain(chain: Chain) -> Pinocchio:
        """psdmc's own chain, rounded angles made exact: what snapping left, but nothing of the derivation."""
        model, parent = pinocchio.Model(), 0
        for joint, row in zip(chain.joints, chain.parameters, strict=True):
            kind = MODELS[joint.kind]()
            place = pinocchio.SE3(joint.placement.rotation.copy(), joint.placement.translation.copy())
            parent = model.addJoint(parent, kind, place, joint.name)
            body = pinocchio.Inertia.FromDynamicParameters(row[:10].copy())
            link = pinocchio.SE3(joint.link_frame.rotation.copy(), joint.link_frame.translation.copy())
            model.appendBodyToJoint(parent, body, link)
        model.gravity.linear = chain.gravity.copy()
        return Pinocchio(model)

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        model, data, rnea = self.model, self.data, pinocchio.rnea
        rows = self._configurations(q)
        return np.array([rnea(model, data, *row) for row in zip(rows, qd, qdd, strict=True)])

    def _configurations(self, q: Array) -> Array:
        """A continuous joint is cosine and sine in a model that Pinocchio read from a file."""
        columns: list[Array] = []
        for joint in list(self.model.joints)[1:]:
            angle = q[:, joint.idx_v]
            columns += [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        return np.ascontiguousarray(np.stack(columns, axis=1))


class MuJoCo:
    """mj_rne with accelerations: no contacts, limits or friction take part."""

    def __init__(self, text: str) -> None:
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        model, data = self.model, self.data
        result = np.empty_like(q)
        for row, (a, b, c) in enumerate(zip(q, qd, qdd, strict=True)):
            data.qpos, data.qvel, data.qacc = a, b, c
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            mujoco.mj_rne(model, data, 1, result[row])
        return result
