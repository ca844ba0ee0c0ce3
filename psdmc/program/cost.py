"""What a PROGRAM costs, counted on its instructions."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.program.program import Op, Program

_ADD, _SUB, _MUL, _DIV, _NEG, _SIN, _COS = Op.ADD, Op.SUB, Op.MUL, Op.DIV, Op.NEG, Op.SIN, Op.COS
_SQRT = Op.SQRT


@dataclass(frozen=True, slots=True)
class Cost:
    """Operation counts. `add` includes subtractions; negations are free in most places and are counted apart.

    div     divisions and square roots: both keep one unit of the processor busy for about as long
    fused   multiplications that a fused multiply-add can absorb: used once, by an addition or subtraction, each of which
            absorbs one
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
    """Operations of the PROGRAM by kind; `fused` counts the sums of which a term is a product without another use."""
    body, uses = program.body, program.uses()
    mul = add = div = neg = fused = 0
    angles: set[int] = set()
    for op, args, _, _ in body:
        if op is _MUL:
            mul += 1
        elif op is _ADD or op is _SUB:
            add += 1
            a, b = args
            fused += (uses[a] == 1 and body[a][0] is _MUL) or (uses[b] == 1 and body[b][0] is _MUL)
        elif op is _DIV or op is _SQRT:
            div += 1
        elif op is _NEG:
            neg += 1
        elif op is _SIN or op is _COS:
            angles.add(args[0])
    return Cost(mul, add, div, neg, len(angles), fused)
