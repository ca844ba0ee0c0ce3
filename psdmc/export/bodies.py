"""The robot in the form from which URDF and MJCF files are written: links and joints, with frames, inertias and
friction."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.dynamics.parameters import moved
from psdmc.errors import InputError
from psdmc.friction.joints import rows_of
from psdmc.friction.law import Row
from psdmc.friction.laws import LAWS
from psdmc.links.physical_links import PhysicalLinks
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.inertia import about_com, without_noise
from psdmc.robot.limits import joined, naming_faults, shown
from psdmc.robot.mechanism import BASE, BODY_PARAMETERS, DRIVE, Array, Joint, Mechanism, NamedFrame, Placement

WORLD = "world"
"""Link that the base hangs on where gravity does not point along the base's -z."""
ON_AXIS = "_on_axis"
"""Ending of the name of a link whose own frame, off its joint's axis, keeps the plain name."""
ALONG = 1e-12
"""Share of gravity's length beside its axis that is rounding."""
ORDINARY_SPEED = 1.0
"""rad/s (m/s) up to which friction is made a line where the joint has no speed limit."""


@dataclass(frozen=True, slots=True)
class JointFriction:
    """Friction of one joint as two numbers, neither negative. `constant` is a torque against the motion, N m (N for a
    sliding joint), and `damping` is N m s/rad (N s/m for a sliding joint).

    lost  in words, which parts of the calibrated friction the two numbers cannot express
    """

    constant: float
    damping: float
    lost: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One moving link as it is written to a URDF or MJCF file. The origin of the link's frame lies on the joint's axis,
    as URDF requires.

    name      name of the link
    parent    index of the body to which the joint is attached, or BASE
    place     placement of the link's frame in the joint frame
    origin    placement of the link's frame in the parent link's frame (or the base frame) at q = 0
    axis      (3,) direction of the joint's axis, along the axes of the link's frame
    inertial  mass (kg), centre of mass (3,) and inertia about it (6,) (kg m^2, INERTIA_NAMES); None: no mass
    drive     drive inertia, kg m^2; kg for a sliding joint
    mimic     if the joint is a mimic joint, the coordinate that it follows
    """

    joint: Joint
    name: str
    parent: int
    place: Placement
    origin: Placement
    axis: Array
    inertial: tuple[float, Array, Array] | None
    drive: float
    friction: JointFriction | None
    mimic: Coordinate | None


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """A robot in the form in which it is written to a file.

    world    placement of the base in a link WORLD whose z axis points against gravity; None if the z axis of the base
             already does, or if the base floats
    gravity  (3,) m/s^2, along the axes of WORLD or, without WORLD, of the base
    frames   named frames that are fixed to a body: the index of the body, and the frame's placement in the body's link
    """

    name: str
    base: str
    world: Placement | None
    gravity: Array
    bodies: tuple[Body, ...]
    frames: tuple[NamedFrame, ...]


def written(model: DynamicsModel, links: PhysicalLinks, keep_frames: bool) -> Written:
    """Return the robot in the form in which it is written, with the given masses and inertias. Raises InputError if a
    name cannot be written.

    keep_frames  True: links keep their frames, which lie on the joint axes (for models from a URDF). False: a link
                 whose frame is off its axis gets a new frame on the axis, and its old frame is written as a separate
                 link
    """
    chain = model.mechanism
    found = joint_friction(model)
    places = [_place(joint, keep_frames) for joint in chain.joints]
    taken = {chain.base_name, *(joint.link_name for joint in chain.joints), *(f.name for f in _frames(chain))}
    names = [
        joint.link_name if off is None else _free(joint.link_name + ON_AXIS, taken)
        for joint, (_, off) in zip(chain.joints, places, strict=True)
    ]
    bodies = tuple(
        _body(chain, k, names[k], [place for place, _ in places], links.parameters[k], found.get(joint.name))
        for k, joint in enumerate(chain.joints)
    )
    own = [
        NamedFrame(j.link_name, k, o)
        for k, (j, (_, o)) in enumerate(zip(chain.joints, places, strict=True))
        if o
    ]
    named = {frame.name: frame for frame in own}
    for frame in _frames(chain):
        if frame.name not in (*names, *named):
            at = bodies[frame.joint].place.inverse() @ frame.placement
            named[frame.name] = NamedFrame(frame.name, frame.joint, at)
    world = _world(chain.gravity) if chain.types[0].about_z else None
    gravity = chain.gravity if world is None else np.array([0.0, 0.0, -np.linalg.norm(chain.gravity)])
    _require_names(chain, [*names, *named])
    return Written(chain.name, chain.base_name, world, gravity, bodies, tuple(named.values()))


def _frames(chain: Mechanism) -> tuple[NamedFrame, ...]:
    return (chain.tip_frame, *chain.frames)


def _place(joint: Joint, keep: bool) -> tuple[Placement, Placement | None]:
    """Where the link's written frame is in the joint frame, and the file's own link frame in that, where they differ."""
    if keep or not joint.type.about_z or joint.type.turn(1.0) is None:
        return joint.link_frame, None
    if not joint.link_frame.translation[:2].any():
        return joint.link_frame, None
    place = Placement(joint.link_frame.rotation, np.zeros(3))
    return place, place.inverse() @ joint.link_frame


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _body(
    chain: Mechanism,
    k: int,
    name: str,
    places: list[Placement],
    x: Array,
    friction: JointFriction | None,
) -> Body:
    joint, parent = chain.joints[k], chain.parents[k]
    outer = Placement.identity() if parent == BASE else places[parent]
    own = x[:BODY_PARAMETERS]
    if places[k] is not joint.link_frame:
        own = without_noise(moved(own, places[k].inverse() @ joint.link_frame))
    coordinate = chain.coordinates[k]
    return Body(
        joint=joint,
        name=name,
        parent=parent,
        place=places[k],
        origin=outer.inverse() @ joint.placement @ places[k],
        axis=places[k].rotation[2] + 0.0,
        inertial=about_com(own) if own[0] > 0.0 else None,
        drive=float(x[DRIVE]),
        friction=friction,
        mimic=coordinate if coordinate.leader != k else None,
    )


def _world(gravity: Array) -> Placement | None:
    """Where the base sits in a frame with gravity along -z; None: so it is in the base's."""
    size = float(np.linalg.norm(gravity))
    up = -gravity / size if size else np.array([0.0, 0.0, 1.0])
    if np.abs(up - [0.0, 0.0, 1.0]).max() < ALONG:
        return None
    across = np.eye(3)[int(np.argmin(np.abs(up)))]
    x = across - (across @ up) * up
    x /= np.linalg.norm(x)
    return Placement(np.array([x, np.cross(up, x), up]), np.zeros(3))


def _require_names(chain: Mechanism, links: list[str]) -> None:
    """InputError where names do not fit into XML, or are not each other's only one."""
    faults = naming_faults([chain.base_name, *links], "link") + naming_faults(
        list(chain.joint_names), "joint"
    )
    if faults:
        raise InputError(f"{chain.name!r}: {joined(faults)}", "correct the names in the robot's file")


def joint_friction(model: DynamicsModel) -> dict[str, JointFriction]:
    """Return the friction of each calibrated joint, by joint name; empty if the model is not calibrated.

    Each friction law gives the constant torque and the damping that are nearest to it, if it has any.
    """
    calibrated = model.calibrated
    if calibrated is None:
        return {}
    joints = {joint.name: joint for joint in model.mechanism.joints}
    found: dict[str, dict[str, float]] = {}
    for row in calibrated.friction:
        if row.joint in joints and math.isfinite(row.value):
            found.setdefault(row.joint, {})[row.name] = row.value
    law = calibrated.prediction
    word, laws, matrix = ("", LAWS, ()) if law is None else (law.law, law.laws, law.coupling)
    coupled = _coupled(matrix, model.joint_names)
    return {
        name: JointFriction(0.0, 0.0, (COUPLED,))
        if name in coupled
        else _of(rows_of(values, word, laws), joints[name])
        for name, values in found.items()
    }


COUPLED = "friction of motors that drive several joints together"


def _coupled(matrix: Sequence[Sequence[float]], names: Sequence[str]) -> set[str]:
    """Joints that share a motor with another one, of the coupling matrix of the calibration."""
    return {
        names[k]
        for i, row in enumerate(matrix)
        for j, value in enumerate(row)
        if i != j and value
        for k in (i, j)
    }


def _of(rows: Sequence[Row], joint: Joint) -> JointFriction:
    constant, damping, lost = 0.0, 0.0, []
    top = joint.limits.speed if math.isfinite(joint.limits.speed) else ORDINARY_SPEED
    for term, p in rows:
        if term.law.line is None:
            lost += [f"{term.law.about.rstrip('.')} ({term.law.name})"] if any(p) else []
            continue
        own = term.law.line(p, term.number or 0.0, top)
        constant, damping = constant + own[0], damping + own[1]
        if own[2] and any(p):
            lost.append(f"{own[2]} (up to {top:.3g} {joint.type.position_unit}/s a line stands for it)")
    if constant < 0.0 or damping < 0.0:
        lost.append("friction that is negative")
    return JointFriction(max(constant, 0.0), max(damping, 0.0), tuple(lost))


def calibrated_friction_notes(found: Mapping[str, JointFriction]) -> tuple[str, ...]:
    """Return sentences that say which part of the calibrated friction the written files have, and which kinds of friction
    of which joints they cannot hold."""
    if not found:
        return ()
    by_kind: dict[str, list[str]] = {}
    for name, friction in found.items():
        for what in friction.lost:
            by_kind.setdefault(what, []).append(shown(name))
    return (
        f"<dynamics> of {len(found)} joints: the calibration's friction, as a constant and damping",
        *(f"not in the files: {what}: joint {', '.join(names)}" for what, names in by_kind.items()),
    )
