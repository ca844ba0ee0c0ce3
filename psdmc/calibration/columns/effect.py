"""An effect in a fit in addition to rigid bodies and plain friction, such as a spring: unknown values, and the torque
per unit of each value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class Unknown:
    """One unknown value of a joint or of a spring, which is its owner.

    never_negative  whether the value may not be negative, as for friction and for the force of a gas spring
    within          name of another value of the same owner, which the magnitude of this one may not exceed; "": none
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
    """N samples of a motion of n joints, from which the columns of effects are computed.

    q, qd         (N, n)  rad, rad/s (m, m/s)
    place, speed  (N, n)  position and speed of what has friction: the joints, or the motors if these are coupled
    sign_speed    rad/s over which friction changes sign: tanh(speed / sign_speed)
    load          (N, n)  torque of the rigid bodies on what has friction, N m (N); None if no effect needs it
    onto          (n, n)  friction torques @ onto are joint torques; None: they are joint torques already
    """

    q: Array
    qd: Array
    place: Array
    speed: Array
    sign_speed: float
    load: Array | None = None
    onto: Array | None = None


class Effect(Protocol):
    """What one entry of a log description adds to the motor torques: the sum of unknown values times columns."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]: ...

    @property
    def by_load(self) -> bool:
        """Whether the columns depend on the torque of the rigid bodies."""
        ...

    def columns(self, motion: Motion) -> Array:
        """Return the motor torque (N, n, unknowns) per unit of each unknown value, before any filter."""
        ...


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of spring, which has a file in the folder `kinds`.

    name  the `kind` in an entry [[springs]]
    keys  keys of the entry in addition to `kind` and `name`
    read  function that returns the effects of an entry from its table and the robot; faults go to the table's list
    """

    name: str
    keys: tuple[str, ...]
    read: Callable[[TomlTable, Mechanism], tuple[Effect, ...]]


Content = Mapping[str, Any]
"""Tables of a description, as TOML gives them."""
