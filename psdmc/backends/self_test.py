"""Names, inputs and tolerances of a package's self-test, which are equal in all languages."""

from __future__ import annotations

from collections.abc import Mapping

from psdmc.program.signature import TAU, Quantity, Signature

TOLERANCES: Mapping[str, str] = {"float64": "1e-10", "float32": "1e-3"}
FORWARD_TOLERANCES: Mapping[str, str] = {"float64": "1e-7", "float32": "1e-1"}
"""Relative to a joint's largest value: large enough for badly conditioned mass matrices, small enough to detect wrong
code."""

_ROWS = ("6", "nv")


def tolerance(function: Signature, real: str) -> str:
    """Return the tolerance of all outputs of a function."""
    return (FORWARD_TOLERANCES if function.factorises else TOLERANCES)[real]


def compared_by_row(output: Quantity) -> bool:
    """Return whether the self-test compares each row of an output relative to the largest value of that row. Otherwise,
    all entries are compared relative to the largest entry of the output."""
    return bool(output.axes) and output.axes[0] in _ROWS


def given_name(vector: str, variant: str) -> str:
    """Return the name under which the reference states hold an input of a function.

    Only the torques tau have several names, because they depend on the base parameters: tau for compiled-in parameters,
    tau_theta for the input theta_b, and tau_theta_rows for one theta_b per state.

    variant  ending of the function variant: '', '_theta' or THETA_ROWS
    """
    return f"{vector}{variant}" if vector == TAU.name else vector
