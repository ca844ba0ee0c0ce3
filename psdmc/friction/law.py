"""A friction law is described by its name, the values that are fitted for each joint, and its torque, which the elementary
functions below compute."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.program.operations import Op

Scalar = Any
"""A float, an array of states, or a symbol that records what is done to it."""

Array = NDArray[np.float64]
Text = str | Callable[[float], str]
"""A text, or for a law with a number a function of it."""


@dataclass(frozen=True, slots=True)
class At:
    """The state of one joint at an instant, from which a friction law computes its torque.

    q, v  position and speed: rad, rad/s (m, m/s)
    sign  tanh(v / sign speed): the direction of motion, a smooth function of v
    load  N m (N for a sliding joint), the torque that the rigid bodies need at the joint
    z     the internal state, if the law has one
    """

    q: Scalar = 0.0
    v: Scalar = 0.0
    sign: Scalar = 0.0
    load: Scalar = 0.0
    z: Scalar = 0.0


@dataclass(frozen=True, slots=True)
class Value:
    """The description of one number that is fitted for each joint.

    name         its name in files
    unit         its unit for a rotating joint, such as "Nms/rad"; the unit for a sliding joint is derived from it
    low, high    bounds of the value
    start        the value at the start of a search, and the result if the data do not determine the value
    within       name of another value of the joint; the magnitude of this value may not exceed the other value
    above        name of another value of the law; this value may not be less than the other value
    logarithmic  whether a search varies the logarithm of the value
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
        """Return the number, such as an exponent, in a name of this friction value: 0.5 for 'viscous^0.5'. Return None
        if the name belongs to another value.

        usual  the number that is left out of a name
        """
        if isinstance(self.name, str):
            return None
        last = re.search(r"[-+.\w]+$", re.split(r"[_^]", name)[-1])
        for number in (usual, None if last is None else _number(last[0])):
            if number is not None and self.name(number) == name:
                return number
        return None


@dataclass(frozen=True, slots=True)
class Number:
    """The description of a number that the user gives a friction law, such as an exponent. The user may give several;
    each makes a separate term.

    key        name of the number in the section [friction] of a file
    low, high  bounds of the number
    most       how many of these numbers a user may give
    unit       unit of the number, for messages
    usual      the number that is left out of a value's name: 'viscous' has the usual exponent, 'viscous^0.5' another
               one
    """

    key: str
    low: float
    high: float
    most: int
    unit: str = ""
    usual: float | None = None


@dataclass(frozen=True, slots=True)
class State:
    """How the internal state z of a friction law changes with time. In all functions, p are the law's fitted values and
    v is the joint's speed.

    rate    function of (p, v, z) that returns dz/dt
    step    function of (p, v0, v1, z, dt) that returns z after the time dt. The speed changes linearly from v0 to v1,
            which have the same sign
    pieces  function of (p, v0, v1) that returns how many additional steps are needed from v0 to v1; 0: one step is
            enough
    """

    rate: Callable[..., Scalar]
    step: Callable[..., Scalar]
    pieces: Callable[..., Scalar]


@dataclass(frozen=True, slots=True)
class Law:
    """The complete description of one friction law.

    name     name of the law, of its file and of its key in the section [friction]
    about    one sentence for documents
    formula  formula for people; s is the smooth sign of the speed
    values   the numbers that are fitted for each joint
    torque   function of (p, at) that returns N m (N); p are the fitted values and `at` is the joint's state, an At. If
             the law has a number, the arguments are (p, at, number). It is called with floats, arrays and symbols, and
             uses the functions of psdmc.friction
    against  True: `torque` returns a magnitude that acts against the motion, and psdmc multiplies it by the smooth sign
    number   the number that a user gives, such as an exponent, if any
    word     whether the option --friction accepts the law, which every joint has then
    key      whether the section [friction] accepts the law
    instead  "offset": a joint with this law has no constant offset, unless [friction] asks for it; "": it may have one
    line     function of (p, number, top speed) that returns three things: the constant torque and the damping nearest
             to the law, and in words what they leave out. None: a robot file cannot hold any part of the law
    state    how the internal state changes, if the law has one; then the law is not linear in its values
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
        """Return the names of the fitted values of a friction law that takes no number from the user."""
        return tuple(str(value.name) for value in self.values)

    def require(self, p: Array) -> Array:
        """Return the values of a friction law unchanged. Raises InputError if a value is outside its bounds."""
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
        """Return the numbers that a search varies, (m,), from the law's m values p.

        They are logarithms for the values that are marked `logarithmic`. For a value with `above`, the number is the
        difference from the other value. All other values are unchanged.
        """
        x = np.array(p, dtype=np.float64)
        for k, value in enumerate(self.values):
            if value.logarithmic:
                x[k] = math.log(p[k])
            elif value.above:
                x[k] = p[k] - p[self.parameters.index(value.above)]
        return x

    def from_unknowns(self, x: Array) -> Array:
        """Return the law's m values from the m numbers that a search varies. It is the inverse of `unknowns`."""
        p = np.array(x, dtype=np.float64)
        for k, value in enumerate(self.values):
            if value.logarithmic:
                p[k] = math.exp(x[k])
            elif value.above:
                p[k] = x[k] + x[self.parameters.index(value.above)]
        return p

    def slopes(self, p: Array) -> Array:
        """Return the derivatives (m, m) of the law's m values by the m numbers of a search (see `unknowns`)."""
        found = np.eye(len(self.values))
        for k, value in enumerate(self.values):
            if value.logarithmic:
                found[k, k] = p[k]
            elif value.above:
                found[k, self.parameters.index(value.above)] = 1.0
        return found

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Return the lowest and the highest number that a search may try for each of the law's m values, (m,) each."""
        low, high = (np.array([getattr(value, end) for value in self.values]) for end in ("low", "high"))
        for k, value in enumerate(self.values):
            if value.logarithmic:
                low[k], high[k] = math.log(low[k]), math.log(high[k])
            elif value.above:
                low[k] = 0.0
        return low, high


@dataclass(frozen=True, slots=True)
class Term:
    """One term of a joint's friction: a friction law, and its exponent or velocity if it has one."""

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
        """Return the names of the fitted values of this friction term, such as 'viscous^0.5'."""
        return tuple(self._text(value.name) for value in self.law.values)

    @property
    def formula(self) -> str:
        return self._text(self.law.formula)

    def units(self, effort: str = "N m") -> tuple[str, ...]:
        """Return the units of this friction term's fitted values, for a joint with the unit `effort`."""
        return tuple(unit_of(effort, self._text(value.unit)) for value in self.law.values)

    @property
    def reads(self) -> frozenset[str]:
        """Return the joint's quantities on which the torque depends, such as 'q' and 'v': attributes of At."""
        seen = _Watched()
        self.torque([0.5] * len(self.law.values), seen)
        return frozenset(seen.read)

    def size(self, p: Sequence[Scalar], at: At | _Watched) -> Scalar:
        """Return the law's `torque`; for a law that acts against the motion, the magnitude of the torque."""
        return self.law.torque(p, at) if self.number is None else self.law.torque(p, at, self.number)

    def torque(self, p: Sequence[Scalar], at: At | _Watched) -> Scalar:
        """Return the torque of this friction term for one joint, N m (N for a sliding joint)."""
        size = self.size(p, at)
        return at.sign * size if self.law.against else size

    def columns(self, at: At) -> list[Scalar]:
        """Return the torque of each value of the law at one, with all others zero. The law must be linear in its values."""
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
    """Return the friction torque of several terms of one joint. Terms that act against the motion are summed before
    they are multiplied by the smooth sign.

    rows  each term with the joint's values for this term
    """
    sizes = [term.size(p, at) for term, p in rows if term.law.against]
    found = [at.sign * sum(sizes[1:], start=sizes[0])] if sizes else []
    found += [term.size(p, at) for term, p in rows if not term.law.against]
    return sum(found[1:], start=found[0]) if found else 0.0


def unit_of(effort: str, turning: str) -> str:
    """Return the unit of a friction value for a joint whose torque or force has the unit `effort`.

    turning  the unit for a rotating joint: Nms/rad becomes Ns/m for a sliding joint
    """
    return turning.replace("Nm", "N").replace("rad", "m") if effort == "N" else turning


def _number(text: str) -> float | None:
    try:
        found = float(text)
    except ValueError:
        return None
    return found if math.isfinite(found) else None


# Elementary functions for the formulas of laws: of floats, arrays with one value per state, or symbols


def _function(op: Op, of_floats: Callable[..., Any]) -> Callable[..., Scalar]:
    """An operation; of plain floats the standard library's, which is faster where a simulation calls it once a step."""

    def function(*args: Scalar) -> Scalar:
        return (of_floats if all(type(x) is float for x in args) else op)(*args)

    return function


absolute = _function(Op.ABS, abs)
exp = _function(Op.EXP, math.exp)
tanh = _function(Op.TANH, math.tanh)
sin = _function(Op.SIN, math.sin)
cos = _function(Op.COS, math.cos)
sqrt = _function(Op.SQRT, math.sqrt)
larger = _function(Op.MAX, max)
smaller = _function(Op.MIN, min)
select = _function(Op.SELECT, lambda a, b, x, y: x if a < b else y)
"""select(a, b, x, y): x where a < b, else y."""

_PLAIN: dict[float, Callable[[Scalar], Scalar]] = {
    0.5: sqrt,
    1.0: lambda x: x,
    1.5: lambda x: x * sqrt(x),
    2.0: lambda x: x * x,
}


def power(x: Scalar, exponent: Scalar) -> Scalar:
    """Return x to the power `exponent`, for x that is not negative."""
    plain = _PLAIN.get(exponent) if type(exponent) is float else None
    return _power(x, exponent) if plain is None else plain(x)


_power = _function(Op.POW, math.pow)
