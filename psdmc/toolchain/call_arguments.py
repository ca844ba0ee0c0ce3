"""Checks a method's arguments (inputs, theta_b, out), for compiled robots and models."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from psdmc.errors import InputError
from psdmc.program.kernel import GRAVITY, takes_gravity
from psdmc.program.signature import Q, Quantity, Signature, Sizes
from psdmc.real_arrays import AxisNames, real_array
from psdmc.robot.coordinates import refuse_other_lengths
from psdmc.toolchain.stubs import arguments

Array = NDArray[Any]

THETA_B = Quantity("theta_b", ("l",))
"""Base parameters as an input like others."""


@dataclass(frozen=True, slots=True)
class RobotAxes:
    """Sizes and names of the axes of one robot's arrays.

    sizes  lengths of axes: word, such as nq -> length
    names  names of the entries of q (nq), of rates (nv), joints (n) and named frames (frames)
    units  slices (start, stop) of q that must have length one, such as quaternions
    """

    sizes: Sizes
    names: AxisNames
    units: tuple[tuple[int, int], ...]


def bound_arguments(
    function: Signature, given: Sequence[Any], named: Mapping[str, Any]
) -> tuple[tuple[Any, ...], Any, Any]:
    """Return the inputs, theta_b and out of a call, from positional and named arguments. Raises TypeError, which names
    the function, if arguments are missing or unknown."""
    try:
        bound = signature_of(function).bind(None, *given, **named)
    except TypeError as error:
        raise TypeError(f"{function.name}(): {error}") from None
    bound.apply_defaults()
    _, *values, out = bound.arguments.values()
    count = len(function.inputs)
    return tuple(values[:count]), *(values[count:] or [None]), out


def with_gravity(
    robot: str, function: Signature, inputs: Sequence[Any], gravity: Any, own: Any
) -> tuple[Signature, tuple[Any, ...]]:
    """Return the signature of a function and its inputs, with gravity as the last input if the robot's code has it. Raises
    InputError if a gravity is given, and the function has no such input.

    own  gravity that is the default; None: no function of the robot's code has gravity as an input
    """
    if own is not None and function.depends_on_gravity:
        return takes_gravity(function), (*inputs, own if gravity is None else gravity)
    if gravity is not None:
        raise InputError(
            f"{robot}: {function.name} has no input gravity",
            'compile with gravity_input=True; functions such as "mass_matrix" do not depend on gravity',
        )
    return function, tuple(inputs)


@cache
def signature_of(function: Signature) -> inspect.Signature:
    """Return the Python signature (inspect.Signature) of the method for a generated function, including `self`."""
    defaults: dict[str, float | None] = {q.name: q.default for q in function.inputs if q.default is not None}
    defaults["theta_b"] = None
    return inspect.Signature(
        [
            inspect.Parameter(
                name,
                inspect.Parameter.POSITIONAL_OR_KEYWORD,
                default=defaults.get(name, inspect.Parameter.empty),
            )
            for name in ("self", *arguments(function))
        ]
        + [inspect.Parameter("out", inspect.Parameter.KEYWORD_ONLY, default=None)]
    )


def states(
    function: Signature, axes: RobotAxes, inputs: Sequence[ArrayLike], dtype: DTypeLike
) -> list[Array]:
    """Return the inputs of a function as arrays with batch axes first: (..., then the axes for one state). Raises
    InputError for another shape, or if a quaternion in q has not length one."""
    arrays = []
    for quantity, values in zip(function.inputs, inputs, strict=True):
        what = f"{function.name}: {quantity.name}"
        array = real_array(what, values, dtype, quantity.axes, axes.names)
        tail = axes.sizes.shape(quantity.axes)
        if quantity.default is not None and array.ndim == 0:
            array = np.full(tail, array)
        if array.ndim < len(tail) or array.shape[array.ndim - len(tail) :] != tail:
            raise InputError(*other_shape(what, array.shape, tail, quantity.axes, axes))
        arrays.append(array)
        if quantity is THETA_B:
            _refuse_no_numbers(what, array)
        if axes.units and quantity.axes == Q.axes and not function.normalizes:
            refuse_other_lengths(what, array, axes.units)
    return arrays


def other_shape(
    what: str, shape: tuple[int, ...], tail: tuple[int, ...], words: Sequence[str], axes: RobotAxes
) -> tuple[str, str]:
    """Return the message of the error for an array whose last axes do not fit one state, and a hint for the user."""
    expected = ", ".join(("...", *map(str, tail)))
    frames, joints = axes.names["frames"], axes.names["n"]
    hint = f"the robot has {len(joints)} joints: {', '.join(joints)}"
    if "l" in words:
        hint = "give one value per base parameter"
    if "frames" in words:
        hint = f"the frames are {', '.join(frames)}"
    if words == GRAVITY.axes:
        hint = "give three numbers, such as (0, 0, -9.81)"
    if {"contacts", "contact_rows"} & {*words}:
        hint = f"the contacts are {', '.join(axes.names['contacts'])}; a point has 3 rows, a surface 6"
    return f"{what} has shape {shape}, expected ({expected})", hint


def common_lead(function: Signature, arrays: Sequence[Array]) -> tuple[int, ...]:
    """Return the batch axes to which all inputs broadcast. Raises InputError if they do not."""
    pairs = list(zip(function.inputs, arrays, strict=True))
    leads = [array.shape[: array.ndim - len(quantity.axes)] for quantity, array in pairs]
    if len(set(leads)) < 2:
        return leads[0] if leads else ()
    try:
        return np.broadcast_shapes(*leads)
    except ValueError:
        shapes = ", ".join(f"{quantity.name} {array.shape}" for quantity, array in pairs)
        raise InputError(
            f"{function.name}: shapes do not broadcast: {shapes}",
            "give arrays of one shape, or shapes that NumPy broadcasts",
        ) from None


def has_rows(function: Signature, theta_b: ArrayLike | None) -> bool:
    """Return whether theta_b has batch axes, that is, another set of base parameters for each state."""
    if theta_b is None or hasattr(theta_b, "ndim"):
        return theta_b is not None and theta_b.ndim > 1
    return real_array(f"{function.name}: theta_b", theta_b).ndim > 1


@cache
def with_rows(function: Signature) -> Signature:
    """Return a function's signature with theta_b as an additional input, one per state."""
    return replace(function, inputs=(*function.inputs, THETA_B))


def _refuse_no_numbers(what: str, array: Array) -> None:
    """InputError that names the first entry that is infinite or NaN."""
    wrong = np.argwhere(~np.isfinite(array))
    if len(wrong):
        place = ", ".join(map(str, wrong[0].tolist()))
        raise InputError(f"{what}[{place}] is {array[tuple(wrong[0])]}", "give finite base parameters")


def parameters(function: Signature, l: int, theta_b: ArrayLike, dtype: DTypeLike) -> Array:
    """Return theta_b as an array (l,). Raises InputError if theta_b has another shape."""
    array = np.ascontiguousarray(real_array(f"{function.name}: theta_b", theta_b, dtype, ("l",)))
    if array.shape != (l,):
        raise InputError(
            f"{function.name}: theta_b has shape {array.shape}, expected ({l},)",
            "give one value per base parameter",
        )
    return array


def indefinite(
    function: Signature, axes: RobotAxes, pivot: int, arrays: Sequence[Array], state: tuple[int, ...]
) -> InputError | None:
    """Return the error for a state at which a pivot (divisor of a matrix factorisation) is not positive. Return None if
    the function reports this state by NaN.

    pivot   number of the pivot
    arrays  all inputs, broadcast to common batch axes
    state   index of the state in the batch
    """
    for matrix in function.factorises * function.stages:
        shape = axes.sizes.shape(matrix.axes)
        if pivot < math.prod(shape):
            break
        pivot -= math.prod(shape)
    if not matrix.error:
        return None
    where = f" in state {', '.join(map(str, state))}" if state else ""
    given = {q: array[state].ravel() for q, array in zip(function.inputs, arrays, strict=True)}
    for quantity, values in given.items():
        if wrong := quantity.fault(values):
            k, expected = wrong
            whose = "".join(f" of '{axes.names[axis][k]}'" for axis in quantity.axes if axis in axes.names)
            return InputError(
                f"{function.name}: {quantity.name}{whose} is {values[k]:g}{where}", f"give {expected}"
            )
    places = zip(matrix.axes, map(int, np.unravel_index(pivot, shape)), strict=True)
    names = {axis: axes.names[axis][k] for axis, k in places if axis in axes.names}
    scalars = {quantity.name: float(values[0]) for quantity, values in given.items() if not quantity.axes}
    return InputError(f"{function.name}: {matrix.error.format(**names, **scalars)}{where}", matrix.hint)


def finite_states(function: Signature, arrays: Sequence[Array]) -> NDArray[np.bool_]:
    """Return for each state whether all inputs are finite. The inputs are broadcast to common batch axes."""
    each = [
        np.isfinite(array).all(axis=tuple(range(-len(quantity.axes), 0)))
        for quantity, array in zip(function.inputs, arrays, strict=True)
    ]
    return np.asarray(np.logical_and.reduce(each))


Shapes = Sequence[tuple[int, ...]]


def checked_outputs(function: Signature, out: Any, shapes: Shapes, dtype: np.dtype[Any]) -> tuple[Array, ...]:
    """Return the caller's arrays `out`, one for each output. Raises InputError if one of the arrays has another shape
    or dtype, cannot be written, or shares memory with another array."""
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


def takes_results(array: Array, inputs: Sequence[Array]) -> bool:
    """Return whether C may write results into a caller's array: contiguous, sharing no memory with inputs."""
    plain = array.flags.carray and array.dtype.isnative
    return plain and not any(np.may_share_memory(array, given) for given in inputs)
