"""An effect beside rigid bodies and plain friction: unknown values, and the torque that a unit of each takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class Unknown:
    """One value to be found, of a joint or of a spring, its owner.

    never_negative  whether only values from zero on are possible: friction takes energy, a gas spring pushes
    within          name of another value of the same owner that its size may not exceed; "": none
    start           where the data do not show it
    """

    owner: str
    name: str
    unit: str
    never_negative: bool = True
    within: str = ""
    start: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Rows of a motion. N rows, n joints.

    q, qd         (N, n)  rad, rad/s (m, m/s)
    place, speed  (N, n)  of what rubs: the joints', or where motors drive several joints, the motors'
    sign_speed    rad/s over which friction changes sign: tanh(speed / sign_speed)
    load          (N, n)  torque of the rigid bodies on what rubs, N m (N); None where no effect asks for it
    onto          (n, n)  torques of what rubs @ onto are the joints'; None: they are these themselves
    """

    q: Array
    qd: Array
    place: Array
    speed: Array
    sign_speed: float
    load: Array | None = None
    onto: Array | None = None


class Effect(Protocol):
    """What one entry of a description adds to the torque of the motors: the sum over unknowns of value times column."""

    @property
    def unknowns(self) -> tuple[Unknown, ...]: ...

    @property
    def by_load(self) -> bool:
        """Whether its columns depend on the torque of the rigid bodies."""
        ...

    def columns(self, motion: Motion) -> Array:
        """(N, n, unknowns) motor torque per unit of each, before any filter."""
        ...


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of spring: the file that it has in `kinds`.

    name  the `kind` of a [[springs]] entry
    keys  of the entry, beside `kind` and `name`
    read  the effects of an entry: from its table and the robot. Faults go to the table's
    """

    name: str
    keys: tuple[str, ...]
    read: Callable[[TomlTable, Mechanism], tuple[Effect, ...]]


Content = Mapping[str, Any]
"""Tables of a description, as TOML gives them."""
