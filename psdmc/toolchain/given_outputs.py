"""Arrays that a caller keeps for results: `out=`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.program.signature import Signature

Array = NDArray[Any]
Shapes = Sequence[tuple[int, ...]]


def checked(function: Signature, out: Any, shapes: Shapes, dtype: np.dtype[Any]) -> tuple[Array, ...]:
    """The caller's arrays, one for each output. InputError where one has another shape or dtype, cannot be written, or
    shares memory with another."""
    names = [output.name for output in function.outputs]
    given = tuple(out) if len(names) > 1 and isinstance(out, tuple | list) else (out,)
    if len(given) != len(names):
        raise InputError(
            f"{function.name}: out is one {type(out).__name__} with {len(given)} of {len(names)} arrays",
            f"give a tuple of arrays: {', '.join(names)}",
        )
    for name, array, shape in zip(names, given, shapes, strict=True):
        fault = next(_faults(array, shape, dtype), None)
        if fault:
            raise InputError(
                f"{function.name}: out for {name} {fault}", f"np.empty({shape}, np.{dtype}) fits"
            )
    if any(np.shares_memory(one, other) for one, other in combinations(given, 2)):
        raise InputError(f"{function.name}: arrays of out share memory", "give one array for each output")
    return given


def _faults(array: Any, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Iterator[str]:
    if not isinstance(array, np.ndarray):
        yield f"is a {type(array).__name__}, expected an array"
    elif array.dtype != dtype:
        yield f"has dtype {array.dtype}, expected {dtype}"
    elif array.shape != shape:
        yield f"has shape {array.shape}, expected {shape}"
    elif not array.flags.writeable:
        yield "is read-only"


def is_direct(array: Array, inputs: Sequence[Array]) -> bool:
    """Whether C may write into an array of the caller's: it is contiguous, and no input lies there."""
    plain = array.flags.carray and array.dtype.isnative
    return plain and not any(np.may_share_memory(array, given) for given in inputs)
