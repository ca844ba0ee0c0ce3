"""An effect on motor torques that a fit has in addition to rigid bodies and plain friction, such as a spring. It
consists of unknown values, and of the torque per unit of each value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from psdmc.calibration.columns.ways import Way
from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable, shown
from psdmc.robot.mechanism import Mechanism


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
