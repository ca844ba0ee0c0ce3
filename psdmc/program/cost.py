"""The cost of a PROGRAM (list of operations): its operations, counted by kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from psdmc.program.operations import Unit
from psdmc.program.program import Op, Program

_ADD, _SUB, _MUL, _SIN, _COS = Op.ADD, Op.SUB, Op.MUL, Op.SIN, Op.COS


@dataclass(frozen=True, slots=True)
class Cost:
    """Numbers of operations by kind. `add` includes subtractions. Negations are counted separately, because most cost
    nothing.

    div     divisions and square roots: both keep one unit of the processor busy for about as long
    fused   multiplications that the processor can do together with an addition or subtraction (fused multiply-add):
            those whose result only one addition or subtraction uses. Each addition or subtraction counts at most once
    sincos  distinct angles whose sine or cosine is computed
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
        """Return mul + add, the number of multiplications and additions, which papers compare."""
        return self.mul + self.add

    def __str__(self) -> str:
        extra = f" + {self.div} div" if self.div else ""
        further = ((self.choice, "choice"), (self.call, "call"))
        more = "".join(f" + {count} {word}" for count, word in further if count)
        return f"{self.mul} mul + {self.add} add{extra} + {self.sincos} sincos{more}"


def cost(program: Program) -> Cost:
    """Count the operations of the PROGRAM (list of operations) by kind. `fused` counts the additions and subtractions
    of which one argument is a product that no other operation uses."""
    body, uses = program.body, program.uses()
    mul = add = fused = 0
    others: list[Op] = []
    angles: set[int] = set()
    for op, args, _, _ in body:
        if op is _MUL:
            mul += 1
        elif op is _ADD or op is _SUB:
            add += 1
            a, b = args
            fused += (uses[a] == 1 and body[a][0] is _MUL) or (uses[b] == 1 and body[b][0] is _MUL)
        elif op is _SIN or op is _COS:
            angles.add(args[0])
        elif args:
            others.append(op)
    return counted(others, mul, add, len(angles), fused)


def counted(others: Iterable[Op], mul: int, add: int, sincos: int, fused: int) -> Cost:
    """Return the Cost with the given numbers of products (`mul`), sums (`add`), angles (`sincos`) and fused operations.
    `others` lists all further operations."""
    units = Counter(op.unit for op in others)
    rest = (units[Unit.DIV], units[Unit.NEG], sincos, fused, units[Unit.CHOICE], units[Unit.CALL])
    return Cost(mul, add, *rest)
