"""Elementary functions for friction laws. Arguments are floats, arrays with one value per state, or symbols that record
a PROGRAM (list of operations)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from psdmc.program.operations import Op

Scalar = Any
"""A float, an array of states, or a symbol."""


def _function(op: Op, of_floats: Callable[..., Any]) -> Callable[..., Scalar]:
    """An operation; of plain floats the standard library's, which is faster where a simulation calls it once a step."""

    def function(*args: Scalar) -> Scalar:
        return (of_floats if all(type(x) is float for x in args) else op)(*args)

    return function


absolute = _function(Op.ABS, abs)
exp = _function(Op.EXP, math.exp)
tanh = _function(Op.TANH, math.tanh)
sin = _function(Op.SIN, math.sin)
cos = _function(Op.COS, math.cos)
sqrt = _function(Op.SQRT, math.sqrt)
larger = _function(Op.MAX, max)
smaller = _function(Op.MIN, min)
select = _function(Op.SELECT, lambda a, b, x, y: x if a < b else y)
"""select(a, b, x, y): x where a < b, else y."""

_PLAIN: dict[float, Callable[[Scalar], Scalar]] = {
    0.5: sqrt,
    1.0: lambda x: x,
    1.5: lambda x: x * sqrt(x),
    2.0: lambda x: x * x,
}


def power(x: Scalar, exponent: Scalar) -> Scalar:
    """Return x to the power `exponent`, for x that is not negative."""
    plain = _PLAIN.get(exponent) if type(exponent) is float else None
    return _power(x, exponent) if plain is None else plain(x)


_power = _function(Op.POW, math.pow)
