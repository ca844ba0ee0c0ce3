"""A friction law: what it is called, which values of a joint it has, and the torque that these make."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError

Scalar = Any
"""A float, an array of states, or a symbol that records what is done to it."""

Array = NDArray[np.float64]
Text = str | Callable[[float], str]
"""A text, or for a law with a number a function of it."""


@dataclass(frozen=True, slots=True)
class At:
    """One joint at an instant; a law that reads none of these is a constant.

    q, v  rad, rad/s (m, m/s)
    sign  tanh(v / sign speed): the direction of motion, smooth at rest
    load  N m (N), what the rigid bodies take of the joint
    z     the law's state, where it has one
    """

    q: Scalar = 0.0
    v: Scalar = 0.0
    sign: Scalar = 0.0
    load: Scalar = 0.0
    z: Scalar = 0.0


@dataclass(frozen=True, slots=True)
class Value:
    """One number that is found for each joint.

    name         in records and files
    unit         of a joint that turns, such as "Nms/rad"; that of a sliding one follows
    low, high    what is possible
    start        what is kept where the data do not show it, and where a search begins
    within       another value of the law's joint, which its size may not exceed
    above        another value of the same law, below which it may not lie
    logarithmic  whether a search changes its logarithm
    """

    name: Text
    unit: Text = "Nm"
    low: float = 0.0
    high: float = math.inf
    start: float = 0.0
    within: str = ""
    above: str = ""
    logarithmic: bool = False

    def number_in(self, name: str, usual: float | None) -> float | None:
        """The number for which the value has this name; None where there is none."""
        if isinstance(self.name, str):
            return None
        last = re.search(r"[-+.\w]+$", re.split(r"[_^]", name)[-1])
        for number in (usual, None if last is None else _number(last[0])):
            if number is not None and self.name(number) == name:
                return number
        return None


@dataclass(frozen=True, slots=True)
class Number:
    """What a user gives a law, such as an exponent, once or several times.

    key        of the numbers in [friction];  unit  for messages
    low, high  what is possible;  most  how many
    usual      the number of the value whose name states none
    """

    key: str
    low: float
    high: float
    most: int
    unit: str = ""
    usual: float | None = None


@dataclass(frozen=True, slots=True)
class State:
    """How a law's state z changes; p are the law's values.

    rate    dz/dt at (p, v, z)
    step    z after dt, of (p, v0, v1, z, dt), the speed going evenly from v0 to v1, which have one sign
    pieces  steps between two samples of one sign, less one, of (p, v0, v1)
    """

    rate: Callable[..., Scalar]
    step: Callable[..., Scalar]
    pieces: Callable[..., Scalar]


@dataclass(frozen=True, slots=True)
class Law:
    """One law, the only place where it is known.

    name     its file's; key of [friction]
    about    one sentence for documents
    formula  for people, s being the smooth sign
    values   what is found for each joint
    torque   N m (N) of (p, at), p being the values and `at` an At; with a number of (p, at, number). On floats, arrays and
             symbols, with the functions of psdmc.friction
    against  whether `torque` is a size, which acts against the motion: it is multiplied by the smooth sign
    number   what a user gives, if anything
    word     whether it is a term of --friction, so that every joint has it
    key      whether [friction] has it
    instead  a term of every joint, which a joint with this law has only if [friction] says so
    line     constant torque and damping nearest to it, of (p, number, top speed), and what of it they lack ("": nothing);
             None: a robot file cannot hold any of it
    state    where it has one; the law is then no linear one
    """

    name: str
    about: str
    formula: Text
    values: tuple[Value, ...]
    torque: Callable[..., Scalar]
    against: bool = False
    number: Number | None = None
    word: bool = False
    key: bool = True
    instead: str = ""
    line: Callable[[Sequence[float], float, float], tuple[float, float, str]] | None = None
    state: State | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the values of a law without a number."""
        return tuple(str(value.name) for value in self.values)

    def require(self, p: Array) -> Array:
        """The values; InputError where the law cannot have them."""
        own = dict(zip(self.parameters, p.tolist(), strict=True))
        for value, x in zip(self.values, p.tolist(), strict=True):
            low = max(own[value.above], 0.0) if value.above else min(value.low, 0.0)
            if not x >= low or (value.low > 0.0 and x == 0.0):
                expected = f"at least {low:g}" if x < low else "a positive number"
                raise InputError(
                    f"{self.name} friction: {value.name} is {x:g}, expected {expected}", "correct the values"
                )
        return p

    def unknowns(self, p: Array) -> Array:
        """What a search varies: logarithms of some values, of others the excess over the one that they are above."""
        x = np.array(p, dtype=np.float64)
        for k, value in enumerate(self.values):
            if value.logarithmic:
                x[k] = math.log(p[k])
            elif value.above:
                x[k] = p[k] - p[self.parameters.index(value.above)]
        return x

    def from_unknowns(self, x: Array) -> Array:
        """The reverse of `unknowns`."""
        p = np.array(x, dtype=np.float64)
        for k, value in enumerate(self.values):
            if value.logarithmic:
                p[k] = math.exp(x[k])
            elif value.above:
                p[k] = x[k] + x[self.parameters.index(value.above)]
        return p

    def slopes(self, p: Array) -> Array:
        """(m, m) d values / d unknowns."""
        found = np.eye(len(self.values))
        for k, value in enumerate(self.values):
            if value.logarithmic:
                found[k, k] = p[k]
            elif value.above:
                found[k, self.parameters.index(value.above)] = 1.0
        return found

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(m,) lowest and highest unknowns."""
        low, high = (np.array([getattr(value, end) for value in self.values]) for end in ("low", "high"))
        for k, value in enumerate(self.values):
            if value.logarithmic:
                low[k], high[k] = math.log(low[k]), math.log(high[k])
            elif value.above:
                low[k] = 0.0
        return low, high


@dataclass(frozen=True, slots=True)
class Term:
    """A law with its number: what a joint can have."""

    law: Law
    number: float | None = None

    def __post_init__(self) -> None:
        wanted = self.law.number
        if (wanted is None) is not (self.number is None):
            raise ValueError(f"{self.law.name} with number {self.number}")
        if wanted is not None and not wanted.low <= (self.number or 0.0) <= wanted.high:
            raise ValueError(f"{self.law.name} with number {self.number:g}")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the values."""
        return tuple(self._text(value.name) for value in self.law.values)

    @property
    def formula(self) -> str:
        return self._text(self.law.formula)

    def units(self, effort: str = "N m") -> tuple[str, ...]:
        """Of the values, for a joint whose torque or force has this unit."""
        return tuple(unit_of(effort, self._text(value.unit)) for value in self.law.values)

    @property
    def reads(self) -> frozenset[str]:
        """Attributes of At that the torque depends on."""
        seen = _Watched()
        self.torque([0.5] * len(self.law.values), seen)
        return frozenset(seen.read)

    def size(self, p: Sequence[Scalar], at: At | _Watched) -> Scalar:
        """The law's own function."""
        return self.law.torque(p, at) if self.number is None else self.law.torque(p, at, self.number)

    def torque(self, p: Sequence[Scalar], at: At | _Watched) -> Scalar:
        """N m (N) of one joint."""
        size = self.size(p, at)
        return at.sign * size if self.law.against else size

    def columns(self, at: At) -> list[Scalar]:
        """Torque per unit of each value, of a linear law."""
        return [self.torque(row, at) for row in np.eye(len(self.law.values)).tolist()]

    def _text(self, text: Text) -> str:
        return text if isinstance(text, str) else text(self.number or 0.0)


class _Watched:
    """An At that remembers what was read of it."""

    def __init__(self) -> None:
        self.read: set[str] = set()

    def __getattr__(self, name: str) -> float:
        self.read.add(name)
        return 0.5


Row = tuple[Term, Sequence[Scalar]]
"""A term and its values of one joint, or of all joints as arrays."""


def total(rows: Sequence[Row], at: At) -> Scalar:
    """Torque of several terms: sizes against the motion first, which share the sign."""
    sizes = [term.size(p, at) for term, p in rows if term.law.against]
    found = [at.sign * sum(sizes[1:], start=sizes[0])] if sizes else []
    found += [term.size(p, at) for term, p in rows if not term.law.against]
    return sum(found[1:], start=found[0]) if found else 0.0


def unit_of(effort: str, turning: str) -> str:
    """The unit of a joint whose torque or force has the unit `effort`, given that of one that turns: for Nms/rad Ns/m where
    it slides."""
    return turning.replace("Nm", "N").replace("rad", "m") if effort == "N" else turning


def _number(text: str) -> float | None:
    try:
        found = float(text)
    except ValueError:
        return None
    return found if math.isfinite(found) else None
