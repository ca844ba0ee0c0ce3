"""Computes the dynamics of a robot with Pinocchio from the robot's own file, for arrays of states. psdmc compares its
results with this reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio

from psdmc.errors import InternalError
from psdmc.robot.coordinates import MimicMap
from psdmc.robot.joints import REVOLUTE, WIDE_TYPES, JointType
from psdmc.robot.load import LoadedRobot
from psdmc.robot.mechanism import POINT, Array, Mechanism
from psdmc.robot.reference_model import frame_number, loop_frames, reference_model

CENTRAL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Weights of a central difference of eighth order."""

DIFFERENCE = 0.02
"""rad or m: its step. The ninth derivative leaves 1e-16, rounding 1e-14."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The dynamics of one Pinocchio model for arrays of states: q, qd, qdd, tau (..., n) with n joints, and wrenches
    (..., frames, 6), SI.

    tip_name     name of the frame of which `jacobian` returns the Jacobian
    frame_names  the named frames; empty: the tip alone
    rows         for each named frame, 3 for a contact point, 6 for a surface, 0 for none; empty: all are points
    loops        for each closed loop, the numbers of its two frames, and its rows
    passive      the numbers of the rates of passive joints
    """

    model: pinocchio.Model
    tip_name: str
    frame_names: tuple[str, ...] = ()
    rows: tuple[int, ...] = ()
    loops: tuple[tuple[int, int, tuple[int, ...]], ...] = ()
    passive: tuple[int, ...] = ()

    @property
    def contacts(self) -> list[tuple[int, int]]:
        """Return each contact's frame number in Pinocchio's model, and its number of rows (3 or 6)."""
        ids = self.frame_ids
        return [
            (frame, rows) for frame, rows in zip(ids, self.rows or (POINT,) * len(ids), strict=True) if rows
        ]

    def of_contacts(self, values: Array) -> Array:
        """Return the rows (..., rows, n) of all contacts from values (..., frames, 6, n) of all named frames."""
        counts = self.rows or (POINT,) * values.shape[-3]
        return np.concatenate([values[..., k, :rows, :] for k, rows in enumerate(counts)], axis=-2)

    def pushed_slopes(self, q: Array, forces: Array) -> Array:
        """Return the derivatives (..., nv, nv) of J^T f by q, with constant contact forces f (..., rows) along the base's
        axes.

        Pinocchio's derivatives hold wrenches constant along the axes of their frames. A force F that is constant along
        the base's axes changes by F x w along the frame's axes if the frame turns by w. This is added.
        """

        def pushed(model: pinocchio.Model, data: pinocchio.Data, q: Array, forces: Array) -> Array:
            still, bent, first = np.zeros(model.nv), np.zeros((model.nv, model.nv)), 0
            external = [pinocchio.Force.Zero() for _ in range(model.njoints)]
            pinocchio.framesForwardKinematics(model, data, q)
            for number, rows in self.contacts:
                own = np.append(forces[first : first + rows], np.zeros(6 - rows)).reshape(2, 3)
                first += rows
                frame, rotation = model.frames[number], data.oMf[number].rotation
                force = pinocchio.Force((own @ rotation).reshape(6))
                external[frame.parentJoint] += frame.placement.act(force)
                aligned = pinocchio.LOCAL_WORLD_ALIGNED
                lines = np.reshape(
                    pinocchio.computeFrameJacobian(model, data, q, number, aligned), (2, 3, -1)
                )
                bent += np.einsum("pai,pja->ij", lines, np.cross(own[:, None], lines[1].T))
            slopes = pinocchio.computeRNEADerivatives(model, data, q, still, still, external)[0]
            return np.asarray(bent - slopes)

        return self.weightless.each(pushed, q, forces)

    @property
    def weightless(self) -> Reference:
        """Return the robot without gravity."""
        model = self.model.copy()
        model.gravity = pinocchio.Motion.Zero()
        return replace(self, model=model)

    @property
    def frame_ids(self) -> list[int]:
        """Pinocchio's numbers of the named frames."""
        return [frame_number(self.model, name) for name in self.frame_names or (self.tip_name,)]

    @property
    def joint_types(self) -> list[JointType]:
        """Return the types of joints in Pinocchio's order. Those with one coordinate count as revolute."""
        known = {f"JointModel{kind.pinocchio}": kind for kind in WIDE_TYPES.values()}
        return [known.get(joint.shortname(), REVOLUTE) for joint in list(self.model.joints)[1:]]

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array, wrenches: Array | None = None) -> Array:
        return self._loaded(pinocchio.rnea, wrenches, q, qd, qdd)

    def forward_dynamics(self, q: Array, qd: Array, tau: Array, wrenches: Array | None = None) -> Array:
        return self._loaded(pinocchio.aba, wrenches, q, qd, tau)

    def mass_matrix(self, q: Array) -> Array:
        """Return the mass matrices (..., n, n) at positions q, with both triangles."""
        upper = np.triu(self.each(pinocchio.crba, q))
        return upper + np.swapaxes(np.triu(upper, 1), -1, -2)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.each(pinocchio.nonLinearEffects, q, qd)

    def gravity(self, q: Array) -> Array:
        return self.each(pinocchio.computeGeneralizedGravity, q)

    def coriolis_matrix(self, q: Array, qd: Array) -> Array:
        """Return the Coriolis matrices (..., n, n)."""
        return self.each(pinocchio.computeCoriolisMatrix, q, qd)

    def inverse_dynamics_derivatives(
        self, q: Array, qd: Array, qdd: Array, wrenches: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Return the derivatives of the torques by q, qd and qdd, (..., n, n) each; row i is of tau[i]."""
        by_q, by_qd, by_qdd = np.moveaxis(self._loaded(torque_derivatives, wrenches, q, qd, qdd), -3, 0)
        return by_q, by_qd, by_qdd

    def forward_dynamics_derivatives(
        self, q: Array, qd: Array, tau: Array, wrenches: Array | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Return the joint accelerations (..., n), and their derivatives by q, qd and tau, an array (..., n, n) each.
        Row i belongs to qdd[i]."""
        by_q, by_qd, by_tau = np.moveaxis(self._loaded(acceleration_derivatives, wrenches, q, qd, tau), -3, 0)
        return self.forward_dynamics(q, qd, tau, wrenches), by_q, by_qd, by_tau

    def second_derivatives(self, gradient: Callable[..., Sequence[Array]], *states: Array) -> Array:
        """Return (..., 3 nv, 3 nv) second derivatives from this gradient by q, qd and a third vector. They are its
        central differences, for q of eighth order and along `integrate`. The gradient may be at most quadratic in qd and
        the third vector: then these differences are exact. Joints with several coordinates: the mean of both orders."""
        nv = self.model.nv
        columns = []
        for which, size in enumerate((DIFFERENCE, 1.0, 1.0)):
            for step in size * np.eye(nv):
                total = np.zeros((*states[1].shape[:-1], 3 * nv))
                for k, weight in enumerate((0.5,) if which else CENTRAL, start=1):
                    for sign in (k, -k):
                        moved = list(states)
                        change = np.broadcast_to(sign * step, states[1].shape)
                        moved[which] = moved[which] + change if which else self.integrated(moved[0], change)
                        total += np.copysign(weight / size, weight * sign) * np.concatenate(
                            gradient(*moved), -1
                        )
                columns.append(total)
        found = np.stack(columns, axis=-1)
        mean: Array = 0.5 * (found + np.swapaxes(found, -1, -2))
        return mean

    def integrated(self, q: Array, step: Array) -> Array:
        """Return positions (..., nq) after a motion from q at constant rates; `step` is rates times duration."""

        def moved(model: pinocchio.Model, data: pinocchio.Data, *state: Array) -> Array:
            return np.asarray(pinocchio.integrate(model, *state))

        return self.each(moved, q, step)

    def integrated_slopes(self, q: Array, step: Array) -> tuple[Array, Array]:
        """Return the derivatives of `integrated` by q and by `step`, an array (..., nv, nv) each. Changes of positions
        are small motions along the joint rates."""

        def slopes(model: pinocchio.Model, data: pinocchio.Data, *state: Array) -> Array:
            return np.array(
                [pinocchio.dIntegrate(model, *state, which) for which in (pinocchio.ARG0, pinocchio.ARG1)]
            )

        by_start, by_step = np.moveaxis(self.each(slopes, q, step), -3, 0)
        return by_start, by_step

    def coordinate_rates(self, q: Array, qd: Array) -> Array:
        """Return the time derivatives (..., nq) of the coordinates at these rates.

        They are computed by a central difference of eighth order, with an error of 1e-12 of the rates.
        """
        step = DIFFERENCE / max(1.0, float(np.abs(qd).max()))
        total = np.zeros_like(q)
        for k, weight in enumerate(CENTRAL, start=1):
            total += weight * (self.integrated(q, k * step * qd) - self.integrated(q, -k * step * qd))
        return total / step

    def restored(self, q: Array) -> Array:
        """Return q (..., nq) with quaternions of length one."""

        def unit(model: pinocchio.Model, data: pinocchio.Data, q: Array) -> Array:
            return np.asarray(pinocchio.normalize(model, q))

        return self.each(unit, q)

    def jacobian(self, q: Array) -> Array:
        """Return the Jacobian (..., 6, n) of the tip frame along the axes of the base frame: three linear rows, then
        three angular rows."""
        frame = frame_number(self.model, self.tip_name)
        aligned = pinocchio.LOCAL_WORLD_ALIGNED

        def of_tip(model: pinocchio.Model, data: pinocchio.Data, q: Array) -> Array:
            # Pinocchio hands a single column over as a vector.
            jacobian: Array = np.reshape(
                pinocchio.computeFrameJacobian(model, data, q, frame, aligned), (6, model.nv)
            )
            return jacobian

        return self.each(of_tip, q)

    def local_frame_jacobians(self, q: Array) -> Array:
        """Return the Jacobians (..., frames, 6, n) of the named frames, along their own axes."""
        ids, local = self.frame_ids, pinocchio.LOCAL

        def of_frames(model: pinocchio.Model, data: pinocchio.Data, q: Array) -> Array:
            found = [pinocchio.computeFrameJacobian(model, data, q, frame, local) for frame in ids]
            return np.reshape(found, (-1, 6, model.nv))

        return self.each(of_frames, q)

    def poses(self, q: Array, link_names: Sequence[str]) -> Array:
        """Return the poses (..., number of links + 1, 4, 4) of all links' frames and of the tip in the base frame."""
        kind = pinocchio.FrameType.BODY
        frames = [self.model.getFrameId(name, kind) for name in link_names]
        frames.append(frame_number(self.model, self.tip_name))

        def of_links(model: pinocchio.Model, data: pinocchio.Data, q: Array) -> Array:
            pinocchio.framesForwardKinematics(model, data, q)
            return np.array([data.oMf[frame].homogeneous for frame in frames])

        return self.each(of_links, q)

    @property
    def gravity_vector(self) -> Array:
        """(3,) m/s^2, gravity in the base frame."""
        return np.array(self.model.gravity.linear)

    @property
    def path_length(self) -> float:
        """Return the length in m of the longest path from the base to an end of the tree, at the neutral position. The
        path goes through all frames, including those of fixed joints."""
        model, data = self.model, self.model.createData()
        pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
        parents = list(model.parents)
        ends = [k for k in range(1, model.njoints) if k not in parents]
        at_ends = [f for f, frame in enumerate(model.frames) if frame.parentJoint in ends]
        tip = frame_number(model, self.tip_name)
        return max(_way_to(frame, model, data) for frame in ([tip] if len(ends) == 1 else [tip, *at_ends]))

    def _loaded(self, function: Callable[..., Array], wrenches: Array | None, *states: Array) -> Array:
        """Return what `each` returns, with external forces as the function's last argument if wrenches (..., frames, 6) at
        the named frames are given. Pinocchio's forces are about the joints' origins, along the joints' axes."""
        if wrenches is None:
            return self.each(function, *states)
        ids = self.frame_ids

        def loaded(model: pinocchio.Model, data: pinocchio.Data, *state: Array) -> Array:
            forces = [pinocchio.Force.Zero() for _ in range(model.njoints)]
            for number, wrench in zip(ids, state[-1].reshape(-1, 6), strict=True):
                frame = model.frames[number]
                forces[frame.parentJoint] += frame.placement.act(pinocchio.Force(wrench))
            return function(model, data, *state[:-1], forces)

        return self.each(loaded, *states, np.reshape(wrenches, (*wrenches.shape[:-2], -1)))

    @cached_property
    def _data(self) -> pinocchio.Data:
        return self.model.createData()

    def each(self, function: Callable[..., Array], *states: Array) -> Array:
        """Return the values of a Pinocchio function of (model, data, state ...) at every state. The leading axes of the
        states broadcast as in NumPy."""
        data = self._data
        rows = [np.asarray(state, dtype=float) for state in states]
        lead = np.broadcast_shapes(*(row.shape[:-1] for row in rows))
        flat = [np.broadcast_to(row, (*lead, row.shape[-1])).reshape(-1, row.shape[-1]) for row in rows]
        results = [np.array(function(self.model, data, *row)) for row in zip(*flat, strict=True)]
        return np.array(results).reshape(*lead, *results[0].shape)


def torque_derivatives(model: pinocchio.Model, data: pinocchio.Data, *state: Any) -> Array:
    """Return the derivatives (3, n, n) by q, qd and qdd; `state` is these three, and external forces if there are any."""
    return _whole(pinocchio.computeRNEADerivatives(model, data, *state))


def acceleration_derivatives(model: pinocchio.Model, data: pinocchio.Data, *state: Any) -> Array:
    """Return the derivatives (3, n, n) by q, qd and tau; `state` is these three, and external forces if there are any."""
    return _whole(pinocchio.computeABADerivatives(model, data, *state))


def _whole(blocks: Sequence[Array]) -> Array:
    """Return the blocks as one array. Pinocchio fills only the upper triangle of the last one, which is symmetric."""
    *others, symmetric = blocks
    return np.stack([*others, np.triu(symmetric) + np.triu(symmetric, 1).T])


def _way_to(frame: int, model: pinocchio.Model, data: pinocchio.Data) -> float:
    """m, over every frame from the first one to this; InternalError where their parents do not lead there."""
    length, here = 0.0, frame
    for _ in range(model.nframes):
        if not here:
            return length
        above = model.frames[here].parentFrame
        if above >= model.nframes:
            break
        length += float(np.linalg.norm(data.oMf[here].translation - data.oMf[above].translation))
        here = above
    raise InternalError(f"frame {model.frames[frame].name!r} of Pinocchio's model hangs on no root")


def reference(loaded: LoadedRobot, *, snapped: bool = True, parameters: Array | None = None) -> Reference:
    """Return the Reference for a robot, from the Pinocchio model that `reference_model` returns."""
    model = reference_model(loaded, snapped=snapped, parameters=parameters)
    names = tuple(frame.name for frame in loaded.mechanism.frames)
    rows = tuple(frame.rows for frame in loaded.mechanism.frames)
    loops = tuple(
        (frame_number(model, first), frame_number(model, second), loop.rows)
        for loop in loaded.mechanism.loops
        for first, second in [loop_frames(loop)]
    )
    passive = loaded.mechanism.passive_rates
    return Reference(model, loaded.mechanism.tip_name, names, rows, loops, passive)


def pinocchio_version() -> str:
    """Return the version of the installed Pinocchio."""
    return str(pinocchio.__version__)


# Joints that follow others. Pinocchio's own mimic joints are left alone: half of its algorithms refuse them, and a leader
# must come before its mimic joints.
@dataclass(frozen=True, slots=True, eq=False)
class OnCoordinates:
    """The dynamics of a robot with mimic joints, computed with Pinocchio. The arrays q, qd, qdd, tau (..., nv) are for
    the joints that follow no other joint."""

    free: Reference
    mimic_map: MimicMap

    @staticmethod
    def of(reference: Reference, robot: Mechanism) -> OnCoordinates:
        return OnCoordinates(reference, MimicMap.of(robot.coordinates, robot.types))

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array) -> Array:
        return self.mimic_map.summed(self.free.inverse_dynamics(*self.on_joints(q, qd, qdd)))

    def on_joints(self, q: Array, *rates: Array) -> tuple[Array, ...]:
        """Return positions and rates (..., n) of all n joints from those of the joints that do not follow."""
        return self.mimic_map.positions(q), *map(self.mimic_map.rates, rates)

    @property
    def has_mimic_joints(self) -> bool:
        """Whether the robot has mimic joints."""
        joints, coordinates = self.mimic_map.ratios.shape
        return bool(joints > coordinates)

    def forward_dynamics(self, q: Array, qd: Array, tau: Array) -> Array:
        if not self.has_mimic_joints:
            return self.free.forward_dynamics(q, qd, tau)
        load = tau - self.nonlinear_effects(q, qd)
        return np.asarray(np.linalg.solve(self.mass_matrix(q), load[..., None])[..., 0])

    def mass_matrix(self, q: Array) -> Array:
        whole = self.free.mass_matrix(self.mimic_map.positions(q))
        return self.mimic_map.summed(self.mimic_map.summed(whole), -2)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.mimic_map.summed(self.free.nonlinear_effects(*self.on_joints(q, qd)))

    def gravity(self, q: Array) -> Array:
        return self.mimic_map.summed(self.free.gravity(self.mimic_map.positions(q)))
