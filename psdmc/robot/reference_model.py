"""Builds Pinocchio's model of a robot from the robot's own file. psdmc compares its results with this model.

The model shares as little code as possible with psdmc's own reader. Pinocchio reads a URDF, merges its links and locks
its joints; `dh_model` reads a DH table. Only the names of joints, links, base and tip come from psdmc's mechanism.

For a robot with snapped rotations, the placements of the joints also come from the mechanism, because the file does not
have them.

The model has one coordinate per joint (a continuous joint is an angle) and the joints in the order of the mechanism.
The root frame of the model (Pinocchio's universe) is the base, and there is a frame for the tip. All Pinocchio
functions take plain arrays q, qd, qdd (n,).
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio

from psdmc.errors import InputError
from psdmc.robot.load import LoadedRobot
from psdmc.robot.load_options import TOOL
from psdmc.robot.mechanism import (
    DRIVE,
    PARAMETERS_PER_LINK,
    Array,
    Loop,
    Mechanism,
    Placement,
    frozen_array,
)
from psdmc.robot.urdf.dependent_joints import held_positions
from psdmc.robot.urdf.pinocchio_text import JOINT_PREFIX, locked_at, pinocchio_model, reduced
from psdmc.robot.urdf.read_urdf import read_urdf


def reference_model(
    loaded: LoadedRobot, *, snapped: bool = True, parameters: Array | None = None
) -> pinocchio.Model:
    """Return Pinocchio's model of the robot.

    snapped      True: joints are placed as in the mechanism; False: as in the file, rounding included
    parameters   (n, 11) standard parameters about the link frames that replace those of the file

    Bodies with parameters assumed zero (option assume_zero) get the mechanism's values, because the file does not have
    them. Raises ValueError if parameters are needed and unknown.
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
    for k in replaced:
        link = model.frames[model.getFrameId(chain.joints[k].link_name, pinocchio.FrameType.BODY)]
        model.inertias[k + 1] = link.placement.act(body_of(values[k]))
    model.armature = np.repeat(values[:, DRIVE], [kind.nv for kind in chain.types])
    return _placed_as(chain, model) if snapped else model


def frame_number(model: pinocchio.Model, name: str) -> int:
    """Return the number of the frame of a link, or of a named frame. Pinocchio's own first frame is called "universe", as a
    link may be called, too."""
    kinds = (pinocchio.FrameType.BODY, pinocchio.FrameType.OP_FRAME)
    own = [k for k, frame in enumerate(model.frames) if frame.name == name and frame.type in kinds]
    return own[-1] if own else int(model.getFrameId(name))


def as_written(loaded: LoadedRobot) -> pinocchio.Model:
    """Return the model that Pinocchio makes from the robot file alone, without psdmc's assumptions. psdmc only chooses
    the joints and names them. Links without inertia in the file have none in the model."""
    is_urdf = loaded.source_format == "urdf"
    model = _urdf_model(loaded) if is_urdf else dh_model(loaded.source_text, loaded.options.gravity)
    if loaded.options.tool is not None:
        # The tool frame in the tip's, by Pinocchio's own reading of the angles.
        tool = loaded.options.tool
        number = frame_number(model, loaded.mechanism.tip_name)
        place = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*tool[3:]), np.array(tool[:3]))
        above = model.frames[number]
        kind = pinocchio.FrameType.OP_FRAME
        model.addFrame(pinocchio.Frame(TOOL, above.parentJoint, number, above.placement * place, kind))
    own = () if is_urdf else tomllib.loads(loaded.source_text).get("loop", ())
    tables = enumerate((*own, *loaded.options.loops), start=1)
    named = {table.get("name", f"loop{number}"): table for number, table in tables}
    for loop in loaded.mechanism.loops:
        for name, key in zip(loop_frames(loop), ("first", "second"), strict=True):
            _add_loop_frame(model, name, named[loop.name][key], loaded.mechanism.base_name)
    return model


def _add_loop_frame(model: pinocchio.Model, name: str, given: Any, base_name: str) -> None:
    """Add a frame of a loop, given by a link and by a placement in it, as a table [[loop]] has it."""
    table = {"link": given} if isinstance(given, str) else given
    turn = pinocchio.rpy.rpyToMatrix(*(_radians(each) for each in table.get("rpy", (0.0, 0.0, 0.0))))
    if "quaternion" in table:
        turn = pinocchio.Quaternion(np.array(table["quaternion"], float)).normalized().toRotationMatrix()
    place = pinocchio.SE3(turn, np.array(table.get("xyz", (0.0, 0.0, 0.0)), float))
    number = frame_number(model, table["link"]) if model.existFrame(table["link"]) else 0
    above, kind = model.frames[number], pinocchio.FrameType.OP_FRAME
    if above.parentJoint == 0 and model.existFrame(base_name):
        place = model.frames[frame_number(model, base_name)].placement.inverse() * above.placement * place
    else:
        place = above.placement * place
    model.addFrame(pinocchio.Frame(name, above.parentJoint, number, place, kind))


def _urdf_model(loaded: LoadedRobot) -> pinocchio.Model:
    """The file as Pinocchio reads it, all but the chain's joints locked at neutral, seen from the base."""
    chain = loaded.mechanism
    free = chain.joint_names[0] if loaded.options.floating else None
    whole = pinocchio_model(loaded.source_text, loaded.source_name, root_joint=free)
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
    """Return Pinocchio's inertia object with the given ten standard parameters, which need not be physically possible.

    Pinocchio divides by the mass. A body without mass gets the smallest possible mass, and the first moments of the
    body are lost.
    """
    if not parameters[:DRIVE].any():
        return pinocchio.Inertia.Zero()
    if parameters[0] == 0.0 and parameters[1:4].any():
        raise ValueError("Pinocchio has no body with a first moment but no mass")
    mass = parameters[0] or float(np.finfo(float).tiny)
    return pinocchio.Inertia.FromDynamicParameters(np.array([mass, *parameters[1:DRIVE]]))


def has_assumptions(loaded: LoadedRobot) -> bool:
    """Return whether some parameters are assumed zero or unknown, and not determined by the file."""
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
    for loop in chain.loops:
        for name, end in zip(loop_frames(loop), (loop.first, loop.second), strict=True):
            place, kind, above = _se3(end.placement), pinocchio.FrameType.OP_FRAME, numbers[end.joint + 1]
            placed.addFrame(pinocchio.Frame(name, end.joint + 1, above, place, kind))
    placed.gravity.linear = np.array(chain.gravity)
    placed.armature = model.armature.copy()
    return placed


def loop_frames(loop: Loop) -> tuple[str, str]:
    """Return the names that both frames of a closed loop have in Pinocchio's model."""
    return f"loop {loop.name}: first", f"loop {loop.name}: second"


def _se3(placement: Placement) -> pinocchio.SE3:
    return pinocchio.SE3(np.array(placement.rotation), np.array(placement.translation))


# Standard (Denavit, Hartenberg 1955; Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, eq. 3.10) and modified
# (Craig, Introduction to Robotics, eq. 3.6). The joint variable is added to theta, or to d; either leaves a rotation
# about z (a displacement along z) that commutes to the outer end of a standard row and to the inner end of a modified
# one, where Pinocchio's joint is.
MODELS = {"revolute": pinocchio.JointModelRZ, "prismatic": pinocchio.JointModelPZ}
"""Pinocchio's joints by a row's type. Written here again, because this reader shares nothing with the other."""


def dh_model(text: str, gravity: Sequence[float] | None) -> pinocchio.Model:
    """Return Pinocchio's model of a DH table that read_dh has accepted. The links of the model are called link1, link2
    and so on. A body with unknown numbers gets zeros.

    gravity   m/s^2 in the base frame, replaces that of the table
    """
    table = tomllib.loads(text)
    is_modified = table.get("convention", "standard") == "modified"
    model = pinocchio.Model()
    model.name = str(table.get("name", "robot"))
    ends = {"base": (pinocchio.SE3.Identity(), 0, 0)}
    last = "base"
    for number, row in enumerate(table["joint"], start=1):
        before, parent, frame = ends[row.get("parent", last)]
        kind = MODELS[row.get("type", "revolute")]()
        theta, alpha = _radians(row.get("theta", 0.0)), _radians(row.get("alpha", 0.0))
        d, a = float(row.get("d", 0.0)), float(row.get("a", 0.0))
        whole = pinocchio.SE3((modified_matrix if is_modified else standard_matrix)(theta, d, a, alpha))
        place, link = (before * whole, pinocchio.SE3.Identity()) if is_modified else (before, whole)
        last = row.get("name", f"joint{number}")
        parent = model.addJoint(parent, kind, place, last)
        model.appendBodyToJoint(parent, _body(row.get("link", {})), link)
        frame = model.addFrame(
            pinocchio.Frame(f"link{number}", parent, frame, link, pinocchio.FrameType.BODY)
        )
        ends[last] = link, parent, frame
    model.gravity.linear = np.array(
        table.get("gravity", (0.0, 0.0, -9.81)) if gravity is None else gravity, float
    )
    return model


def standard_matrix(theta: float, d: float, a: float, alpha: float) -> Array:
    """Return the transform (4, 4) Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha) of a standard DH row."""
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def modified_matrix(theta: float, d: float, a: float, alpha: float) -> Array:
    """Return the transform (4, 4) Rot(x, alpha) Trans(x, a) Rot(z, theta) Trans(z, d) of a modified DH row."""
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [ct, -st, 0.0, a],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _radians(value: float | str) -> float:
    if not isinstance(value, str):
        return float(value)
    text = value.strip()
    return float(text[:-3]) * (math.pi / 180.0 if text.endswith("deg") else 1.0)


def _body(link: Mapping[str, Any]) -> pinocchio.Inertia:
    """The row's body in its link's frame; zero where something is left out."""
    six = link.get("inertia_com", {})
    if not {"mass", "com"} <= set(link) or len(six) < 6:
        return pinocchio.Inertia.Zero()
    com, mass = np.array(link["com"], float), float(link["mass"])
    xx, xy, yy, xz, yz, zz = (float(six[name]) for name in ("xx", "xy", "yy", "xz", "yz", "zz"))
    about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about_frame = about_com + mass * (com @ com * np.eye(3) - np.outer(com, com))
    entries = about_frame[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    # Pinocchio divides by the mass: a body without any gets the smallest one.
    divisor = mass or float(np.finfo(float).tiny)
    return pinocchio.Inertia.FromDynamicParameters(np.array([divisor, *(mass * com), *entries]))
