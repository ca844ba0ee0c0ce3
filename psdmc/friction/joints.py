"""Friction of all joints of a robot: the terms, and the values that a calibration found for them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from psdmc.friction.law import Array, At, Law, Row, Term, total
from psdmc.friction.scalars import tanh
from psdmc.friction.terms import WITH_STATE, named
from psdmc.program.program import Program, Slot
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
