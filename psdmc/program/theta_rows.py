"""Makes variants of functions that read other base parameters theta_b for each state, for batches of robots with
different parameters.

The arithmetic of a variant is that of the function with one theta_b for all states. The variant reads theta_b from the
input `thetas`, which is laid out like q. The code repeats all arithmetic on theta_b for each state.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from psdmc.program.kernel import Kernel
from psdmc.program.program import Program, Slot
from psdmc.program.signature import Quantity, Signature

THETA_ROWS = "_theta_rows"
"""Ending of the variants' names."""

THETAS = Quantity("thetas", ("l",), means="base parameters of each state, SI units")

LAST = 1000
"""Added to a function's order: the variants follow all functions."""


@cache
def by_rows(function: Signature) -> Signature:
    """The variant of a function with theta_b."""
    return replace(
        function,
        name=function.name + THETA_ROWS,
        order=function.order + LAST,
        meaning=f"{function.meaning}; one theta_b per state",
        inputs=(*function.inputs, THETAS),
        theta=False,
    )


def kernel_by_rows(kernel: Kernel) -> Kernel:
    """Return the variant of a kernel (one generated function with its lists of operations) that reads one theta_b per
    state.

    Keeps: output values, bit for bit; the order of operations.
    """
    single = _renamed(kernel.single)
    return replace(
        kernel,
        function=by_rows(kernel.function),
        theta=False,
        single=single,
        batch=single if kernel.batch is kernel.single else _renamed(kernel.batch),
        before=None if kernel.before is None else _renamed(kernel.before),
    )


def _renamed(program: Program) -> Program:
    """The PROGRAM with theta_b under the name of its rows."""
    body = tuple(
        each._replace(slot=Slot(THETAS.name, each.slot.index))
        if each.slot is not None and each.slot.vector == "theta_b"
        else each
        for each in program.body
    )
    return Program(body, program.outputs)
