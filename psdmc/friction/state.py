"""PROGRAMs (lists of operations) for the friction of one joint by a law with an internal state. They compute the
torque, the next state, and the number of time steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from psdmc.friction.law import At, Law
from psdmc.friction.terms import WITH_STATE
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Tracer

(STATE_LAW,) = WITH_STATE.values()
"""The one law with a state: what the friction runs of a campaign are fitted with."""


def state_programs(law: Law) -> dict[str, tuple[Program, tuple[str, ...]]]:
    """Return the PROGRAMs (lists of operations) 'step', 'pieces' and 'torque' of a friction law, by name. Each comes
    with the names of its inputs, apart from the law's fitted values p.

    'step' computes the next state, 'pieces' the number of additional steps, 'torque' the friction torque. Each PROGRAM
    has one output, `out`.
    """
    state = law.state
    assert state is not None
    return {
        "step": _traced(law, state.step, ("v0", "v1", "z", "dt")),
        "pieces": _traced(law, state.pieces, ("v0", "v1")),
        "torque": _traced(law, lambda p, v, z: law.torque(p, At(v=v, z=z)), ("v", "z")),
    }


def _traced(
    law: Law, function: Callable[..., Any], names: tuple[str, ...]
) -> tuple[Program, tuple[str, ...]]:
    tracer = Tracer()
    p = tracer.symbols("p", len(law.values))
    value = function(p, *(tracer.symbol(Slot(name, 0)) for name in names))
    return tracer.finish([(Slot("out", 0), value)]), names
