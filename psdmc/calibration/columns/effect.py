"""An effect on motor torques that a fit has in addition to rigid bodies and plain friction, such as a spring. It
consists of unknown values, and of the torque per unit of each value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable
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
    """What one entry of a log description, such as a spring, adds to the motor torques. It is a sum of unknown values,
    each times the torque per unit of the value."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]: ...

    @property
    def by_load(self) -> bool:
        """Return whether the effect depends on the torque of the rigid bodies, as for friction that grows with the
        load."""
        ...

    def columns(self, motion: Motion) -> Array:
        """Return the motor torques per unit of each unknown value, before any filter: an array (N samples, n joints,
        unknown values)."""
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
