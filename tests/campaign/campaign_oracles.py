"""A URDF text's dynamics by Pinocchio and by MuJoCo, each through its own reader; and the textbook's recursion with more
digits than either."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio

from psdmc.robot.mechanism import Mechanism

Array = np.ndarray

MODELS = {"revolute": pinocchio.JointModelRZ, "prismatic": pinocchio.JointModelPZ}


class Pinocchio:
    """rnea, crba, nonLinearEffects, computeGeneralizedGravity and aba."""

    def __init__(self, model: pinocchio.Model) -> None:
        self.model, self.data = model, model.createData()

    @staticmethod
    def of_text(text: str) -> Pinocchio:
        return Pinocchio(pinocchio.buildModelFromXML(text))

    @staticmethod
    def of_chain(chain: Mechanism) -> Pinocchio:
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
        return self._by_rows(pinocchio.rnea, q, qd, qdd)

    def mass_matrix(self, q: Array) -> Array:
        """crba fills one triangle."""
        upper = np.triu(self._by_rows(pinocchio.crba, q))
        return upper + np.triu(upper, 1).swapaxes(1, 2)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self._by_rows(pinocchio.nonLinearEffects, q, qd)

    def gravity(self, q: Array) -> Array:
        return self._by_rows(pinocchio.computeGeneralizedGravity, q)

    def accelerations(self, q: Array, qd: Array, tau: Array) -> Array:
        return self._by_rows(pinocchio.aba, q, qd, tau)

    def _by_rows(self, algorithm, q: Array, *vectors: Array) -> Array:
        rows = zip(self._configurations(q), *vectors, strict=True)
        return np.array([np.array(algorithm(self.model, self.data, *row)) for row in rows])

    def _configurations(self, q: Array) -> Array:
        """A continuous joint is cosine and sine in a model that Pinocchio read from a file."""
        columns: list[Array] = []
        for joint in list(self.model.joints)[1:]:
            angle = q[:, joint.idx_v]
            columns += [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        return np.ascontiguousarray(np.stack(columns, axis=1))


class MuJoCo:
    """mj_rne alone, which every MuJoCo has under one signature: no contacts, limits or friction take part."""

    def __init__(self, text: str) -> None:
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        result = np.empty_like(q)
        for row, state in enumerate(zip(q, qd, qdd, strict=True)):
            self._move(*state)
            mujoco.mj_rne(self.model, self.data, 1, result[row])
        return result

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.torques(q, qd, np.zeros_like(q))

    def mass_matrix(self, q: Array) -> Array:
        """Column by column: torques at rest, without gravity, of one unit acceleration."""
        weight, rest = self.model.opt.gravity.copy(), np.zeros_like(q)
        self.model.opt.gravity = 0.0
        columns = [self.torques(q, rest, rest + unit) for unit in np.eye(q.shape[1])]
        self.model.opt.gravity = weight
        return np.stack(columns, axis=2)

    def _move(self, q: Array, qd: Array, qdd: Array) -> None:
        data = self.data
        data.qpos, data.qvel, data.qacc = q, qd, qdd
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_comVel(self.model, data)


class Textbook:
    """Newton and Euler in the base frame about centres of mass, in extended precision, on a model that Pinocchio read.

    For robots of many scales: rnea carries a body's momentum times its speed, which cancels, and so leaves 1e-16 m v^2 in
    torques of m g 1e-6 m.
    """

    def __init__(self, oracle: Pinocchio) -> None:
        self.model, self.data = oracle.model, oracle.data

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        return self._torques(q, qd, qdd, -self.model.gravity.linear)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.torques(q, qd, np.zeros_like(q))

    def gravity(self, q: Array) -> Array:
        return self.torques(q, np.zeros_like(q), np.zeros_like(q))

    def mass_matrix(self, q: Array) -> Array:
        rest = np.zeros_like(q)
        columns = [self._torques(q, rest, rest + unit, np.zeros(3)) for unit in np.eye(q.shape[1])]
        return np.stack(columns, axis=2)

    def _torques(self, q: Array, qd: Array, qdd: Array, base: Array) -> Array:
        """Outward: rotation, spin, its rate and the acceleration of each joint's frame; inward: force and moment."""
        q, qd, qdd = (vector.astype(np.longdouble) for vector in (q, qd, qdd))
        count, n = q.shape
        turned = np.broadcast_to(np.eye(3, dtype=np.longdouble), (count, 3, 3))
        w, dw, a = np.zeros((3, count, 3), np.longdouble)
        a = a + base
        axes, ways, loads = [], [], []
        for k in range(n):
            turns, axis = self._axis(k + 1)
            place, body = self.model.jointPlacements[k + 1], self.model.inertias[k + 1]
            way = turned @ place.translation.astype(np.longdouble)
            turned = turned @ place.rotation.astype(np.longdouble)
            along = turned @ axis
            rate, gain = qd[:, k, None] * along, qdd[:, k, None] * along
            if turns:
                turned = turned @ _turn(axis, q[:, k])
            else:
                way = way + q[:, k, None] * along
            a = a + np.cross(dw, way) + np.cross(w, np.cross(w, way))
            if turns:
                dw, w = dw + gain + np.cross(w, rate), w + rate
            else:
                a = a + gain + 2 * np.cross(w, rate)
            to_centre = turned @ body.lever.astype(np.longdouble)
            tensor = turned @ body.inertia.astype(np.longdouble) @ turned.swapaxes(1, 2)
            force = body.mass * (a + np.cross(dw, to_centre) + np.cross(w, np.cross(w, to_centre)))
            spin = np.einsum("sij,sj->si", tensor, w)
            moment = np.einsum("sij,sj->si", tensor, dw) + np.cross(w, spin) + np.cross(to_centre, force)
            axes.append((turns, along))
            ways.append(way)
            loads.append((force, moment))
        result = np.empty((count, n))
        force, moment = np.zeros((2, count, 3), np.longdouble)
        for k in reversed(range(n)):
            force, moment = force + loads[k][0], moment + loads[k][1]
            turns, along = axes[k]
            result[:, k] = (along * (moment if turns else force)).sum(axis=1)
            moment = moment + np.cross(ways[k], force)
        return result

    def _axis(self, joint: int) -> tuple[bool, Array]:
        """Whether a joint turns, and along what, in its own frame."""
        model = self.model.joints[joint]
        data = model.createData()
        model.calc(data, pinocchio.neutral(self.model))
        column = np.array(data.S).reshape(6)
        turns = bool(np.any(column[3:]))
        return turns, (column[3:] if turns else column[:3]).astype(np.longdouble)


def _turn(axis: Array, angles: Array) -> Array:
    """(states, 3, 3) rotations about an axis, by Rodrigues."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], np.longdouble)
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)
