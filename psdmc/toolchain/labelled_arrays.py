"""Calls a robot's functions with arrays of Dask (computed lazily in chunks) and of xarray (with named dimensions).

Both libraries are optional. psdmc imports them only if it gets such an array.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.errors import InputError
from psdmc.program.signature import WORDS, Quantity, Signature
from psdmc.real_arrays import order_of, real_array
from psdmc.toolchain.call_arguments import RobotAxes

if TYPE_CHECKING:
    import xarray as xr

Call = Callable[..., Any]
"""A function of a robot on arrays."""

JOINT, COLUMN = "joint", "joint_column"
"""Dimensions of vectors over joints, and of the second axis of matrices."""

_DIMENSIONS = {
    "n": JOINT,
    "nq": JOINT,
    "nv": JOINT,
    "nx": "state",
    "nxa": "state_and_acceleration",
    "nxu": "state_and_torque",
    "l": "base_parameter",
    "frames": "frame",
    "contacts": "contact",
    "contact_rows": "contact_row",
    "loop_rows": "loop_row",
    "constraint_rows": "constraint_row",
    "3": "axis",
    "6": "twist",
}
_COLUMNS = {
    JOINT: COLUMN,
    "axis": "axis_column",
    "state": "state_column",
    "state_and_acceleration": "state_and_acceleration_column",
    "state_and_torque": "state_and_torque_column",
    "contact_row": "contact_column",
}


def is_foreign(value: object) -> bool:
    """Return whether a value is an array of Dask or xarray."""
    return _room(value) in ("dask", "xarray")


def _room(value: object) -> str:
    return type(value).__module__.partition(".")[0]


def refuse_out(function: Signature, out: Any) -> None:
    """Raise InputError if the caller gives arrays for results (`out`), which these array types do not support."""
    if out is not None:
        raise InputError(f"{function.name}: out is for NumPy arrays", "leave it out")


def foreign(
    call: Call,
    axes: RobotAxes,
    function: Signature,
    inputs: Sequence[Any],
    tails: Sequence[tuple[int, ...]],
    dtype: Any,
) -> tuple[Any, ...]:
    """Return the outputs of a function as xarray arrays if an input is an xarray array, else as Dask arrays. Dask computes
    them chunk by chunk when their values are needed.

    call    function that computes the outputs for a chunk of the inputs
    tails   shape of each output for one state

    If Dask's chunks divide the axes of one state, such as the joints, they are joined. All inputs get equal chunks of
    states. Raises InputError if the length of an axis differs from that of the robot, or from that of another input.
    """
    if any(_room(given) == "xarray" for given in inputs):
        return _by_names(call, axes, function, inputs)
    import dask.array

    da: Any = dask.array  # untyped
    arrays = [
        _checked(da, function, quantity, given, axes)
        for quantity, given in zip(function.inputs, inputs, strict=True)
    ]
    own = [len(quantity.axes) for quantity in function.inputs]
    _check_leads(function, arrays, own)
    whole = [  # one chunk along each of the last axes
        array.rechunk({-k: -1 for k in range(1, count + 1)}) for array, count in zip(arrays, own, strict=True)
    ]
    arrays = _cut_alike(da, whole, own)
    ins = ",".join(map(_core, function.inputs))
    outs = ",".join(map(_core, function.outputs))
    made = {
        word: length
        for quantity, tail in zip(function.outputs, tails, strict=True)
        for word, length in zip(quantity.axes, tail, strict=True)
    }
    found = da.apply_gufunc(
        call,
        f"{ins}->{outs}",
        *arrays,
        output_dtypes=dtype if len(function.outputs) == 1 else [dtype] * len(function.outputs),
        output_sizes={f"d{word}": size for word, size in made.items()},
    )
    return found if isinstance(found, tuple) else (found,)


def _checked(da: Any, function: Signature, quantity: Quantity, given: Any, axes: RobotAxes) -> Any:
    """The input as an array of Dask's with the axes of one state last."""
    what = f"{function.name}: {quantity.name}"
    if _room(given) != "dask":
        given = real_array(what, given, np.float64, quantity.axes, axes.names)
    elif hasattr(given, "columns") or not hasattr(given, "chunks"):
        raise InputError(
            f"{what} is a {type(given).__name__} of Dask's, expected an array",
            "give .to_dask_array(lengths=True) with its columns in the robot's order",
        )
    array, tail = da.asarray(given), axes.sizes.shape(quantity.axes)
    if array.ndim < len(tail):
        names = ", ".join(map(repr, dimensions(quantity)))
        raise InputError(
            f"{what} has shape {array.shape}, expected the dimensions {names} last", _hint(axes, quantity)
        )
    for k, (name, length) in enumerate(zip(dimensions(quantity), tail, strict=True)):
        axis = array.ndim - len(tail) + k
        if array.shape[axis] != length:
            expected = ", ".join(("...", *map(str, tail)))
            raise InputError(
                f"{what} has shape {array.shape}, expected ({expected}): its axis {axis}, dimension {name!r}, has "
                f"{array.shape[axis]} entries",
                _hint(axes, quantity),
            )
    return array


def _check_leads(function: Signature, arrays: Sequence[Any], own: Sequence[int]) -> None:
    """InputError that names the first axis of states along which two arrays do not broadcast."""
    found = zip(function.inputs, arrays, own, strict=True)
    leads = [(quantity.name, array.shape[: array.ndim - k]) for quantity, array, k in found]
    for (one, first), (other, second) in combinations(leads, 2):
        for back in range(1, min(len(first), len(second)) + 1):
            lengths = {first[-back], second[-back]}
            if len(lengths) == 2 and 1 not in lengths and all(length == length for length in lengths):
                raise InputError(
                    f"{function.name}: {one} has {first[-back]} states along its axis {len(first) - back}, {other} has "
                    f"{second[-back]} along its axis {len(second) - back}",
                    "give arrays of one shape, or shapes that NumPy broadcasts",
                )


def _cut_alike(da: Any, arrays: Sequence[Any], axes: Sequence[int]) -> list[Any]:
    """The arrays with the same chunks along each of their common axes of states; `axes`: of one state, of each array."""
    labelled: list[Any] = []
    for k, (array, own) in enumerate(zip(arrays, axes, strict=True)):
        states = array.ndim - own
        labelled += [array, (*range(-states, 0), *((k, axis) for axis in range(own)))]
    return list(da.core.unify_chunks(*labelled)[1])


def _core(quantity: Quantity) -> str:
    """Axes as apply_gufunc names them: words, no numbers."""
    return f"({','.join(f'd{axis}' for axis in quantity.axes)})"


def _by_names(
    call: Call, axes: RobotAxes, function: Signature, inputs: Sequence[Any]
) -> tuple[xr.DataArray, ...]:
    """The outputs as xarray data arrays, whose dimensions have names.

    The dimension of joints is 'joint', that of matrix columns 'joint_column', and so on. All other dimensions are batch
    axes and broadcast by name. Names of joints and frames become coordinates.

    call  function that takes the NumPy or Dask data with the named dimensions last

    Raises InputError if a dimension is missing or has another length, or if a coordinate has other names. Names in
    another order are put into the robot's order.
    """
    import xarray as xr

    arrays = [
        _in_order(axes, function, quantity, given)
        for quantity, given in zip(function.inputs, inputs, strict=True)
    ]
    _check_states(function, arrays)
    cores = [list(dimensions(quantity)) for quantity in function.inputs]
    found = xr.apply_ufunc(
        call,
        *arrays,
        input_core_dims=cores,
        output_core_dims=[list(dimensions(quantity)) for quantity in function.outputs],
        exclude_dims=set(chain.from_iterable(cores)),  # q and rates of a floating base differ in length
        dask="allowed",
    )
    several = found if isinstance(found, tuple) else (found,)
    return tuple(_named(axes, output, array) for output, array in zip(function.outputs, several, strict=True))


def dimensions(quantity: Quantity) -> tuple[str, ...]:
    """Return the names of the dimensions of a quantity, such as 'joint'. If a dimension occurs twice, the second gets
    another name, such as 'joint_column'."""
    names: list[str] = []
    for axis in quantity.axes:
        name = _DIMENSIONS.get(axis, f"axis_of_{axis}" if axis not in WORDS else axis)
        names.append(_COLUMNS.get(name, f"{name}_column") if name in names else name)
    return tuple(names)


def _in_order(axes: RobotAxes, function: Signature, quantity: Quantity, given: Any) -> Any:
    what = f"{function.name}: {quantity.name}"
    if _room(given) == "dask":
        return given
    if _room(given) != "xarray":
        return real_array(what, given, np.float64, quantity.axes, axes.names)
    if not hasattr(given, "dims") or hasattr(given, "data_vars"):
        raise InputError(
            f"{what} is a {type(given).__name__}, expected a DataArray",
            "give one of its variables: dataset['q']",
        )
    for word, name in zip(quantity.axes, dimensions(quantity), strict=True):
        if name not in given.dims:
            other = next(
                (str(each) for each in reversed(given.dims) if each not in dimensions(quantity)), "dimension"
            )
            raise InputError(
                f"{what} has dimensions {given.dims}, expected one called {name!r}",
                f"rename its dimension: {quantity.name}.rename({{{other!r}: {name!r}}})",
            )
        if name in given.coords and given.coords[name].dtype.kind in "UOT" and axes.names.get(word):
            labels = given.coords[name].values.tolist()
            order = order_of(f"{what}'s dimension {name!r} has the names", labels, axes.names[word])
            given = given if order is None else given.isel({name: order})
        (length,) = axes.sizes.shape([word])
        if given.sizes[name] != length:
            raise InputError(
                f"{what} has {given.sizes[name]} entries along dimension {name!r}, expected {length}",
                _hint(axes, quantity),
            )
    return given


def _check_states(function: Signature, arrays: Sequence[Any]) -> None:
    """InputError that names a dimension of states along which two data arrays differ."""
    labelled = [
        (q, array) for q, array in zip(function.inputs, arrays, strict=True) if hasattr(array, "dims")
    ]
    for (one, first), (other, second) in combinations(labelled, 2):
        for name in first.dims:
            if name not in second.dims or name in (*dimensions(one), *dimensions(other)):
                continue
            if first.sizes[name] != second.sizes[name]:
                raise InputError(
                    f"{function.name}: dimension {name!r} has {first.sizes[name]} entries in {one.name} and "
                    f"{second.sizes[name]} in {other.name}",
                    "give both the same states",
                )
            both = name in first.indexes and name in second.indexes
            if both and not first.indexes[name].equals(second.indexes[name]):
                raise InputError(
                    f"{function.name}: dimension {name!r} has other coordinates in {other.name} than in {one.name}",
                    f"{one.name}, {other.name} = xr.align({one.name}, {other.name}, join='inner') keeps the common states",
                )


def _hint(axes: RobotAxes, quantity: Quantity) -> str:
    """List the robot's names along a quantity's first named axis."""
    word = next((word for word in quantity.axes if axes.names.get(word)), "n")
    return f"the robot has {', '.join(axes.names[word])}"


def _named(axes: RobotAxes, output: Quantity, array: xr.DataArray) -> xr.DataArray:
    """Add the names of joints and frames as coordinates."""
    known = {
        dimension: list(axes.names[word])
        for word, dimension in zip(output.axes, dimensions(output), strict=True)
        if axes.names.get(word)
    }
    named: xr.DataArray = array.assign_coords(known)
    return named.rename(output.name)
