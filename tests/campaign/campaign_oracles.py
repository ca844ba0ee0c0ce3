"""A robot's dynamics by Pinocchio and by MuJoCo, each through its own reader of the file; and the textbook's recursion with
more digits than either. Vectors are those of the robot's coordinates, in Pinocchio's order."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio
from campaign_joints import ROOT_Q, ROOT_RATES, Joints
from campaign_robots import RandomRobot

from psdmc.robot.mechanism import Mechanism

Array = np.ndarray


class Pinocchio:
    """rnea, crba, nonLinearEffects, computeGeneralizedGravity and the regressor of a model whose joints are all free."""

    def __init__(self, model: pinocchio.Model, robot: RandomRobot | None = None) -> None:
        first = 2 if robot is not None and robot.is_floating else 1
        self.model, self.data = model, model.createData()
        self.joints = Joints.of(list(model.names)[first:], robot)

    @staticmethod
    def of_robot(robot: RandomRobot) -> Pinocchio:
        """The file as Pinocchio reads it; joints that are held are fixed where they are."""
        free = [pinocchio.JointModelFreeFlyer()] if robot.is_floating else []
        whole = pinocchio.buildModelFromXML(robot.text, *free)
        held = {name: one.offset for name in robot.joints if not (one := robot.coordinate_of(name)).ratio}
        if not held:
            return Pinocchio(whole, robot)
        at = pinocchio.neutral(whole)
        for name, value in held.items():
            joint = whole.joints[whole.getJointId(name)]
            at[joint.idx_q : joint.idx_q + joint.nq] = (
                [np.cos(value), np.sin(value)] if joint.nq == 2 else value
            )
        return Pinocchio(
            pinocchio.buildReducedModel(whole, [whole.getJointId(name) for name in held], at), robot
        )

    @staticmethod
    def of_chain(chain: Mechanism, robot: RandomRobot | None = None) -> Pinocchio:
        """psdmc's own mechanism, rounded angles made exact: what snapping left, but nothing of the derivation."""
        model = pinocchio.Model()
        for joint, parent, row in zip(chain.joints, chain.parents, chain.parameters, strict=True):
            kind = getattr(pinocchio, f"JointModel{joint.type.pinocchio}")()
            place = pinocchio.SE3(joint.placement.rotation.copy(), joint.placement.translation.copy())
            number = model.addJoint(parent + 1, kind, place, joint.name)
            body = (
                pinocchio.Inertia.FromDynamicParameters(row[:10].copy())
                if row[0]
                else pinocchio.Inertia.Zero()
            )
            link = pinocchio.SE3(joint.link_frame.rotation.copy(), joint.link_frame.translation.copy())
            model.appendBodyToJoint(number, body, link)
        model.gravity.linear = chain.gravity.copy()
        return Pinocchio(model, robot)

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        return self.joints.summed(self._by_rows(pinocchio.rnea, q, qd, qdd))

    def mass_matrix(self, q: Array) -> Array:
        """crba fills one triangle."""
        upper = np.triu(self._by_rows(pinocchio.crba, q))
        return self.joints.summed_matrix(upper + np.triu(upper, 1).swapaxes(1, 2))

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.joints.summed(self._by_rows(pinocchio.nonLinearEffects, q, qd))

    def gravity(self, q: Array) -> Array:
        return self.joints.summed(self._by_rows(pinocchio.computeGeneralizedGravity, q))

    def regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        """(count, nv, 10 bodies) by standard parameters of bodies that have mass."""
        whole = self._by_rows(pinocchio.computeJointTorqueRegressor, q, qd, qdd)
        whole = whole.reshape(len(q), self.model.nv, -1)
        heavy = np.repeat([body.mass > 0.0 for body in list(self.model.inertias)[1:]], 10)
        return self.joints.summed(whole[:, :, heavy].swapaxes(1, 2)).swapaxes(1, 2)

    def _by_rows(self, algorithm, q: Array, *rates: Array) -> Array:
        rows = zip(self._configurations(q), *map(self.joints.rates, rates), strict=True)
        return np.array([np.array(algorithm(self.model, self.data, *row)) for row in rows])

    def _configurations(self, q: Array) -> Array:
        """A continuous joint is cosine and sine in a model that Pinocchio read from a file."""
        first = self.joints.root[0]
        values = self.joints.positions(q)
        columns: list[Array] = list(values[:, :first].T)
        for angle, name in zip(values[:, first:].T, self.joints.names, strict=True):
            joint = self.model.joints[self.model.getJointId(name)]
            columns += [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        return np.ascontiguousarray(np.stack(columns, axis=1))


FREE_ROOT = (
    "<link name='universe'/><joint name='root_joint' type='floating'><parent link='universe'/>"
    "<child link='base'/></joint></robot>"
)


class MuJoCo:
    """mj_rne alone, which every MuJoCo has under one signature: no contacts, limits or friction take part.

    coordinates  in the order of all vectors
    """

    def __init__(self, robot: RandomRobot, coordinates: Sequence[str]) -> None:
        text = robot.text.replace("</robot>", FREE_ROOT) if robot.is_floating else robot.text
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.joints = Joints.of(robot.joints, robot).in_order_of(coordinates)
        kind = mujoco.mjtObj.mjOBJ_JOINT
        numbers = [mujoco.mj_name2id(self.model, kind, name) for name in robot.joints]
        places, rates = self.model.jnt_qposadr, self.model.jnt_dofadr
        root = mujoco.mj_name2id(self.model, kind, "root_joint") if robot.is_floating else -1
        self.places = [*(places[root] + np.arange(ROOT_Q) if root >= 0 else ()), *places[numbers]]
        self.rates = [*(rates[root] + np.arange(ROOT_RATES) if root >= 0 else ()), *rates[numbers]]

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        states = self.joints.positions(q), self.joints.rates(qd), self.joints.rates(qdd)
        turned = None
        if self.joints.is_floating:
            turned = _rotations(q[:, 3:7])
            states = _about_world(turned, *states)
        result = np.empty_like(states[1])
        row = np.empty(self.model.nv)
        for k, state in enumerate(zip(*states, strict=True)):
            self._move(*state)
            mujoco.mj_rne(self.model, self.data, 1, row)
            result[k] = row[self.rates]
        if turned is not None:
            result[:, :3] = np.einsum("kji,kj->ki", turned, result[:, :3])
        return self.joints.summed(result)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.torques(q, qd, np.zeros_like(qd))

    def mass_matrix(self, q: Array) -> Array:
        """Column by column: torques at rest, without gravity, of one unit acceleration."""
        weight, rest = self.model.opt.gravity.copy(), np.zeros((len(q), self.joints.nv))
        self.model.opt.gravity = 0.0
        columns = [self.torques(q, rest, rest + unit) for unit in np.eye(self.joints.nv)]
        self.model.opt.gravity = weight
        return np.stack(columns, axis=2)

    def _move(self, q: Array, qd: Array, qdd: Array) -> None:
        data = self.data
        data.qpos[self.places], data.qvel[self.rates], data.qacc[self.rates] = q, qd, qdd
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_comVel(self.model, data)


def _about_world(turned: Array, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
    """States with a floating base as MuJoCo has them: quaternion wxyz, the origin's velocity and acceleration along the
    world's axes; angular ones stay along the root's own."""
    linear, angular = qd[:, :3], qd[:, 3:6]
    q, qd, qdd = q.copy(), qd.copy(), qdd.copy()
    q[:, 3:7] = q[:, [6, 3, 4, 5]]
    qdd[:, :3] = np.einsum("kij,kj->ki", turned, qdd[:, :3] + np.cross(angular, linear))
    qd[:, :3] = np.einsum("kij,kj->ki", turned, linear)
    return q, qd, qdd


def _rotations(quaternions: Array) -> Array:
    """(count, 3, 3) of (count, 4) xyzw."""
    return np.array([pinocchio.Quaternion(row).toRotationMatrix() for row in quaternions])


class Textbook:
    """Newton and Euler in the base frame about centres of mass, in extended precision, on a model that Pinocchio read.

    For robots of many scales: rnea carries a body's momentum times its speed, which cancels, and so leaves 1e-16 m v^2 in
    torques of m g 1e-6 m. Robots with a fixed base.
    """

    def __init__(self, oracle: Pinocchio) -> None:
        self.model, self.joints = oracle.model, oracle.joints

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
        given = self.joints.positions(q), self.joints.rates(qd), self.joints.rates(qdd)
        q, qd, qdd = (vector.astype(np.longdouble) for vector in given)
        count, n = q.shape
        still = np.zeros((count, 3), np.longdouble)
        states = [
            (np.broadcast_to(np.eye(3, dtype=np.longdouble), (count, 3, 3)), still, still, still + base)
        ]
        axes, ways, loads = [], [], []
        for k in range(n):
            turned, w, dw, a = states[self.model.parents[k + 1]]
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
            states.append((turned, w, dw, a))
            axes.append((turns, along))
            ways.append(way)
            loads.append((force, moment))
        return self.joints.summed(self._inward(axes, ways, loads)).astype(np.float64)

    def _inward(self, axes: list, ways: list, loads: list) -> Array:
        """(count, joints) efforts, children before parents."""
        result = []
        for k in reversed(range(len(axes))):
            (turns, along), (force, moment) = axes[k], loads[k]
            result.append((along * (moment if turns else force)).sum(axis=1))
            above = self.model.parents[k + 1] - 1
            if above >= 0:
                onto = loads[above]
                loads[above] = onto[0] + force, onto[1] + moment + np.cross(ways[k], force)
        return np.stack(result[::-1], axis=1)

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
