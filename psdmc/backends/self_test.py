"""What a package's self-test compares: labels, inputs and tolerances, the same in every language."""

from __future__ import annotations

from collections.abc import Mapping

from psdmc.program.signature import TAU, Quantity, Signature

TOLERANCES: Mapping[str, str] = {"float64": "1e-10", "float32": "1e-3"}
FORWARD_TOLERANCES: Mapping[str, str] = {"float64": "1e-7", "float32": "1e-1"}
"""Relative to a joint's largest value: large enough for badly conditioned mass matrices, small enough to detect wrong
code."""

_ROWS = ("6", "nv")


def tolerance(function: Signature, real: str) -> str:
    """Of all outputs of a function."""
    return (FORWARD_TOLERANCES if function.factorises else TOLERANCES)[real]


def compared_by_row(output: Quantity) -> bool:
    """Whether each row of an output is compared relative to its own largest value. Otherwise, all entries are compared
    relative to the largest one."""
    return bool(output.axes) and output.axes[0] in _ROWS


def given_name(vector: str, variant: str) -> str:
    """Return the name of a kernel's input in the reference states.

    Input torques depend on the kernel's parameters and have one name per variant: compiled-in parameters (''), theta_b
    (_theta) and one theta_b per state (THETA_ROWS).
    """
    return f"{vector}{variant}" if vector == TAU.name else vector
