"""The data structure of a robot: a tree of bodies, each attached to its parent by a joint."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate, checked_coordinates, leaders
from psdmc.robot.joints import JointType
from psdmc.robot.limits import shown
from psdmc.robot.load_options import POINT as POINT
from psdmc.robot.load_options import SURFACE as SURFACE
from psdmc.robot.placement import Array as Array
from psdmc.robot.placement import Placement as Placement
from psdmc.robot.placement import frozen_array as frozen_array
from psdmc.robot.placement import made_again as made_again

PARAMETER_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz", "Im")
"""Standard parameters of one link, in the order of x; about the link frame, Im the joint's drive inertia."""

PARAMETERS_PER_LINK = len(PARAMETER_NAMES)
BODY_PARAMETERS = PARAMETERS_PER_LINK - 1
"""Number of standard parameters of one rigid body: all of a link's but the joint's drive inertia."""

DRIVE = BODY_PARAMETERS
"""Place of the drive inertia among a link's standard parameters: behind those of the body."""

BASE = -1
"""Parent of a body that hangs on the base."""

BASE_FRAME = "base frame"
"""The frame of gravity and placements, in words: of a robot whose base does not move."""

FREE_RATES = 6
"""Rates of a joint that lets a body move in every way."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a joint: lower and upper position, speed, acceleration and effort, in SI units (rad or m and their
    rates, N m or N). A limit that the file does not give is infinite."""

    lower: float = -math.inf
    upper: float = math.inf
    speed: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """One movable joint and the link that it moves.

    psdmc defines the joint frame F: the z axis of F is the axis of the joint, and F moves with the link. At q = 0, F
    has the placement `placement` in the joint frame of the parent (or in the base frame). The transform
    F_parent -> F  is  placement @ type.transform(q):  Rz(q) for a rotation, Tz(q) for a translation.
    The link frame is that of the file (URDF child link frame, DH distal frame). `link_frame` is the constant placement
    of the link frame in F.
    """

    name: str
    link_name: str
    type: JointType
    placement: Placement
    link_frame: Placement
    limits: Limits = field(default_factory=Limits)

    @property
    def kind(self) -> str:
        """Name of the joint's type, such as 'revolute'."""
        return self.type.word


@dataclass(frozen=True, slots=True, eq=False)
class NamedFrame:
    """A frame fixed to a link, for which psdmc generates poses, Jacobians and other kinematic functions.

    name       name of a link in the file, or a name from the user: untrusted text
    joint      index of the joint frame with which the named frame moves; 0 is the first
    placement  placement of the named frame in this joint frame
    rows       contact rows: 3 for a point, 6 for a surface, 0 for no contact
    """

    name: str
    joint: int
    placement: Placement
    rows: int = POINT


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """A closed loop: two frames of the spanning tree that the mechanism keeps together along some axes of the first one.

    name           untrusted text
    first, second  the frames; the joint is BASE for a frame on the base
    rows           axes of the first frame along which the frames cannot move apart (0 to 2) or turn (3 to 5), ascending
    passive        joints without motor whose motion follows from that of the others, by number; empty: not declared
    """

    name: str
    first: NamedFrame
    second: NamedFrame
    rows: tuple[int, ...]
    passive: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not self.rows or sorted({*self.rows} & {*range(len(ROW_NAMES))}) != list(self.rows):
            raise ValueError(f"loop {self.name!r} has the rows {self.rows}")


ROW_NAMES = ("x", "y", "z", "rx", "ry", "rz")
"""Rows of contacts and loops: motion along an axis, then about an axis."""


def contact_names(
    contacts: Iterable[tuple[str, int]], loops: Iterable[tuple[str, Sequence[int]]] = ()
) -> dict[str, tuple[str, ...]]:
    """Return names of entries by the word of their axis. These are contacts, their rows (such as 'foot.x'), rows of
    loops, rows of both, and both in the words of messages."""
    own, closed = tuple(contacts), tuple(loops)
    rows = tuple(f"{name}.{axis}" for name, count in own for axis in ROW_NAMES[:count])
    others = tuple(f"{name}.{ROW_NAMES[row]}" for name, places in closed for row in places)
    return {
        "contacts": tuple(name for name, _ in own),
        "contact_rows": rows,
        "loop_rows": others,
        "constraint_rows": rows + others,
        "constraints": (
            *(f"contact {name!r}" for name, _ in own),
            *(f"loop {name!r}" for name, _ in closed),
        ),
    }


@dataclass(frozen=True, slots=True, eq=False)
class Mechanism:
    """A robot with n joints: its kinematics, gravity and what is known of its inertia. Each joint moves one body.

    joints           n, parents before their children; a serial chain's from base to tip
    parameters       (n, 11)   standard parameters x about the link frames (PARAMETER_NAMES), SI; NaN if unknown
    parameter_span   (11 n, k) basis, of k columns, of the parameters that assumptions allow (assume_zero, no drive
                     inertia, links without inertia). The basis is in reduced column echelon form: each column leads
                     with a one, in a row where all other columns are zero
    gravity          (3,)      m/s^2, acceleration of gravity in the base frame
    tip              tip frame in the joint frame of `tip_body`
    notes            what was snapped, merged, locked or assumed, one sentence each, for the command `show`
    parents          n, the parent body of each body: its index, or BASE; left out: the body before
    tip_body         the body that the tip frame is fixed to; left out: the only body without children
    coordinates      n, the coordinate that determines each joint's q; left out: no joint is a mimic joint
    frames           named frames; left out: the tip alone
    massless         moving links without inertia in the file, which psdmc treats as massless: they have no parameters
    loops            closed loops; joints and parents are those of the spanning tree, in which the loops are open
    """

    name: str
    convention: Literal["urdf", "standard", "modified"]
    base_name: str
    tip_name: str
    joints: tuple[Joint, ...]
    parameters: Array
    parameter_span: Array
    gravity: Array
    tip: Placement
    notes: tuple[str, ...] = ()
    parents: tuple[int, ...] = ()
    tip_body: int = BASE
    coordinates: tuple[Coordinate, ...] = ()
    frames: tuple[NamedFrame, ...] = ()
    massless: tuple[str, ...] = ()
    loops: tuple[Loop, ...] = ()

    __reduce__ = made_again

    def __post_init__(self) -> None:
        n = len(self.joints)
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(
            self, "parameters", frozen_array(self.parameters, (n, PARAMETERS_PER_LINK), "parameters")
        )
        span = np.asarray(self.parameter_span)
        expected = (PARAMETERS_PER_LINK * n, span.shape[-1])
        object.__setattr__(self, "parameter_span", frozen_array(span, expected, "parameter_span"))
        object.__setattr__(self, "gravity", frozen_array(self.gravity, (3,), "gravity"))
        object.__setattr__(self, "notes", tuple(self.notes))
        object.__setattr__(self, "parents", _checked_parents(self.parents, n))
        object.__setattr__(self, "tip_body", _checked_tip(self.tip_body, self.leaves, n))
        object.__setattr__(self, "coordinates", checked_coordinates(self.coordinates, n))
        object.__setattr__(self, "frames", tuple(self.frames) or (self.tip_frame,))
        if any(not 0 <= frame.joint < n for frame in self.frames):
            raise ValueError(f"a frame moves with none of the {n} joints")
        if any(not BASE <= end.joint < n for loop in self.loops for end in (loop.first, loop.second)):
            raise ValueError(f"a loop moves with none of the {n} joints")
        if not self.contacts or {*self.rows_of_contacts} - {POINT, SURFACE}:
            raise ValueError(f"the frames have {[frame.rows for frame in self.frames]} rows of contacts")

    @property
    def has_unknown_body(self) -> NDArray[np.bool_]:
        """Return for each of n links whether at least one of the ten inertial parameters is unknown."""
        return np.asarray(np.isnan(self.parameters[:, :DRIVE]).any(axis=1))

    @property
    def known_parameters(self) -> Array:
        """Return the standard parameters (n, 11) with zeros for everything unknown: links with an unknown parameter,
        and unknown drive inertias."""
        known = np.nan_to_num(self.parameters)
        known[self.has_unknown_body, :DRIVE] = 0.0
        return known

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def q_names(self) -> tuple[str, ...]:
        """Names of the nq entries of q: the joint's name, or 'joint.x' and so on if the joint has several coordinates."""
        return tuple(
            name for joint in self.leading_joints for name in _entry_names(joint.name, joint.type.q_names)
        )

    @property
    def v_names(self) -> tuple[str, ...]:
        """Names of the nv entries of rates, accelerations and torques: the joint's name, or 'joint.vx' and so on."""
        return tuple(
            name for joint in self.leading_joints for name in _entry_names(joint.name, joint.type.v_names)
        )

    @property
    def tip_frame(self) -> NamedFrame:
        return NamedFrame(self.tip_name, self.tip_body, self.tip)

    @property
    def contacts(self) -> tuple[NamedFrame, ...]:
        """The named frames at which contacts are possible; by default each named frame is a contact point."""
        return tuple(frame for frame in self.frames if frame.rows)

    @property
    def rows_of_contacts(self) -> tuple[int, ...]:
        return tuple(frame.rows for frame in self.contacts)

    @property
    def rows_of_loops(self) -> tuple[tuple[int, ...], ...]:
        """For each loop the axes of its first frame that it closes."""
        return tuple(loop.rows for loop in self.loops)

    @property
    def passive_rates(self) -> tuple[int, ...]:
        """The numbers of the rates of passive joints, whose motion follows from that of the other joints."""
        passive = {joint for loop in self.loops for joint in loop.passive}
        return tuple(k for k, joint in enumerate(self.rate_joints) if joint in passive)

    @property
    def types(self) -> tuple[JointType, ...]:
        return tuple(joint.type for joint in self.joints)

    @property
    def nq(self) -> int:
        """Length of q: the number of coordinates of all joints except mimic joints."""
        return sum(kind.nq for kind in self.own_types)

    @property
    def nv(self) -> int:
        """Length of qd, qdd and tau: the number of rates of all joints except mimic joints."""
        return sum(kind.nv for kind in self.own_types)

    @property
    def rate_joints(self) -> tuple[int, ...]:
        """Return the index of the joint for each of the nv rates."""
        return tuple(i for i in self.own_joints for _ in range(self.joints[i].type.nv))

    @property
    def leaves(self) -> tuple[int, ...]:
        """Bodies that have no children."""
        return tuple(i for i in range(len(self)) if i not in self.parents)

    @property
    def is_serial(self) -> bool:
        """Whether the bodies form a serial chain from the base with the tip on the last body."""
        return self.parents == serial_parents(len(self)) and self.tip_body == len(self) - 1

    @property
    def has_floating_base(self) -> bool:
        """Whether the first body is on a free joint, with six degrees of freedom."""
        return self.types[0].nv == FREE_RATES and self.parents[0] == BASE

    @property
    def base_frame(self) -> str:
        """Return the name of the frame of gravity and placements: base, or world frame if the base floats."""
        return "world frame" if self.has_floating_base else BASE_FRAME

    @property
    def own_joints(self) -> tuple[int, ...]:
        """Indices of the joints that are not mimic joints, in order."""
        return leaders(self.coordinates)

    @property
    def leading_joints(self) -> tuple[Joint, ...]:
        """The joints that are not mimic joints, in order."""
        return tuple(self.joints[i] for i in self.own_joints)

    @property
    def own_types(self) -> tuple[JointType, ...]:
        """Types of the joints that are not mimic joints, in order."""
        return tuple(joint.type for joint in self.leading_joints)

    @property
    def has_mimic_joints(self) -> bool:
        return len(self.own_joints) < len(self)

    @property
    def has_sums(self) -> bool:
        """Whether some joint follows the sum of several joints, as in parallelograms."""
        return any(coordinate.others for coordinate in self.coordinates)

    def parent_link(self, body: int) -> str:
        """Return the name of the link to which the joint of a body is attached."""
        parent = self.parents[body]
        return self.base_name if parent == BASE else self.joints[parent].link_name

    def path_to(self, body: int) -> tuple[int, ...]:
        """Return the bodies on the path from the base to a body. The last entry is this body itself."""
        path: list[int] = []
        while body != BASE:
            path.append(body)
            body = self.parents[body]
        return tuple(reversed(path))

    def __len__(self) -> int:
        return len(self.joints)


def _entry_names(joint: str, several: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{joint}.{name}" for name in several) or (joint,)


def serial_parents(n: int) -> tuple[int, ...]:
    """Return the parents of a serial chain of n bodies: the base, then each previous body."""
    return tuple(range(BASE, n - 1))


def _checked_parents(parents: Sequence[int], n: int) -> tuple[int, ...]:
    if not parents:
        return serial_parents(n)
    if len(parents) != n:
        raise ValueError(f"{len(parents)} parents for {n} joints")
    for i, parent in enumerate(parents):
        if not BASE <= parent < i:
            raise ValueError(f"parent {parent} of body {i} does not come before it")
    return tuple(parents)


def _checked_tip(tip_body: int, leaves: Sequence[int], n: int) -> int:
    if not n:
        return BASE
    if tip_body == BASE and len(leaves) == 1:
        return leaves[0]
    if not 0 <= tip_body < n:
        raise ValueError(f"the tip is on body {tip_body}, expected one of 0 to {n - 1}")
    return tip_body


def parameter_names(link_names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the standard parameters x, link by link: 'link:mx' and so on."""
    return tuple(f"{link}:{name}" for link in link_names for name in PARAMETER_NAMES)


# What operations need of a mechanism.
def require_derivable(chain: Mechanism) -> None:
    """Raise InputError with a remedy if a joint of the mechanism is locked at a constant position. Readers of robot
    files merge the links of such joints."""
    for joint, coordinate in zip(chain.joints, chain.coordinates, strict=True):
        if coordinate.leader is None:
            raise InputError(
                f"{shown(chain.name)}: joint {shown(joint.name)} is held at {coordinate.offset:g}",
                "make it a fixed joint",
            )


def require_axes(chain: Mechanism, what: str) -> None:
    """Raise InputError if a joint of the robot has several coordinates, such as a ball joint.

    what  name of the operation that needs joints with one coordinate, such as "calibration"
    """
    wide = next((joint for joint in chain.joints if not joint.type.about_z), None)
    if wide is not None:
        raise InputError(
            f"{shown(chain.name)}: {what} is of joints of one coordinate each, and joint {shown(wide.name)}"
            f" {wide.type.verb}",
            "derive the model without a floating base"
            if chain.has_floating_base
            else "hold this joint: derive the model with --lock JOINT=0",
        )


def require_no_loops(chain: Mechanism, what: str) -> None:
    """Raise InputError if the mechanism has closed loops, because its motors then also carry the forces of these loops.

    what  name of the operation that needs torques without such forces, such as "calibration"
    """
    if chain.loops:
        raise InputError(
            f"{shown(chain.name)}: {what} is of robots without closed loops: torques of its motors contain forces of loop "
            f"{shown(chain.loops[0].name)}",
            "fit model.loop_base_parameters to the logs yourself (docs/how-to/loops.md), or leave out follows = [] in a "
            "parallelogram",
        )
