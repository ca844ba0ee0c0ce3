"""Friction torques of all joints of a robot as a part of its dynamics: functions of q and qd, with derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from psdmc.friction.joints import Friction
from psdmc.friction.scalars import absolute, select
from psdmc.program.interpret import evaluated
from psdmc.program.program import Program, Slot
from psdmc.program.replay import replayed
from psdmc.program.slopes import gradients
from psdmc.program.trace import Tracer

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
