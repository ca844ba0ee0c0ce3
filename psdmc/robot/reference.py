"""Pinocchio's own reading of a robot's source, as the reference for everything else.

It shares the file's text with the chain and as little code as possible: a URDF is read, merged and locked by Pinocchio,
a DH table is read by dh_textbook. Only names come from the chain: of its joints, links, base and tip. For the snapped
robot the joints' placements come from the chain too, because the file does not have them; the bodies are still
Pinocchio's.

The models have one coordinate per joint (a continuous joint is an angle), the chain's joints in the chain's order, the
chain's base as their universe, and a frame for the tip: they work with any function of Pinocchio and plain q, qd, qdd
(n,).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio

from psdmc.errors import InputError, InternalError
from psdmc.robot.dh_textbook import dh_model
from psdmc.robot.joints import REVOLUTE, WIDE_TYPES, JointType
from psdmc.robot.load import LoadedRobot
from psdmc.robot.lock import held_positions
from psdmc.robot.mechanism import DRIVE, PARAMETERS_PER_LINK, Array, Mechanism, Placement, frozen_array
from psdmc.robot.pinocchio_text import JOINT_PREFIX, locked_at, pinocchio_model, reduced
from psdmc.robot.tool import TOOL
from psdmc.robot.urdf import read_urdf
from psdmc.robot.urdf_floating import ROOT_JOINT

CENTRAL = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Weights of a central difference of eighth order."""

DIFFERENCE = 0.02
"""rad or m: its step. The ninth derivative leaves 1e-16, rounding 1e-14."""


def reference_model(
    loaded: LoadedRobot, *, snapped: bool = True, parameters: Array | None = None
) -> pinocchio.Model:
    """Pinocchio's model of the robot.

    snapped      joints placed as the chain's are; False: as in the file, rounding included
    parameters   (n, 11) standard parameters about the link frames instead of the source's own

    Bodies with parameters assumed zero get the chain's values, which the source does not have. ValueError where
    parameters are needed and unknown.
    """
    chain = loaded.mechanism
    model = as_written(loaded)
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
    model.armature = np.repeat(values[:, DRIVE], [kind.nv for kind in chain.types])
    return _placed_as(chain, model) if snapped else model


def as_written(loaded: LoadedRobot) -> pinocchio.Model:
    """Pinocchio's own model of the file, with nothing of the chain but names; bodies as far as the file gives them."""
    is_urdf = loaded.source_format == "urdf"
    model = _urdf_model(loaded) if is_urdf else dh_model(loaded.source_text, loaded.options.gravity)
    if loaded.options.tool is not None:
        _add_tool(model, loaded.mechanism.tip_name, loaded.options.tool)
    return model


def _add_tool(model: pinocchio.Model, tip: str, tool: tuple[float, ...]) -> None:
    """The tool frame in the tip's, by Pinocchio's own reading of the angles."""
    number = model.getFrameId(tip)
    place = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*tool[3:]), np.array(tool[:3]))
    above = model.frames[number]
    kind = pinocchio.FrameType.OP_FRAME
    model.addFrame(pinocchio.Frame(TOOL, above.parentJoint, number, above.placement * place, kind))


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Pinocchio's dynamics of one model on arrays of states: q, qd, qdd, tau (..., n), SI.

    tip_name     the frame of `jacobian`
    frame_names  the named frames; empty: the tip alone
    """

    model: pinocchio.Model
    tip_name: str
    frame_names: tuple[str, ...] = ()

    @property
    def frame_ids(self) -> list[int]:
        """Pinocchio's numbers of the named frames."""
        return [self.model.getFrameId(name) for name in self.frame_names or (self.tip_name,)]

    @property
    def joint_types(self) -> list[JointType]:
        """Of the joints in Pinocchio's order; all of one coordinate are called revolute."""
        known = {f"JointModel{kind.pinocchio}": kind for kind in WIDE_TYPES.values()}
        return [known.get(joint.shortname(), REVOLUTE) for joint in list(self.model.joints)[1:]]

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array) -> Array:
        return self.each(pinocchio.rnea, q, qd, qdd)

    def forward_dynamics(self, q: Array, qd: Array, tau: Array) -> Array:
        return self.each(pinocchio.aba, q, qd, tau)

    def mass_matrix(self, q: Array) -> Array:
        """(..., n, n), both triangles."""
        upper = np.triu(self.each(pinocchio.crba, q))
        return upper + np.swapaxes(np.triu(upper, 1), -1, -2)

    def nonlinear_effects(self, q: Array, qd: Array) -> Array:
        return self.each(pinocchio.nonLinearEffects, q, qd)

    def gravity(self, q: Array) -> Array:
        return self.each(pinocchio.computeGeneralizedGravity, q)

    def coriolis_matrix(self, q: Array, qd: Array) -> Array:
        """(..., n, n)"""
        return self.each(pinocchio.computeCoriolisMatrix, q, qd)

    def inverse_dynamics_derivatives(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
        """(..., n, n) each: derivatives of the torques by q, qd and qdd; row i: of tau[i]."""

        def derivatives(model: pinocchio.Model, data: pinocchio.Data, *state: Array) -> Array:
            by_q, by_qd, by_qdd = pinocchio.computeRNEADerivatives(model, data, *state)
            return np.stack([by_q, by_qd, np.triu(by_qdd) + np.triu(by_qdd, 1).T])

        by_q, by_qd, by_qdd = np.moveaxis(self.each(derivatives, q, qd, qdd), -3, 0)
        return by_q, by_qd, by_qdd

    def forward_dynamics_derivatives(
        self, q: Array, qd: Array, tau: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Accelerations (..., n), and (..., n, n) each: their derivatives by q, qd and tau; row i: of qdd[i]."""

        def derivatives(model: pinocchio.Model, data: pinocchio.Data, *state: Array) -> Array:
            by_q, by_qd, by_tau = pinocchio.computeABADerivatives(model, data, *state)
            return np.stack([by_q, by_qd, np.triu(by_tau) + np.triu(by_tau, 1).T])

        by_q, by_qd, by_tau = np.moveaxis(self.each(derivatives, q, qd, tau), -3, 0)
        return self.forward_dynamics(q, qd, tau), by_q, by_qd, by_tau

    def integrated(self, q: Array, way: Array) -> Array:
        """(..., nq) positions where constant rates lead from q; `way` are these times seconds."""

        def moved(model: pinocchio.Model, data: pinocchio.Data, *state: Array) -> Array:
            return np.asarray(pinocchio.integrate(model, *state))

        return self.each(moved, q, way)

    def integrated_slopes(self, q: Array, way: Array) -> tuple[Array, Array]:
        """(..., nv, nv) each: how `integrated` moves along its tangent with q, and with the way."""

        def slopes(model: pinocchio.Model, data: pinocchio.Data, *state: Array) -> Array:
            return np.array(
                [pinocchio.dIntegrate(model, *state, which) for which in (pinocchio.ARG0, pinocchio.ARG1)]
            )

        by_start, by_way = np.moveaxis(self.each(slopes, q, way), -3, 0)
        return by_start, by_way

    def coordinate_rates(self, q: Array, qd: Array) -> Array:
        """(..., nq) how the coordinates change at these rates: the central difference of eighth order of `integrate`, which
        is wrong by 1e-12 of the rates."""
        step = DIFFERENCE / max(1.0, float(np.abs(qd).max()))
        total = np.zeros_like(q)
        for k, weight in enumerate(CENTRAL, start=1):
            total += weight * (self.integrated(q, k * step * qd) - self.integrated(q, -k * step * qd))
        return total / step

    def restored(self, q: Array) -> Array:
        """(..., nq) with quaternions of length one."""

        def unit(model: pinocchio.Model, data: pinocchio.Data, q: Array) -> Array:
            return np.asarray(pinocchio.normalize(model, q))

        return self.each(unit, q)

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

        return self.each(of_tip, q)

    def poses(self, q: Array, link_names: Sequence[str]) -> Array:
        """(..., len(link_names) + 1, 4, 4) of the links' frames and the tip's in the base frame."""
        kind = pinocchio.FrameType.BODY
        frames = [self.model.getFrameId(name, kind) for name in link_names]
        frames.append(self.model.getFrameId(self.tip_name))

        def of_links(model: pinocchio.Model, data: pinocchio.Data, q: Array) -> Array:
            pinocchio.framesForwardKinematics(model, data, q)
            return np.array([data.oMf[frame].homogeneous for frame in frames])

        return self.each(of_links, q)

    @property
    def gravity_vector(self) -> Array:
        """(3,) m/s^2 in the base frame."""
        return np.array(self.model.gravity.linear)

    @property
    def path_length(self) -> float:
        """Longest way from the base to the tip, or to an end of a tree, over every frame between, m, at neutral; with every
        fixed joint's detour."""
        model, data = self.model, self.model.createData()
        pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
        parents = list(model.parents)
        ends = [k for k in range(1, model.njoints) if k not in parents]
        at_ends = [f for f, frame in enumerate(model.frames) if frame.parentJoint in ends]
        tip = model.getFrameId(self.tip_name)
        return max(_way_to(frame, model, data) for frame in ([tip] if len(ends) == 1 else [tip, *at_ends]))

    def each(self, function: Callable[..., Array], *states: Array) -> Array:
        """Values of a function of Pinocchio's (model, data, state ...) at every state of broadcast arrays."""
        data = self.model.createData()
        rows = [np.asarray(state, dtype=float) for state in states]
        lead = np.broadcast_shapes(*(row.shape[:-1] for row in rows))
        flat = [np.broadcast_to(row, (*lead, row.shape[-1])).reshape(-1, row.shape[-1]) for row in rows]
        results = [np.array(function(self.model, data, *row)) for row in zip(*flat, strict=True)]
        return np.array(results).reshape(*lead, *results[0].shape)


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
    """The Reference of reference_model."""
    model = reference_model(loaded, snapped=snapped, parameters=parameters)
    names = tuple(frame.name for frame in loaded.mechanism.frames)
    return Reference(model, loaded.mechanism.tip_name, names)


def _urdf_model(loaded: LoadedRobot) -> pinocchio.Model:
    """The file as Pinocchio reads it, all but the chain's joints locked at neutral, seen from the base."""
    chain = loaded.mechanism
    free = ROOT_JOINT if loaded.options.floating else None
    whole = pinocchio_model(loaded.source_text, loaded.source_name, free_root=free)
    held = held_positions(
        read_urdf(loaded.source_text, loaded.source_name), loaded.options.lock, loaded.source_name
    )
    whole = locked_at(whole, held)
    wanted = [JOINT_PREFIX + name for name in chain.joint_names]
    others = [k for k in range(1, whole.njoints) if whole.names[k] not in wanted]
    model = reduced(whole, others, pinocchio.neutral(whole)) if others else whole
    if list(model.names)[1:] != wanted:
        raise InputError(
            f"{loaded.source_name}: Pinocchio finds joints {list(model.names)[1:]}",
            "give the joints names that differ from those of the links",
        )
    for k, name in enumerate(chain.joint_names, start=1):
        model.names[k] = name
    root_gravity = loaded.options.gravity
    if root_gravity is not None:
        model.gravity.linear = np.array(root_gravity)
    if free is not None:
        return model
    base = model.frames[model.getFrameId(chain.base_name, pinocchio.FrameType.BODY)].placement
    for k in range(1, model.njoints):
        if model.parents[k] == 0:
            model.jointPlacements[k] = base.inverse() * model.jointPlacements[k]
    model.gravity.linear = base.rotation.T @ model.gravity.linear
    return model


def body_of(parameters: Array) -> pinocchio.Inertia:
    """Pinocchio's body with ten standard parameters, physical or not.

    Pinocchio divides by the mass. A body without mass gets the smallest one, and loses its first moments.
    """
    if not parameters[:DRIVE].any():
        return pinocchio.Inertia.Zero()
    if parameters[0] == 0.0 and parameters[1:4].any():
        raise ValueError("Pinocchio has no body with a first moment but no mass")
    mass = parameters[0] or float(np.finfo(float).tiny)
    return pinocchio.Inertia.FromDynamicParameters(np.array([mass, *parameters[1:DRIVE]]))


def _set_bodies(model: pinocchio.Model, chain: Mechanism, parameters: Array, which: list[int]) -> None:
    """Give the joints `which` bodies by their standard parameters (n, 11) about the link frames."""
    for k in which:
        link = model.frames[model.getFrameId(chain.joints[k].link_name, pinocchio.FrameType.BODY)]
        model.inertias[k + 1] = link.placement.act(body_of(parameters[k]))


def pinocchio_version() -> str:
    return str(pinocchio.__version__)


def has_assumptions(loaded: LoadedRobot) -> bool:
    """Whether some bodies are not determined by the file alone: assumed zeros and unknown values."""
    return bool(_assumed(loaded.mechanism))


def _assumed(chain: Mechanism) -> list[int]:
    """Joints whose bodies have zeros that only the span has; and joints whose bodies have unknown values."""
    span = chain.parameter_span.reshape(len(chain), PARAMETERS_PER_LINK, -1)[:, :DRIVE]
    return [
        k
        for k, values in enumerate(chain.parameters)
        if np.isnan(values).any() or np.linalg.matrix_rank(span[k]) < DRIVE
    ]


def _placed_as(chain: Mechanism, model: pinocchio.Model) -> pinocchio.Model:
    """The model's bodies on joints that are placed as the chain's are, about their z."""
    placed = pinocchio.Model()
    placed.name = model.name
    numbers = [0]
    for k, (joint, parent) in enumerate(zip(chain.joints, chain.parents, strict=True)):
        about = getattr(pinocchio, f"JointModel{joint.type.pinocchio}")()
        placed.addJoint(parent + 1, about, _se3(joint.placement), joint.name)
        own = model.frames[model.getFrameId(joint.link_name, pinocchio.FrameType.BODY)].placement
        place = _se3(joint.link_frame)
        placed.inertias[k + 1] = (place * own.inverse()).act(model.inertias[k + 1])
        kind, above = pinocchio.FrameType.BODY, numbers[parent + 1]
        numbers.append(placed.addFrame(pinocchio.Frame(joint.link_name, k + 1, above, place, kind)))
    for frame in (chain.tip_frame, *chain.frames):
        if not placed.existFrame(frame.name):
            place, kind, above = _se3(frame.placement), pinocchio.FrameType.OP_FRAME, numbers[frame.joint + 1]
            placed.addFrame(pinocchio.Frame(frame.name, frame.joint + 1, above, place, kind))
    placed.gravity.linear = np.array(chain.gravity)
    placed.armature = model.armature.copy()
    return placed


def _se3(placement: Placement) -> pinocchio.SE3:
    return pinocchio.SE3(np.array(placement.rotation), np.array(placement.translation))
