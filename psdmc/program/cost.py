"""What a PROGRAM costs, counted on its instructions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from psdmc.program.operations import Unit
from psdmc.program.program import Op, Program


@dataclass(frozen=True, slots=True)
class Cost:
    """Operation counts. `add` includes subtractions; negations are free in most places and are counted apart.

    div     divisions and square roots: both keep one unit of the processor busy for about as long
    fused   multiplications that a fused multiply-add can absorb: used once, by an addition or subtraction, each of which
            absorbs one
    sincos  distinct angles whose sine or cosine is taken
    choice  minima, maxima, magnitudes and selections
    call    elementary functions of the C library
    """

    mul: int
    add: int
    div: int
    neg: int
    sincos: int
    fused: int
    choice: int = 0
    call: int = 0

    @property
    def total(self) -> int:
        """mul + add, the figure that the literature compares."""
        return self.mul + self.add

    def __str__(self) -> str:
        extra = f" + {self.div} div" if self.div else ""
        further = ((self.choice, "choice"), (self.call, "call"))
        more = "".join(f" + {count} {word}" for count, word in further if count)
        return f"{self.mul} mul + {self.add} add{extra} + {self.sincos} sincos{more}"


def cost(program: Program) -> Cost:
    """Operations of the PROGRAM by kind; `fused` counts the sums of which a term is a product without another use."""
    body, uses = program.body, program.uses()
    count = dict.fromkeys(Unit, 0)
    fused = 0
    angles: set[int] = set()
    for op, args, _, _ in body:
        unit = op.unit
        count[unit] += 1
        if unit is Unit.ADD:
            a, b = args
            fused += (uses[a] == 1 and body[a][0] is Op.MUL) or (uses[b] == 1 and body[b][0] is Op.MUL)
        elif unit is Unit.SINCOS:
            angles.add(args[0])
    return counted(count, len(angles), fused)


def counted(count: Mapping[Unit, int], angles: int, fused: int) -> Cost:
    """The cost of so many operations by unit."""
    return Cost(
        count[Unit.MUL],
        count[Unit.ADD],
        count[Unit.DIV],
        count[Unit.NEG],
        angles,
        fused,
        count[Unit.CHOICE],
        count[Unit.CALL],
    )
