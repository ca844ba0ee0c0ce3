"""An effect on motor torques that a fit has in addition to rigid bodies and plain friction, such as a spring. It
consists of unknown values, and of the torque per unit of each value. The length of a spring is the distance between
points of two links, or a sum of joint coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable, is_number, shown
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import frame_placement, jacobian
from psdmc.robot.mechanism import BASE, Mechanism, Placement


@dataclass(frozen=True, slots=True)
class Unknown:
    """One unknown value of a joint or of a spring in a fit, such as a stiffness.

    owner           name of the joint or spring
    never_negative  whether the value may not be negative, as for friction and for the force of a gas spring
    within          name of another unknown of this owner, which the magnitude of this unknown may not exceed; "": none
    start           the result if the data do not determine the value
    """

    owner: str
    name: str
    unit: str
    never_negative: bool = True
    within: str = ""
    start: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """N samples of a motion of n joints, from which the torques of springs and friction are computed.

    q, qd       (N, n)  rad, rad/s (m, m/s) of the joints
    place       (N, n)  positions of the parts that have friction: the joints, or the motors if several motors drive a
                        joint
    speed       (N, n)  speeds of the parts that have friction
    sign_speed  rad/s over which friction changes sign: tanh(speed / sign_speed)
    load        (N, n)  torque of the rigid bodies on the parts that have friction, N m (N); None if no friction depends
                        on it
    onto        (n, n)  joint torques are friction torques @ onto; None: friction torques are joint torques already
    """

    q: Array
    qd: Array
    place: Array
    speed: Array
    sign_speed: float
    load: Array | None = None
    onto: Array | None = None


class Effect(Protocol):
    """The torques that one entry of a log description, such as a spring, adds to those of the motors. They are a sum of
    unknown values, each times the torque per unit of the value."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]: ...

    @property
    def by_load(self) -> bool:
        """Return whether the effect depends on the torque of the bodies, as for friction that grows with the load."""
        ...

    def columns(self, motion: Motion) -> Array:
        """Return the motor torques per unit of each unknown, before any filter: (N samples, n joints, unknowns)."""
        ...


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of spring, which has a file in the folder `kinds`.

    name  the `kind` in an entry [[springs]]
    keys  keys that the entry may have in addition to `kind` and `name`
    read  function that returns the effects on torques of an entry, from its table and the robot. The function adds a
          text about each fault of the entry to the list `faults` of the table
    """

    name: str
    keys: tuple[str, ...]
    read: Callable[[TomlTable, Mechanism], tuple[Effect, ...]]


Content = Mapping[str, Any]
"""Tables of a description, as TOML gives them."""


# Lengths of springs


LARGEST_POINT = 100.0
"""m, of an anchor from its link's frame."""
LARGEST_RATIO = 1e3
"""m/rad or a plain number: length that a joint gives a spring per unit of its position."""
STATES, SEED = 200, 30_211
"""Random poses in which a spring's length is looked at before a fit."""
SHORTEST = 1e-3
"""m, of a spring between two points: nearer to each other they have no direction."""
LEAST_CHANGE = 1e-6
"""m: a length that changes by less over all poses moves no joint."""


class Way(Protocol):
    """A length that depends on the joint positions, such as that of a spring, with its derivatives.

    unit  unit of the length: m or rad
    """

    @property
    def unit(self) -> str: ...

    def length(self, q: Array) -> tuple[Array, Array]:
        """Return the lengths (N,) at N vectors of positions q (N, n joints), and their derivatives by q (N, n)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class BetweenAnchors:
    """The distance between two points, each of which is fixed to a body or to the base.

    bodies  the two bodies
    points  (3,) each, m: in the joint frame of the body, or in the base frame
    """

    chain: Mechanism
    bodies: tuple[int, int]
    points: tuple[Array, Array]
    unit: str = "m"

    def length(self, q: Array) -> tuple[Array, Array]:
        ends = [self._end(body, point, q) for body, point in zip(self.bodies, self.points, strict=True)]
        (start, moving_start), (stop, moving_stop) = ends
        apart = stop - start
        size = np.maximum(np.linalg.norm(apart, axis=1), 1e-12)
        slopes = np.einsum("nc,nck->nk", apart / size[:, None], moving_stop - moving_start)
        return size, np.asarray(slopes)

    def _end(self, body: int, point: Array, q: Array) -> tuple[Array, Array]:
        """(N, 3) position in the base frame, (N, 3, n) its slopes."""
        if body == BASE:
            return np.broadcast_to(point, (len(q), 3)), np.zeros((len(q), 3, q.shape[1]))
        frames, place = frames_of(self.chain), Placement(np.eye(3), point)
        states = [q[:, k] for k in range(q.shape[1])]
        _, origin = frame_placement(frames, body, place, states)
        rows = jacobian(frames, body, place, states)[:3]
        shape = q.shape[:1]
        slopes = [[np.broadcast_to(entry, shape) for entry in row] for row in rows]
        position = np.stack([np.broadcast_to(entry, shape) for entry in origin], axis=1)
        return position, np.moveaxis(np.array(slopes), 2, 0)


@dataclass(frozen=True, slots=True, eq=False)
class AlongJoints:
    """A length that is the sum of the joint positions times `ratios` (n,), one for each of n joints. It describes a
    cable over pulleys, or a spring on one joint."""

    ratios: Array
    unit: str

    def length(self, q: Array) -> tuple[Array, Array]:
        return q @ self.ratios, np.broadcast_to(self.ratios, q.shape)


def anchored_way(table: TomlTable, chain: Mechanism) -> Way:
    """Return the distance between the two points that the keys `from` and `to` of a table define. Both are { link,
    point }, with the point (m) in the link's frame of the robot file. Faults are added to the list `faults` of the
    table."""
    ends = [_anchor(table, key, chain) for key in ("from", "to")]
    way = BetweenAnchors(chain, (ends[0][0], ends[1][0]), (ends[0][1], ends[1][1]))
    if table.faults:
        return way
    size, _ = way.length(poses(chain))
    if np.ptp(size) < LEAST_CHANGE:
        table.faults.append(f"{table.where}: no joint changes the distance of `from` and `to`")
    elif size.min() < SHORTEST:
        table.faults.append(
            f"{table.where}: `from` and `to` come within {size.min():.2g} m of each other: a line of no direction"
        )
    return way


def _anchor(table: TomlTable, key: str, chain: Mechanism) -> tuple[int, Array]:
    own = TomlTable(table.content.get(key, {}), f"{table.where}: {key}", ("link", "point"), table.faults)
    link, point = own.text("link"), np.array(own.triple("point", LARGEST_POINT))
    if link == chain.base_name:
        return BASE, point
    for body, joint in enumerate(chain.joints):
        if joint.link_name == link:
            return body, joint.link_frame.rotation @ point + joint.link_frame.translation
    for frame in chain.frames:
        if frame.name == link:
            return frame.joint, frame.placement.rotation @ point + frame.placement.translation
    if link:
        known = [
            chain.base_name,
            *(joint.link_name for joint in chain.joints),
            *(f.name for f in chain.frames),
        ]
        table.faults.append(
            f"{own.where}: link {quoted(link)} is not the robot's, it has {listed(list(dict.fromkeys(known)))}"
        )
    return BASE, point


def jointed_way(table: TomlTable, chain: Mechanism) -> Way:
    """Return the length that the key `joints` of a table defines. This key holds joint names, each with the change of
    length per unit of the joint's position. Faults are added to the list `faults` of the table."""
    value = table.content.get("joints")
    given = value if isinstance(value, dict) else {}
    if not given:
        table.faults.append(f"{table.where}: joints: expected a table such as {{ J2 = 0.05, J3 = -0.05 }}")
    ratios = np.zeros(chain.nv)
    for name, ratio in given.items():
        if name not in chain.v_names:
            table.faults.append(
                f"{table.where}: joint {quoted(name)} is not the robot's, it has {listed(chain.v_names)}"
            )
        elif not is_number(ratio) or not 0.0 < abs(ratio) <= LARGEST_RATIO:
            table.faults.append(f"{table.where}: joints: {quoted(name)}: expected a number, not zero")
        else:
            ratios[chain.v_names.index(name)] = float(ratio)
    return AlongJoints(ratios, "m")


def poses(chain: Mechanism) -> Array:
    """Return random joint positions (STATES, n joints) within the limits of the joints. Positions do not exceed plus or
    minus half a revolution (half a metre)."""
    rng = np.random.default_rng(SEED)
    wide = np.array([np.pi if joint.type.position_unit == "rad" else 0.5 for joint in chain.leading_joints])
    lower = np.maximum([joint.limits.lower for joint in chain.leading_joints], -wide)
    upper = np.minimum([joint.limits.upper for joint in chain.leading_joints], wide)
    return np.asarray(rng.uniform(np.minimum(lower, upper), np.maximum(lower, upper), (STATES, chain.nv)))


# Springs
#
# The unknown values are the tension at a reference length, the stiffness, and the friction of the spring's
# rod.


SLIDING = 0.01
"""m/s (rad/s) over which a spring's friction changes sign."""


def pull(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of an unknown constant force that shortens the spring: one at every sample."""
    return np.ones_like(length)


def push(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of an unknown constant force that lengthens the spring: minus one at every sample."""
    return -np.ones_like(length)


def stretch(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of stiffness: the length of the spring minus the reference length, at every sample."""
    return length - reference


def rub(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of rod friction, which acts against the motion of the rod. It is about one while the
    spring becomes longer, minus one while it becomes shorter."""
    return np.asarray(np.tanh(rate / SLIDING))


Law = Callable[[Array, Array, float], Array]
"""The tension per unit of a value, of length (N,), its rate (N,) and the reference length."""


@dataclass(frozen=True, slots=True, eq=False)
class Spring:
    """A spring in a fit. Its tension is a sum of unknown values, each times a law. The motors balance the spring with
    the joint torques tau = tension * d length / dq.

    unknowns   the unknown values, such as the stiffness
    laws       for each unknown value, the function that returns the tension per unit
    way        function of the joint positions that returns the length of the spring
    reference  m (rad), the length at which `force` is the whole tension
    """

    unknowns: tuple[Unknown, ...]
    laws: tuple[Law, ...]
    way: Way
    reference: float
    by_load: bool = False

    def columns(self, motion: Motion) -> Array:
        length, slopes = self.way.length(motion.q)
        rate = np.sum(slopes * motion.qd, axis=1)
        tension = np.stack([law(length, rate, self.reference) for law in self.laws], axis=-1)
        return np.asarray(slopes[:, :, None] * tension[:, None, :])


# Keys that several tables have
#
# A value is true or false, the name of one joint, or the names of several joints.


def flag(table: TomlTable, key: str) -> bool:
    """Return the value of a key, true or false; false if the key is missing. If the value is something else, a text is
    added to the list of faults, and false is returned."""
    value = table.content.get(key, False)
    if not isinstance(value, bool):
        table.faults.append(f"{table.where}: {key}: found {shown(value)}, expected true or false")
        return False
    return value


def joint_of(table: TomlTable, chain: Mechanism) -> int:
    """Return the index of the joint that the key `joint` names. If the robot has no such joint, a text is added to the
    list of faults, and 0 is returned."""
    name = table.text("joint")
    if name in chain.v_names:
        return chain.v_names.index(name)
    if name:
        table.faults.append(
            f"{table.where}: joint {quoted(name)} is not the robot's, it has {listed(chain.v_names)}"
        )
    return 0


def joints_of(value: object, where: str, chain: Mechanism, faults: list[str]) -> tuple[int, ...]:
    """Return the indices of the joints that a value of a log description selects. The value true selects all joints,
    false none, and a list selects joints by name. A text is added to `faults` if the value is wrong."""
    if isinstance(value, bool):
        return tuple(range(chain.nv)) if value else ()
    if not isinstance(value, list) or any(not isinstance(name, str) for name in value):
        faults.append(f"{where}: found {shown(value)}, expected true, false, or a list of joint names")
        return ()
    odd = [quoted(name) for name in value if name not in chain.v_names]
    if odd:
        faults.append(f"{where}: joint(s) {listed(odd)} are not the robot's, it has {listed(chain.v_names)}")
    return tuple(k for k, name in enumerate(chain.v_names) if name in value)
