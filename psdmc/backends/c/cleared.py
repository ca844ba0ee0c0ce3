"""Finds outputs that are zero at every state of the robot. Code for one state sets consecutive zeros with vector
instructions.

Most entries of a tree robot's matrices are zero: 1,164 of 1,692 in the regressor of solo12. If they were stored one by
one, they would take a third of the function's code. Code for batches stores these zeros together with neighbouring
outputs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby

from psdmc.backends.c.lines import Cleared
from psdmc.program.program import Program, Slot

SHORTEST = 4
"""Entries of a run: a vector with AVX2. solo12's regressor: 819 ns, with runs of eight or more cleared 633, of four 621."""

LEAST = 256
"""Entries of all runs together: fewer do not show in a call's time. No six- or seven-joint arm has as many."""


def cleared(program: Program, sizes: Mapping[str, int]) -> tuple[Cleared, ...]:
    """Return the groups of consecutive output entries that are zero at every state. Return an empty tuple if there are
    too few such entries to be worth it.

    sizes  length of each output vector
    """
    zero = zero_outputs(program, sizes)
    runs = tuple(run for vector in sizes for run in _runs(vector, zero[vector]))
    return runs if sum(run.count for run in runs) >= LEAST else ()


def zero_outputs(program: Program, sizes: Mapping[str, int]) -> dict[str, list[int]]:
    """Return, for each output vector, the entries that are zero at every state. The PROGRAM (the list of operations to
    generate) does not store these entries, or stores the constant zero."""
    values = {slot: program.body[i].value for slot, i in program.outputs}
    return {
        vector: [index for index in range(size) if values.get(Slot(vector, index), 0.0) == 0.0]
        for vector, size in sizes.items()
    }


def without_zeros(program: Program, runs: tuple[Cleared, ...]) -> Program:
    """Return the PROGRAM (the list of operations to generate) without the output entries in the given groups of zeros."""
    gone = {slot for run in runs for slot in run.slots}
    return Program(program.body, tuple((slot, i) for slot, i in program.outputs if slot not in gone))


def _runs(vector: str, entries: list[int]) -> Iterator[Cleared]:
    """Runs of neighbours: their number less their place in the list is the same for all."""
    for _, run in groupby(enumerate(entries), key=lambda each: each[1] - each[0]):
        indices = [index for _, index in run]
        if len(indices) >= SHORTEST:
            yield Cleared(vector, indices[0], len(indices))
