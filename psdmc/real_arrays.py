"""Turns a caller's numbers into arrays of real numbers. A value that is no array of real numbers gives an error that
names the argument.

The columns of data frames are matched with the robot's joints by name. psdmc recognises a data frame by its attributes,
so it does not import pandas or another library for this.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from psdmc.errors import InputError

_REAL = "biuf"
"""Kinds of dtypes whose values are real numbers: truth values, integers, floats."""


AxisNames = Mapping[str, Sequence[str]]
"""Word of an axis, such as nq -> names of what it runs over."""

MOST_NAMES = 12
"""Names that a message lists."""

_NO_NAMES: AxisNames = {}


def real_array(
    what: str,
    values: ArrayLike,
    dtype: DTypeLike = np.float64,
    axes: Sequence[str] = (),
    names: AxisNames = _NO_NAMES,
) -> NDArray[Any]:
    """Return the values as an array with the NumPy type `dtype`. Values are copied only if they are not yet an array of
    this type.

    axes   words for the last axes, such as nq; entries with labels, as in a data frame, are put in the robot's order
    names  for each word, the robot's names of the entries along the axis

    Raises InputError, which begins with `what`, for complex numbers, texts, dates, masked entries, ragged lists, and
    labels that are not the robot's names. Ascending integer labels, the default of pandas, count as positions.
    """
    if type(values) is np.ndarray and values.dtype == dtype:
        return values
    try:
        array = np.asarray(values)
        _refuse_masked(what, values)
        array = _in_order(what, values, array, axes, names)
        if array.dtype.kind == "O":
            array = _of_numbers(array).astype(dtype)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{what} is no array of numbers: {error}", "give a NumPy array or nested lists"
        ) from error
    if array.dtype.kind not in _REAL:
        raise InputError(f"{what} has dtype {array.dtype}, expected real numbers", _remedy(array))
    return np.asarray(array, dtype)


def _refuse_masked(what: str, values: Any) -> None:
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        count = int(np.ma.getmaskarray(values).sum())
        raise InputError(
            f"{what} is a masked array with {count} masked {'entry' if count == 1 else 'entries'}",
            "leave these states out, or fill them with numbers, as .filled(0.0) does",
        )


def _in_order(
    what: str, values: Any, array: NDArray[Any], axes: Sequence[str], names: AxisNames
) -> NDArray[Any]:
    """The array of a series or data frame with its last axes in the order of the names; any other array as it is."""
    if not hasattr(values, "to_numpy"):
        return array
    if hasattr(values, "dims"):
        if names:
            raise InputError(
                f"{what} is a {type(values).__name__}, whose dimensions are not read here",
                "give .values, with the axes of one state last",
            )
        return array
    labels = [(word, getattr(values, word)) for word in ("index", "columns") if hasattr(values, word)]
    for k, ((word, own), axis) in enumerate(zip(reversed(labels), reversed(axes), strict=False)):
        order = order_of(f"{what} has {word}", list(own), names.get(axis, ()))
        if order is not None:
            array = np.take(array, order, axis=-1 - k)
    return array


def order_of(what: str, labels: Sequence[Any], names: Sequence[str]) -> list[int] | None:
    """Return for each name the position of the equal label, which a data frame gives. Return None if the labels are
    ascending integers.

    Raises InputError, which begins with `what`, if the labels are not the names in some order.
    """
    if all(isinstance(label, int | np.integer) for label in labels) and list(labels) == sorted(labels):
        return None
    if names and sorted(map(str, labels)) == sorted(names):
        return [list(map(str, labels)).index(name) for name in names]
    unknown = [label for label in labels if label not in names]
    missing = [name for name in names if name not in labels]
    faults = [f"the robot has no {_listed(unknown)}"] if unknown else []
    faults += [f"{_listed(missing)} {'is' if len(missing) == 1 else 'are'} missing"] if missing else []
    raise InputError(
        f"{what} {_listed(labels)}: {', and '.join(faults) or 'a name is there twice'}",
        f"the names are {', '.join(names)}" if names else "give .to_numpy(), which is read by position",
    )


def _listed(names: Sequence[Any]) -> str:
    more = [f"and {len(names) - MOST_NAMES} more"] if len(names) > MOST_NAMES else []
    return ", ".join([*map(repr, names[:MOST_NAMES]), *more])


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
