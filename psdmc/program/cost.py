"""What a PROGRAM costs, counted on its instructions."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from psdmc.program.program import Op, Program


@dataclass(frozen=True, slots=True)
class Cost:
    """Operation counts. add includes subtractions; negations are free in most places and stand apart.

    fused   multiplications that a fused multiply-add can absorb: used once, by an addition or subtraction
    sincos  distinct angles whose sine or cosine is taken
    """

    mul: int
    add: int
    div: int
    neg: int
    sincos: int
    fused: int

    @property
    def total(self) -> int:
        """mul + add, the figure that the literature compares."""
        return self.mul + self.add

    def __str__(self) -> str:
        extra = f" + {self.div} div" if self.div else ""
        return f"{self.mul} mul + {self.add} add{extra} + {self.sincos} sincos"


def cost(program: Program) -> Cost:
    ops = Counter(instr.op for instr in program.body)
    angles = {instr.args[0] for instr in program.body if instr.op in (Op.SIN, Op.COS)}
    return Cost(
        mul=ops[Op.MUL],
        add=ops[Op.ADD] + ops[Op.SUB],
        div=ops[Op.DIV],
        neg=ops[Op.NEG],
        sincos=len(angles),
        fused=_fusable(program),
    )


def _fusable(program: Program) -> int:
    """Each addition can absorb one product that nothing else needs."""
    uses = program.uses()
    count = 0
    for instr in program.body:
        if instr.op in (Op.ADD, Op.SUB):
            count += any(program.body[a].op is Op.MUL and uses[a] == 1 for a in instr.args)
    return count
