"""The passes in their order, with the checker between them."""

from __future__ import annotations

from collections.abc import Callable

from psdmc.program.check import check
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.passes.merge_duplicates import merge_duplicates
from psdmc.program.program import Program

Pass = Callable[[Program], Program]

PASSES: tuple[Pass, ...] = (drop_unused, merge_duplicates)


def optimize(program: Program) -> Program:
    """The same function of its inputs in fewer operations; InternalError where a pass breaks a PROGRAM's rules."""
    for apply in PASSES:
        program = check(apply(program), after=apply.__name__)
    return program
