"""Functions of abstract scalars, for friction laws: of floats, of arrays of states, and of symbols that record a PROGRAM."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from psdmc.program.trace import Symbol

Scalar = Any
"""A float, an array of states, or a symbol."""


def absolute(x: Scalar) -> Scalar:
    """|x|"""
    return _one("absolute", x, abs, np.abs)


def exp(x: Scalar) -> Scalar:
    """e^x"""
    return _one("exp", x, math.exp, np.exp)


def tanh(x: Scalar) -> Scalar:
    """The smooth sign of x."""
    return _one("tanh", x, math.tanh, np.tanh)


def sin(x: Scalar) -> Scalar:
    """The sine of x rad."""
    return x.sincos()[0] if isinstance(x, Symbol) else _one("sin", x, math.sin, np.sin)


def cos(x: Scalar) -> Scalar:
    """The cosine of x rad."""
    return x.sincos()[1] if isinstance(x, Symbol) else _one("cos", x, math.cos, np.cos)


def sqrt(x: Scalar) -> Scalar:
    """The square root of x."""
    return x.root() if isinstance(x, Symbol) else _one("sqrt", x, math.sqrt, np.sqrt)


def larger(a: Scalar, b: Scalar) -> Scalar:
    """The larger of two."""
    return _several("larger", np.maximum, max, a, b)


def smaller(a: Scalar, b: Scalar) -> Scalar:
    """The smaller of two."""
    return _several("smaller", np.minimum, min, a, b)


def select(a: Scalar, b: Scalar, x: Scalar, y: Scalar) -> Scalar:
    """x where a < b, else y; both are computed."""
    return _several(
        "select", lambda a, b, x, y: np.where(a < b, x, y), lambda a, b, x, y: x if a < b else y, a, b, x, y
    )


def power(x: Scalar, exponent: Scalar) -> Scalar:
    """x^exponent for x not negative."""
    if isinstance(exponent, float) and exponent in (1.0, 2.0):
        return x if exponent == 1.0 else x * x
    return _several("power", np.power, pow, x, exponent)


def _one(name: str, x: Scalar, of_float: Callable[..., Any], of_array: Callable[..., Any]) -> Scalar:
    return _several(name, of_array, of_float, x)


def _several(
    name: str, of_arrays: Callable[..., Any], of_floats: Callable[..., Any], *args: Scalar
) -> Scalar:
    if any(isinstance(x, Symbol) for x in args):
        raise NotImplementedError(name)
    if any(isinstance(x, np.ndarray) for x in args):
        return of_arrays(*args)
    return of_floats(*args)
