"""Friction of a robot's joints: terms, and the values that a calibration found for them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from psdmc.friction.law import Array, At, Law, Row, Term, total
from psdmc.friction.laws import LAWS
from psdmc.friction.own import laws_of
from psdmc.friction.scalars import tanh
from psdmc.friction.terms import WITH_STATE, every_joint_s, named
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Tracer

MOST_TERMS = 64
"""Of a joint: fits have up to ten."""


@dataclass(frozen=True, slots=True, eq=False)
class Friction:
    """Friction torque of n joints: the sum of terms, sizes against the motion first.

    terms       each with its law
    values      (n, m) one row for each joint; zero where a joint lacks a term
    sign_speed  rad/s (m/s) over which friction changes sign, so that it is smooth
    beyond      what else the calibration found beside rigid bodies, in words without names
    """

    terms: tuple[Term, ...]
    values: Array
    sign_speed: float
    beyond: tuple[str, ...] = ()

    @property
    def by_position(self) -> bool:
        """Whether the torque depends on the joints' positions."""
        return any("q" in term.reads for term in self.terms)

    def by_speed(self, qd: Array) -> Array:
        """(..., n) torque of the terms that do not depend on positions."""
        here = [(term, own) for term, own in self._rows(list(self.values.T)) if "q" not in term.reads]
        return self._torque(here, np.asarray(qd), 0.0)

    def torque(self, qd: ArrayLike, q: ArrayLike = 0.0) -> Array:
        """(..., n) N m (N) at speeds and positions (..., n), to be added to what the rigid bodies take."""
        return self._torque(self._rows(list(self.values.T)), np.asarray(qd, dtype=np.float64), np.asarray(q))

    def program(self) -> Program:
        """One joint's friction tau[0] by its values p[...], its speed v[0] and its position q[0]."""
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
    """What acts against the motion first, constants last."""
    return tuple(sorted(terms, key=lambda term: (not term.law.against, not term.reads)))


def found_friction(kept: Mapping[str, Any], joints: Sequence[str]) -> Friction:
    """The friction of a calibration from plain logs without what depends on the load, as model files hold it; KeyError,
    TypeError or ValueError where it is damaged."""
    values = {(row["joint"], row["name"]): _finite(row["value"], row["name"]) for row in kept["friction"]}
    options = kept["prediction"]
    speed = _finite(options["sign_speed"], "sign_speed")
    if not speed > 0.0:
        raise ValueError(f"sign_speed {speed:g}")
    laws = found_laws(options)
    everyone_s = every_joint_s([_finite(d, "an exponent") for d in options["exponents"]], False)
    terms = dict.fromkeys(everyone_s)
    for name in dict.fromkeys(name for _, name in values):
        found = named(name, laws)
        if found is None:
            raise ValueError(f"{name!r} is a value of no friction law")
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
    return Friction(chosen, np.array(rows, dtype=np.float64).reshape(len(joints), -1), speed)


def rows_of(values: Mapping[str, float], prediction: Mapping[str, Any]) -> list[Row]:
    """Terms of one joint with its values by name, of a calibration as model files hold it; names of no law are left out."""
    whole = WITH_STATE.get(str(prediction.get("law")))
    if whole is not None and set(whole.parameters) <= set(values):
        return [(Term(whole), [values[name] for name in whole.parameters])]
    laws = found_laws(prediction)
    pairs = [found[0] for name in values if (found := named(name, laws)) is not None]
    return [(term, [values.get(name, 0.0) for name in term.names]) for term in dict.fromkeys(pairs)]


def found_laws(prediction: Mapping[str, Any]) -> dict[str, Law]:
    """The laws that values of a calibration may be of: psdmc's, and the user's own that the file holds."""
    table = prediction.get("columns", {}).get("friction", {})
    return LAWS | laws_of(table.get("laws", ()))


def _finite(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{what} is {value!r:.40}")
    return float(value)
