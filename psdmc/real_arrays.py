"""Numbers that a caller gives, as arrays of reals; what is none is refused by name."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from psdmc.errors import InputError

_REAL = "biuf"
"""Kinds of dtypes whose values are real numbers: truth values, integers, floats."""


def real_array(what: str, values: ArrayLike, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """The values as an array of this dtype, copied only where they are not.

    InputError, beginning with `what`, for complex numbers, texts, dates, and lists that are no array.
    """
    if type(values) is np.ndarray and values.dtype == dtype:
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            array = _of_numbers(array).astype(dtype)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{what} is no array of numbers: {error}", "give a NumPy array or nested lists"
        ) from error
    if array.dtype.kind not in _REAL:
        raise InputError(f"{what} has dtype {array.dtype}, expected real numbers", _remedy(array))
    return np.asarray(array, dtype)


def _of_numbers(array: NDArray[Any]) -> NDArray[Any]:
    """An array of objects that are numbers; TypeError for None, which NumPy would take for NaN, and other objects."""
    for value in array.flat:
        if not hasattr(value, "__float__"):
            raise TypeError(f"it holds a {type(value).__name__}")
    return array


def _remedy(array: NDArray[Any]) -> str:
    if array.dtype.kind == "c":
        return "take .real where the imaginary part is zero; derivatives are functions of their own"
    return "give floats"
