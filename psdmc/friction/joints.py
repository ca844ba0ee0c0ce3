"""Friction of all joints of a robot: its terms, and the values that a calibration found for them. As a part of the
dynamics, it is a function of q and qd, with derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from psdmc.friction.law import Array, At, Law, Row, Term, absolute, select, tanh, total
from psdmc.friction.terms import WITH_STATE, named
from psdmc.program.interpret import evaluated, replayed
from psdmc.program.program import Program, Slot
from psdmc.program.slopes import gradients
from psdmc.program.trace import Tracer

MOST_TERMS = 64
"""Of a joint: fits have up to ten."""


@dataclass(frozen=True, slots=True, eq=False)
class Friction:
    """Friction torque of n joints, as a sum of m terms such as Coulomb and viscous friction. Terms that act against the
    motion come first.

    terms       each a friction law and, if the law has one, its exponent or velocity
    values      (n, k) fitted values, such as coefficients: a row for each joint, columns in the order of the terms;
                zero if a joint lacks a term
    sign_speed  V in tanh(v / V), which replaces the sign of a joint's speed v; rad/s (m/s)
    beyond      what else the calibration found in addition to rigid bodies, in words without names
    """

    terms: tuple[Term, ...]
    values: Array
    sign_speed: float
    beyond: tuple[str, ...] = ()

    @property
    def by_position(self) -> bool:
        """Return whether the friction torque depends on the joints' positions."""
        return any("q" in term.reads for term in self.terms)

    @property
    def formula(self) -> str:
        """Return the friction torque of a joint as a formula in text, with s = tanh(speed / sign_speed) as smooth sign."""
        against = " + ".join(term.formula for term in self.terms if term.law.against)
        others = (term.formula for term in self.terms if not term.law.against)
        return " + ".join((*((f"s ({against})",) if against else ()), *others))

    def by_speed(self, qd: Array) -> Array:
        """Return the friction torque (..., n) at speeds qd (..., n), N m or N, of terms that do not depend on positions."""
        here = [(term, own) for term, own in self._rows(list(self.values.T)) if "q" not in term.reads]
        return self._torque(here, np.asarray(qd), 0.0)

    def torque(self, qd: ArrayLike, q: ArrayLike = 0.0) -> Array:
        """Return the friction torque (..., n), N m (N for a sliding joint), at speeds and positions (..., n). The motor
        torque is the sum of this torque and the torque of the rigid bodies."""
        return self._torque(self._rows(list(self.values.T)), np.asarray(qd, dtype=np.float64), np.asarray(q))

    def program(self) -> Program:
        """Return a PROGRAM (list of operations) for one joint, which computes the friction torque tau[0].

        The inputs of the PROGRAM are the joint's friction values p[...], the speed v[0] and the position q[0].
        """
        tracer = Tracer()
        p = tracer.symbols("p", self.values.shape[1])
        v = tracer.symbol(Slot("v", 0))
        at = At(tracer.symbol(Slot("q", 0)), v, tanh(v / self.sign_speed))
        return tracer.finish([(Slot("tau", 0), total(self._rows(p), at))])

    def _torque(self, rows: Sequence[Row], v: Array, q: ArrayLike) -> Array:
        return np.asarray(total(rows, At(q, v, tanh(v / self.sign_speed))) + np.zeros_like(v))

    def _rows(self, values: Sequence[Any]) -> list[Row]:
        """Terms with their values."""
        found, first = [], 0
        for term in self.terms:
            found.append((term, values[first : first + len(term.names)]))
            first += len(term.names)
        return found


def ordered(terms: Sequence[Term]) -> tuple[Term, ...]:
    """Return friction terms in psdmc's order: those against the motion first, constant torques last."""
    return tuple(sorted(terms, key=lambda term: (not term.law.against, not term.reads)))


def found_friction(
    values: Mapping[tuple[str, str], float],
    joints: Sequence[str],
    everyone_s: Sequence[Term],
    laws: Mapping[str, Law],
    sign_speed: float,
) -> Friction:
    """Return the Friction that has the given values, without terms that depend on the load.

    values      fitted values by the names of the joint and of the value
    everyone_s  terms that every joint must have
    laws        friction laws by name, among which psdmc finds the law of each value

    Raises KeyError if a value is missing, ValueError if a value is not finite or belongs to no law.
    """
    if not sign_speed > 0.0:
        raise ValueError(f"sign_speed {sign_speed:g}")
    terms = dict.fromkeys(everyone_s)
    for (_, name), value in values.items():
        found = named(name, laws)
        if found is None:
            raise ValueError(f"{name!r} is a value of no friction law")
        if not math.isfinite(value):
            raise ValueError(f"{name} is {value}")
        if "load" not in found[0].reads:
            terms.setdefault(found[0])
    if len(terms) > MOST_TERMS:
        raise ValueError(f"{len(terms)} terms")
    names = [name for term in everyone_s for name in term.names]
    missing = [(joint, name) for joint in joints for name in names if (joint, name) not in values]
    if missing:
        raise KeyError(*missing[:1])
    chosen = ordered(list(terms))
    rows = [[values.get((joint, name), 0.0) for term in chosen for name in term.names] for joint in joints]
    return Friction(chosen, np.array(rows, dtype=np.float64).reshape(len(joints), -1), sign_speed)


def rows_of(values: Mapping[str, float], law: str, laws: Mapping[str, Law]) -> list[Row]:
    """Return the friction terms of one joint, each with its list of values. Values that belong to no law are left out.

    values  values of the joint by name
    law     name of the joint's friction law if it has an internal state (such as LuGre)
    laws    friction laws by name, among which psdmc finds the law of each value
    """
    whole = WITH_STATE.get(law)
    if whole is not None and set(whole.parameters) <= set(values):
        return [(Term(whole), [values[name] for name in whole.parameters])]
    pairs = [found[0] for name in values if (found := named(name, laws)) is not None]
    return [(term, [values.get(name, 0.0) for name in term.names]) for term in dict.fromkeys(pairs)]


Scalar = Any
"""A float, an array of states, or a symbol that records what is done to it."""

SLOWEST = 1e-20
"""rad/s (m/s): speeds nearer to rest have the derivatives of this speed, if a law's derivatives at rest are no numbers,
as those of |v|^0.5."""


@dataclass(frozen=True, slots=True, eq=False)
class FrictionInDynamics:
    """The friction torque of a robot's nv joint rates at q and qd, and its derivatives. The motor torque is the sum of
    this torque and the torque of the rigid bodies. Each joint's friction depends on the joint's own q and qd only.

    friction  friction of k joints
    places    for each of these k joints, its index in q and its index in qd; all other rates have no friction
    nv        number of joint rates
    values    PROGRAM of the torque of one joint; inputs: p, v and q, as those of `Friction.program`
    first     PROGRAM of its derivatives by q and by v
    second    PROGRAM of its second derivatives by q and q, q and v, v and v
    """

    friction: Friction
    places: tuple[tuple[int, int], ...]
    nv: int
    values: Program
    first: Program
    second: Program

    @staticmethod
    def of(friction: Friction, places: Sequence[tuple[int, int]], nv: int) -> FrictionInDynamics:
        """Return the friction of a robot. `places` has the indices in q and in qd of each joint with friction."""
        value, first, second = _derivatives(friction.program())
        at_rest = {"q": np.array([0.3]), "v": np.zeros(1)}
        p = dict(enumerate(np.ones(friction.values.shape[1]).tolist()))

        def rest(slot: Slot) -> Scalar:
            return p[slot.index] if slot.vector == "p" else at_rest[slot.vector]

        with np.errstate(all="ignore"):
            known = [number for each in (first, second) for _, number in evaluated(each, rest)]
        if not np.isfinite(np.hstack(known)).all():
            first, second = map(_off_rest, (first, second))
        return FrictionInDynamics(friction, tuple(places), nv, value, first, second)

    @property
    def key(self) -> str:
        """A text that identifies the friction: two frictions of one model with the same text have equal torques."""
        return f"friction in dynamics, sign speed {self.friction.sign_speed!r}"

    def torques(self, q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[Scalar]:
        """Return the friction torques of the nv rates: N m (N for a sliding joint)."""
        (found,) = self._rows(self.values, q, qd)
        return found

    def slopes(self, q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[list[Scalar]]:
        """Return the derivatives of each rate's friction torque by its joint's q and by its qd, nv each."""
        return self._rows(self.first, q, qd)

    def bends(self, q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[list[Scalar]]:
        """Return the second derivatives of each rate's friction torque by q q, q qd and qd qd, nv each."""
        return self._rows(self.second, q, qd)

    def _rows(self, program: Program, q: Sequence[Scalar], qd: Sequence[Scalar]) -> list[list[Scalar]]:
        found: list[list[Scalar]] = [[0.0] * self.nv for _ in program.outputs]
        for values, (place, rate) in zip(self.friction.values.tolist(), self.places, strict=True):
            load = _loader(values, q[place], qd[rate])
            for row, (_, value) in zip(found, evaluated(program, load), strict=True):
                row[rate] = value
        return found


def _loader(values: Sequence[float], q: Scalar, v: Scalar) -> Callable[[Slot], Scalar]:
    """The inputs of one joint's PROGRAM."""
    return lambda slot: values[slot.index] if slot.vector == "p" else q if slot.vector == "q" else v


def _derivatives(program: Program) -> tuple[Program, Program, Program]:
    """The PROGRAM of a torque, that of its derivatives, and that of its second derivatives."""
    tracer = Tracer()
    (torque,) = replayed(program, tracer, {})
    state = [[tracer.symbol(Slot("q", 0))], [tracer.symbol(Slot("v", 0))]]
    (by_q,), (by_v,) = gradients([torque], [1.0], state)
    (by_q_q,), (by_q_v,) = gradients([by_q], [1.0], state)
    _, (by_v_v,) = gradients([by_v], [1.0], state)
    stored = ((torque,), (by_q, by_v), (by_q_q, by_q_v, by_v_v))
    value, first, second = (
        tracer.finish([(Slot("out", i), each) for i, each in enumerate(row)]) for row in stored
    )
    return value, first, second


def _off_rest(program: Program) -> Program:
    """The PROGRAM at speeds that are not nearer to rest than SLOWEST."""
    tracer = Tracer()
    v = tracer.symbol(Slot("v", 0))
    moved = select(absolute(v), SLOWEST, SLOWEST, v)
    found = replayed(program, tracer, {Slot("v", 0): moved})
    return tracer.finish([(slot, x) for (slot, _), x in zip(program.outputs, found, strict=True)])
