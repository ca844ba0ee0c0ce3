"""The arguments of a function that is called from Python: inputs, then theta_b and out where they are given."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from psdmc.program.signature import Signature
from psdmc.toolchain.stubs import arguments


def bound_arguments(
    function: Signature, given: Sequence[Any], named: Mapping[str, Any]
) -> tuple[tuple[Any, ...], Any, Any]:
    """Inputs, theta_b and out of a call; TypeError, which names the function, where they do not fit."""
    try:
        bound = signature_of(function).bind(None, *given, **named)
    except TypeError as error:
        raise TypeError(f"{function.name}(): {error}") from None
    bound.apply_defaults()
    _, *values, out = bound.arguments.values()
    count = len(function.inputs)
    return tuple(values[:count]), *(values[count:] or [None]), out


@cache
def signature_of(function: Signature) -> inspect.Signature:
    """Of a method, `self` included."""
    return inspect.Signature(
        [
            inspect.Parameter(
                name,
                inspect.Parameter.POSITIONAL_OR_KEYWORD,
                default=None if name == "theta_b" else inspect.Parameter.empty,
            )
            for name in ("self", *arguments(function))
        ]
        + [inspect.Parameter("out", inspect.Parameter.KEYWORD_ONLY, default=None)]
    )
