"""The robot's metadata in the generated package: everything except the arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from psdmc.backends.bodies import BodiesMap, bodies_map
from psdmc.friction.joints import Friction
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.equations import BaseParameter
from psdmc.model.linear_friction import linear_friction
from psdmc.model.payload import load_map
from psdmc.program.signature import Sizes
from psdmc.robot.mechanism import BASE_FRAME, POINT, Mechanism
from psdmc.robot.unit_lengths import units_of
from psdmc.version import psdmc_version


@dataclass(frozen=True, slots=True)
class JointInfo:
    """A joint's name, type, units and limits. Unknown limits are infinite.

    nq           number of its entries in q
    nv           number of its entries in qd
    coordinates  names of the entries in q if there are several
    parent       link to which the joint is attached, untrusted text; empty in a serial chain
    """

    name: str
    kind: str
    lower: float = -math.inf
    upper: float = math.inf
    speed: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf
    unit: str = "rad"
    effort_unit: str = "N m"
    nq: int = 1
    nv: int = 1
    coordinates: str = ""
    parent: str = ""


@dataclass(frozen=True, slots=True)
class PackageInfo:
    """The metadata of one robot for the C header, manifest.json and README.

    name        the robot's own name, untrusted text
    joints      n joints, from base to tip; in a tree, parents before their children
    gravity     m/s^2 in the base frame
    base, tip   names of links
    parameters  l base parameters, in the order of theta_b
    model_hash  content hash of the model file
    options     options that the user chose, as printed in header and manifest
    frames      names of the named frames, untrusted text; empty: the tip alone
    contacts    names of the frames that can touch the world, each with the number of its rows in the contact Jacobian;
                empty: all frames, as points
    loops       names of the closed loops, untrusted text, each with the rows that it closes
    payload     (l, 10) maps from the ten parameters of a load to the change of the l base parameters: for a load at the
                tip, then at each named frame. Empty if the package has no function that adds loads
    units       index ranges (start, end) of q whose length must be one (quaternions)
    bodies      map from the parameters of all bodies to theta_b; None if the package has no function for the map
    friction    joint friction from a calibration with plain logs; None if the package has no function for friction
    in_dynamics  joint friction that motor torques contain; None if they have none
    q_names     names of the nq entries of q, untrusted text
    v_names     names of the nv entries of rates and torques
    base_frame  in words, the frame in which gravity, frames and velocities are given
    followers   sentences about mimic joints, untrusted text; mimic joints are not among `joints`
    """

    name: str
    joints: tuple[JointInfo, ...]
    gravity: tuple[float, float, float]
    base: str
    tip: str
    parameters: tuple[BaseParameter, ...]
    model_hash: str
    psdmc_version: str
    options: Mapping[str, str] = field(default_factory=dict)
    frames: tuple[str, ...] = ()
    contacts: tuple[tuple[str, int], ...] = ()
    loops: tuple[tuple[str, tuple[int, ...]], ...] = ()
    payload: tuple[NDArray[np.float64], ...] = ()
    followers: tuple[str, ...] = ()
    units: tuple[tuple[int, int], ...] = ()
    friction: Friction | None = None
    in_dynamics: Friction | None = None
    bodies: BodiesMap | None = None
    q_names: tuple[str, ...] = ()
    v_names: tuple[str, ...] = ()
    base_frame: str = BASE_FRAME

    def __post_init__(self) -> None:
        if not self.joints:
            raise ValueError("a package needs at least one joint")
        object.__setattr__(self, "frames", self.frames or (self.tip,))
        object.__setattr__(self, "contacts", self.contacts or tuple((name, POINT) for name in self.frames))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def nq(self) -> int:
        """Length of q."""
        return sum(joint.nq for joint in self.joints)

    @property
    def nv(self) -> int:
        """Length of qd, qdd and tau: degrees of freedom."""
        return sum(joint.nv for joint in self.joints)

    @property
    def gravity_input(self) -> bool:
        """Return whether gravity is an input of the functions that depend on it."""
        return "gravity-input" in self.options

    @property
    def is_wide(self) -> bool:
        """Return whether some joint has several coordinates: q, rates and tables of joints then differ in length."""
        return any(joint.nq > 1 for joint in self.joints)

    @property
    def is_tree(self) -> bool:
        """Whether the robot is no serial chain."""
        return any(joint.parent for joint in self.joints)

    @property
    def sizes(self) -> Sizes:
        """Return the lengths of array axes: numbers of joints, entries of q, rates, base parameters, frames and contacts."""
        rows = tuple(rows for _, rows in self.contacts)
        closed = tuple(rows for _, rows in self.loops)
        return Sizes(self.n, self.nq, self.nv, self.l, len(self.frames), 0, rows, closed)

    @property
    def l(self) -> int:  # noqa: E743
        """Number of base parameters."""
        return len(self.parameters)


def package_info(
    model: DynamicsModel,
    name: str | None = None,
    options: Mapping[str, str] | None = None,
    payload: bool = False,
    friction: bool = False,
    bodies: bool = False,
    in_dynamics: Friction | None = None,
) -> PackageInfo:
    """Return the metadata of a model for a package. `name` replaces the name of the robot. The options `payload`,
    `friction` and `bodies` add the data for further functions: adding loads, friction, and base parameters from bodies.
    `in_dynamics` is the friction that motor torques contain, if any.

    Raises InputError if the model was derived under an assumption that excludes some loads or bodies. Also raises
    InputError if friction is wanted and the model was not calibrated from plain logs.
    """
    chain = model.mechanism
    joints = tuple(
        JointInfo(
            joint.name,
            joint.type.word,
            joint.limits.lower,
            joint.limits.upper,
            joint.limits.speed,
            joint.limits.acceleration,
            joint.limits.effort,
            joint.type.position_unit,
            joint.type.effort_unit,
            joint.type.nq,
            joint.type.nv,
            joint.type.coordinates,
            "" if chain.is_serial else chain.parent_link(i),
        )
        for i, joint in enumerate(chain.joints)
        if i in chain.own_joints
    )
    gx, gy, gz = (float(g) + 0.0 for g in chain.gravity.tolist())
    return PackageInfo(
        name=chain.name if name is None else name,
        joints=joints,
        gravity=(gx, gy, gz),
        base=chain.base_name,
        tip=chain.tip_name,
        parameters=model.base_parameters,
        model_hash=model.content_hash,
        psdmc_version=psdmc_version(),
        options=dict(options or {}),
        frames=tuple(frame.name for frame in chain.frames),
        contacts=tuple((frame.name, frame.rows) for frame in chain.contacts),
        loops=tuple((loop.name, loop.rows) for loop in chain.loops),
        payload=_load_maps(model) if payload else (),
        followers=tuple(_followers(chain)),
        units=units_of(chain.joints[i].type for i in chain.own_joints),
        friction=linear_friction(model) if friction else None,
        in_dynamics=in_dynamics,
        bodies=bodies_map(model) if bodies else None,
        q_names=chain.q_names,
        v_names=chain.v_names,
        base_frame=chain.base_frame,
    )


def _followers(chain: Mechanism) -> Iterator[str]:
    for joint, coordinate in zip(chain.joints, chain.coordinates, strict=True):
        if coordinate.leader is not None and chain.joints[coordinate.leader] is not joint:
            names = [chain.joints[leader].name for leader, _ in coordinate.shares]
            terms = (f"{ratio:g} q_{chain.joints[leader].name} + " for leader, ratio in coordinate.shares)
            yield f"{joint.name} follows {' and '.join(names)}: q = {''.join(terms)}{coordinate.offset:g}"


def _load_maps(model: DynamicsModel) -> tuple[NDArray[np.float64], ...]:
    chain = model.mechanism
    is_tip_alone = [frame.name for frame in chain.frames] == [chain.tip_name]
    frames = (chain.tip_frame,) if is_tip_alone else (chain.tip_frame, *chain.frames)
    return tuple(load_map(chain, model.B, frame) for frame in frames)
