"""The robot's metadata in the generated package, and the options that a user can choose: everything except the
arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from psdmc.friction.joints import Friction
from psdmc.model.bodies import load_map, refuse_outside
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.equations import BaseParameter
from psdmc.model.linear_friction import linear_friction
from psdmc.program.signature import Sizes
from psdmc.robot.coordinates import units_of
from psdmc.robot.inertia import six_of
from psdmc.robot.mechanism import BASE_FRAME, BODY_PARAMETERS, PARAMETERS_PER_LINK, POINT, Array, Mechanism
from psdmc.target.presets import NATIVE
from psdmc.target.target import LANE_BLOCK_BYTES, Real, Target, Trig
from psdmc.version import psdmc_version


@dataclass(frozen=True, slots=True)
class EmitOptions:
    """The options with which a package is generated.

    real    precision of the whole package
    trig    code of sine and cosine. 'inline': code without branches for SIMD vectors, and the C library for very large
            angles; 'freestanding': no C library, very large angles give NaN; 'libm': the C library only
    target  the target machine; some targets have their own defaults of `real` and `trig`
    """

    real: Real = "float64"
    trig: Trig = "inline"
    target: Target = NATIVE

    @property
    def lanes(self) -> int:
        """Return how many states a block of the batch layout [block][entry][lane] holds, equal for all machines."""
        return LANE_BLOCK_BYTES // self.real_bytes

    @property
    def real_bytes(self) -> int:
        return 8 if self.real == "float64" else 4


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
    mimic_joints sentences about mimic joints, untrusted text; mimic joints are not among `joints`
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
    payload: tuple[Array, ...] = ()
    mimic_joints: tuple[str, ...] = ()
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
        mimic_joints=tuple(_mimic_sentences(chain)),
        units=units_of(chain.joints[i].type for i in chain.own_joints),
        friction=linear_friction(model) if friction else None,
        in_dynamics=in_dynamics,
        bodies=bodies_map(model) if bodies else None,
        q_names=chain.q_names,
        v_names=chain.v_names,
        base_frame=chain.base_frame,
    )


def _mimic_sentences(chain: Mechanism) -> Iterator[str]:
    for joint, coordinate in zip(chain.joints, chain.coordinates, strict=True):
        if coordinate.leader is not None and chain.joints[coordinate.leader] is not joint:
            names = [chain.joints[leader].name for leader, _ in coordinate.shares]
            terms = (f"{ratio:g} q_{chain.joints[leader].name} + " for leader, ratio in coordinate.shares)
            yield f"{joint.name} follows {' and '.join(names)}: q = {''.join(terms)}{coordinate.offset:g}"


def _load_maps(model: DynamicsModel) -> tuple[Array, ...]:
    chain = model.mechanism
    is_tip_alone = [frame.name for frame in chain.frames] == [chain.tip_name]
    frames = (chain.tip_frame,) if is_tip_alone else (chain.tip_frame, *chain.frames)
    return tuple(load_map(chain, model.B, frame) for frame in frames)


# Base parameters from the masses and inertias of all bodies


EXAMPLE_MASS = 1.25
EXAMPLE_COM = np.array([0.0625, -0.03125, 0.125])
EXAMPLE_INERTIA = np.array([[0.03, 0.003, -0.002], [0.003, 0.04, 0.001], [-0.002, 0.001, 0.035]])
"""kg, m, kg m^2 about the centre of mass of the self-test's first body; the next ones are heavier and longer."""


@dataclass(frozen=True, slots=True, eq=False)
class BodiesMap:
    """The linear map theta_b = constant + columns @ p. theta_b are the l base parameters. p (10 n,) are the ten
    standard parameters (mass, first moments, inertia) of each of the n bodies.

    links     n names of bodies, untrusted text
    columns   (l, 10 n) factors of p
    constant  (l,) the part of theta_b that comes from drive inertias (motors and gears)
    masses    (n,) kg, of the example robot in the self-test
    coms      (n, 3) m, centres of mass of the example robot
    inertias  (n, 6) kg m^2, of the example robot
    theta_b   (l,) expected result for the example robot
    """

    links: tuple[str, ...]
    columns: Array
    constant: Array
    masses: Array
    coms: Array
    inertias: Array
    theta_b: Array


def bodies_map(model: DynamicsModel) -> BodiesMap:
    """Return the linear map from the parameters of all bodies to theta_b (the base parameters) for one model.

    Raises InputError if the model was derived under an assumption that excludes some bodies, such as a link without
    mass. Also raises InputError if a drive inertia is unknown.
    """
    n = model.n
    each = [np.tile(row, n) for row in np.eye(PARAMETERS_PER_LINK)[:BODY_PARAMETERS]]
    refuse_outside(model.mechanism, each, f"{model.mechanism.name}: theta_from_bodies takes bodies whose")
    sizes = 1.0 + np.arange(n) / 8.0
    masses, coms = EXAMPLE_MASS * sizes, np.outer(sizes, EXAMPLE_COM)
    inertias = sizes[:, None, None] ** 2 * EXAMPLE_INERTIA
    B = model.B.reshape(model.l, n, PARAMETERS_PER_LINK)
    still = np.zeros((n, 3))
    return BodiesMap(
        links=model.link_names,
        columns=B[:, :, :BODY_PARAMETERS].reshape(model.l, -1),
        constant=model.theta_for(np.zeros(n), still, np.zeros((n, 3, 3))),
        masses=masses,
        coms=coms,
        inertias=np.array([six_of(matrix) for matrix in inertias]),
        theta_b=model.theta_for(masses, coms, inertias),
    )
