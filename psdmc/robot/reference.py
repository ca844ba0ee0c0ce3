"""Pinocchio's own reading of a robot's source, to check everything else against.

It shares the file's text with the chain and as little code as it can: a URDF is read, merged and locked by
Pinocchio, a DH table becomes one Pinocchio joint per row. Only where the snapped robot is asked for do the
joints' placements come from the chain, because the file has none such; the bodies are still Pinocchio's.

The models have one coordinate per joint (a continuous joint is an angle), the chain's joints in the chain's
order, the chain's base as their universe, and a frame for the tip: use them with any Pinocchio function and
plain q, qd, qdd (n,).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio

from psdmc.errors import InputError
from psdmc.robot.chain import PARAMETERS_PER_LINK, Array, Chain, Placement, frozen_array
from psdmc.robot.dh import DhJoint, read_dh
from psdmc.robot.load import LoadedRobot
from psdmc.robot.pinocchio_text import JOINT_PREFIX, pinocchio_model

DRIVE = PARAMETERS_PER_LINK - 1


def reference_model(
    loaded: LoadedRobot, *, snapped: bool = True, parameters: Array | None = None
) -> pinocchio.Model:
    """Pinocchio's model of the robot.

    snapped      joints placed as the chain's are; False: as the file says, roundings included
    parameters   (n, 11) standard parameters about the link frames instead of the source's own

    Bodies with parameters assumed zero get the chain's values, which the source does not know. ValueError
    where parameters are needed and unknown.
    """
    chain = loaded.chain
    model = _urdf_model(loaded) if loaded.source_format == "urdf" else _dh_model(loaded)
    if parameters is None:
        values, replaced = chain.parameters, _assumed(chain)
    else:
        values, replaced = (
            frozen_array(parameters, chain.parameters.shape, "parameters"),
            list(range(len(chain))),
        )
    if np.isnan(values).any():
        raise ValueError("inertial parameters are unknown: give `parameters`")
    _set_bodies(model, chain, values, replaced)
    model.armature = values[:, DRIVE].copy()
    return _placed_as(chain, model) if snapped else model


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Pinocchio's dynamics of one model on arrays of states: q, qd, qdd, tau (..., n), SI.

    tip_name   the frame whose Jacobian is meant
    """

    model: pinocchio.Model
    tip_name: str

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array) -> Array:
        return self._each(pinocchio.rnea, q, qd, qdd)

    def forward_dynamics(self, q: Array, qd: Array, tau: Array) -> Array:
        return self._each(pinocchio.aba, q, qd, tau)

    def mass_matrix(self, q: Array) -> Array:
        """(..., n, n), both triangles."""
        upper = np.triu(self._each(pinocchio.crba, q))
        return upper + np.swapaxes(np.triu(upper, 1), -1, -2)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self._each(pinocchio.nonLinearEffects, q, qd)

    def gravity(self, q: Array) -> Array:
        return self._each(pinocchio.computeGeneralizedGravity, q)

    def coriolis_matrix(self, q: Array, qd: Array) -> Array:
        """(..., n, n)"""
        return self._each(pinocchio.computeCoriolisMatrix, q, qd)

    def jacobian(self, q: Array) -> Array:
        """(..., 6, n) of the tip frame: linear then angular, along the base frame's axes."""
        frame = self.model.getFrameId(self.tip_name)
        aligned = pinocchio.LOCAL_WORLD_ALIGNED

        def of_tip(model: pinocchio.Model, data: pinocchio.Data, q: Array) -> Array:
            # Pinocchio hands a single column over as a vector.
            jacobian: Array = np.reshape(
                pinocchio.computeFrameJacobian(model, data, q, frame, aligned), (6, model.nv)
            )
            return jacobian

        return self._each(of_tip, q)

    def _each(self, function: Callable[..., Array], *states: Array) -> Array:
        """Pinocchio's function at every state of broadcast arrays."""
        data = self.model.createData()
        rows = np.broadcast_arrays(*(np.asarray(state, dtype=float) for state in states))
        lead = rows[0].shape[:-1]
        flat = [row.reshape(-1, row.shape[-1]) for row in rows]
        results = [np.array(function(self.model, data, *row)) for row in zip(*flat, strict=True)]
        return np.array(results).reshape(*lead, *results[0].shape)


def reference(loaded: LoadedRobot, *, snapped: bool = True, parameters: Array | None = None) -> Reference:
    """reference_model with its functions at hand."""
    model = reference_model(loaded, snapped=snapped, parameters=parameters)
    return Reference(model, loaded.chain.tip_name)


def _urdf_model(loaded: LoadedRobot) -> pinocchio.Model:
    """The file as Pinocchio reads it, all but the chain's joints locked at neutral, seen from the base."""
    chain = loaded.chain
    whole = pinocchio_model(loaded.source_text, loaded.source_name)
    wanted = [JOINT_PREFIX + name for name in chain.joint_names]
    others = [k for k in range(1, whole.njoints) if whole.names[k] not in wanted]
    model = pinocchio.buildReducedModel(whole, others, pinocchio.neutral(whole)) if others else whole
    if list(model.names)[1:] != wanted:
        raise InputError(f"{loaded.source_name}: Pinocchio finds joints {list(model.names)[1:]}")
    for k, name in enumerate(chain.joint_names, start=1):
        model.names[k] = name
    root_gravity = loaded.options.gravity
    if root_gravity is not None:
        model.gravity.linear = np.array(root_gravity)
    base = model.frames[model.getFrameId(chain.base_name, pinocchio.FrameType.BODY)].placement
    model.jointPlacements[1] = base.inverse() * model.jointPlacements[1]
    model.gravity.linear = base.rotation.T @ model.gravity.linear
    return model


def _dh_model(loaded: LoadedRobot) -> pinocchio.Model:
    """One Pinocchio joint per row, in frames of its own: after the row's Rz(theta) for both conventions."""
    robot = read_dh(loaded.source_text, loaded.source_name)
    model = pinocchio.Model()
    model.name = robot.name
    before, parent = pinocchio.SE3.Identity(), 0
    for row, joint in zip(robot.joints, loaded.chain.joints, strict=True):
        about = pinocchio.JointModelRZ() if row.kind == "revolute" else pinocchio.JointModelPZ()
        twist = pinocchio.SE3(pinocchio.utils.rotate("x", row.alpha), np.zeros(3))
        slide_a = pinocchio.SE3(np.eye(3), np.array([row.a, 0.0, 0.0]))
        slide_d = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, row.d]))
        turn = pinocchio.SE3(pinocchio.utils.rotate("z", row.theta), np.zeros(3))
        if robot.convention == "standard":
            placement, link = before * turn, slide_d * slide_a * twist
        else:
            placement, link = before * twist * slide_a * slide_d * turn, pinocchio.SE3.Identity()
        parent = model.addJoint(parent, about, placement, row.name)
        model.appendBodyToJoint(parent, _dh_body(row), link)
        model.addFrame(pinocchio.Frame(joint.link_name, parent, 0, link, pinocchio.FrameType.BODY))
        before = link
    gravity = loaded.options.gravity
    model.gravity.linear = np.array(robot.gravity if gravity is None else gravity)
    return model


def _dh_body(row: DhJoint) -> pinocchio.Inertia:
    """The row's body about its link frame; one with zeros or unknowns is set from the chain later."""
    link = row.link
    if link.mass == 0.0 or not math.isfinite(link.mass + sum(link.com) + sum(link.inertia_com)):
        return pinocchio.Inertia.Zero()
    com = np.array(link.com)
    xx, xy, yy, xz, yz, zz = link.inertia_com
    about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about_frame = about_com + link.mass * (com @ com * np.eye(3) - np.outer(com, com))
    six = about_frame[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return body_of(np.array([link.mass, *(link.mass * com), *six]))


def body_of(parameters: Array) -> pinocchio.Inertia:
    """Pinocchio's body with ten standard parameters, physical or not.

    Pinocchio divides by the mass: without any, the smallest one stands in, and first moments cannot be had.
    """
    if not parameters[:DRIVE].any():
        return pinocchio.Inertia.Zero()
    if parameters[0] == 0.0 and parameters[1:4].any():
        raise ValueError("Pinocchio has no body with a first moment but no mass")
    mass = parameters[0] or float(np.finfo(float).tiny)
    return pinocchio.Inertia.FromDynamicParameters(np.array([mass, *parameters[1:DRIVE]]))


def _set_bodies(model: pinocchio.Model, chain: Chain, parameters: Array, which: list[int]) -> None:
    """Give the joints `which` bodies by their standard parameters (n, 11) about the link frames."""
    for k in which:
        link = model.frames[model.getFrameId(chain.joints[k].link_name, pinocchio.FrameType.BODY)]
        model.inertias[k + 1] = link.placement.act(body_of(parameters[k]))


def _assumed(chain: Chain) -> list[int]:
    """Joints whose bodies have zeros that the span, not the source, knows of; and those with unknowns."""
    span = chain.parameter_span.reshape(len(chain), PARAMETERS_PER_LINK, -1)[:, :DRIVE]
    return [
        k
        for k, values in enumerate(chain.parameters)
        if np.isnan(values).any() or np.linalg.matrix_rank(span[k]) < DRIVE
    ]


def _placed_as(chain: Chain, model: pinocchio.Model) -> pinocchio.Model:
    """The model's bodies on joints that sit as the chain's do, about their z."""
    placed = pinocchio.Model()
    placed.name = model.name
    for k, joint in enumerate(chain.joints):
        about = pinocchio.JointModelRZ() if joint.kind == "revolute" else pinocchio.JointModelPZ()
        placed.addJoint(k, about, _se3(joint.placement), joint.name)
        own = model.frames[model.getFrameId(joint.link_name, pinocchio.FrameType.BODY)].placement
        place = _se3(joint.link_frame)
        placed.inertias[k + 1] = (place * own.inverse()).act(model.inertias[k + 1])
        placed.addFrame(pinocchio.Frame(joint.link_name, k + 1, 0, place, pinocchio.FrameType.BODY))
    tip = pinocchio.Frame(chain.tip_name, len(chain), 0, _se3(chain.tip), pinocchio.FrameType.OP_FRAME)
    if not placed.existFrame(chain.tip_name):
        placed.addFrame(tip)
    placed.gravity.linear = np.array(chain.gravity)
    placed.armature = model.armature.copy()
    return placed


def _se3(placement: Placement) -> pinocchio.SE3:
    return pinocchio.SE3(np.array(placement.rotation), np.array(placement.translation))
