"""Compiled functions over Dask's and xarray's arrays: lazily in chunks, and by named dimensions.

Both are optional, and nothing here is loaded before such an array is given.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from psdmc.errors import InputError
from psdmc.program.signature import WORDS, Quantity, Signature
from psdmc.toolchain.robot_facts import RobotFacts

if TYPE_CHECKING:
    import xarray as xr

Call = Callable[..., Any]
"""A function of a compiled robot on arrays."""

JOINT, COLUMN = "joint", "joint_column"
"""Dimensions of vectors over joints, and of the second axis of matrices."""

_DIMENSIONS = {
    "n": JOINT,
    "nq": JOINT,
    "nv": JOINT,
    "nx": "state",
    "l": "base_parameter",
    "frames": "frame",
    "3": "axis",
    "6": "twist",
}
_COLUMNS = {JOINT: COLUMN, "axis": "axis_column", "state": "state_column"}


def is_lazy(value: object) -> bool:
    """Whether a value is an array of Dask's."""
    return type(value).__module__.partition(".")[0] == "dask"


def is_labelled(value: object) -> bool:
    """Whether a value is of xarray."""
    return type(value).__module__.partition(".")[0] == "xarray"


def in_chunks(
    call: Call,
    function: Signature,
    shapes: Mapping[str, int],
    tails: Sequence[tuple[int, ...]],
    inputs: Sequence[Any],
    dtype: Any,
) -> tuple[Any, ...]:
    """The outputs as arrays of Dask's, computed chunk by chunk when they are asked for.

    call    takes the inputs' chunks
    shapes  length of each word of an input's axis
    tails   trailing axes of each output

    Inputs whose last axes are cut are put together along these; chunks of states are cut alike.
    """
    import dask.array

    da: Any = dask.array  # untyped
    arrays = [
        _uncut(da.asarray(array), len(quantity.axes))
        for quantity, array in zip(function.inputs, inputs, strict=True)
    ]
    arrays = _cut_alike(da, arrays, [len(quantity.axes) for quantity in function.inputs])
    ins = ",".join(map(_core, function.inputs))
    outs = ",".join(map(_core, function.outputs))
    made = {
        word: length
        for quantity, tail in zip(function.outputs, tails, strict=True)
        for word, length in zip(quantity.axes, tail, strict=True)
    }
    for array, quantity in zip(arrays, function.inputs, strict=True):
        _check_tail(function, quantity, array, shapes)
    found = da.apply_gufunc(
        call,
        f"{ins}->{outs}",
        *arrays,
        output_dtypes=dtype if len(function.outputs) == 1 else [dtype] * len(function.outputs),
        output_sizes={f"d{word}": size for word, size in made.items()},
    )
    return found if isinstance(found, tuple) else (found,)


def _uncut(array: Any, axes: int) -> Any:
    """With one chunk along each of its last axes."""
    return array.rechunk({-k: -1 for k in range(1, axes + 1)})


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


def _check_tail(function: Signature, quantity: Quantity, array: Any, shapes: Mapping[str, int]) -> None:
    tail = tuple(shapes[axis] if axis in shapes else int(axis) for axis in quantity.axes)
    if array.shape[array.ndim - len(tail) :] != tail:
        expected = ", ".join(("...", *map(str, tail)))
        raise InputError(
            f"{function.name}: {quantity.name} has shape {array.shape}, expected ({expected})",
            "the last axes are those of one state",
        )


def by_names(
    call: Call, robot: RobotFacts, function: Signature, inputs: Sequence[Any]
) -> tuple[xr.DataArray, ...]:
    """The outputs as data arrays: joints along the dimension 'joint', matrices' columns along 'joint_column', and so on;
    every other dimension is one of states and broadcasts by its name. Names of joints are coordinates.

    call  takes the data, of NumPy or Dask, with the named dimensions last

    InputError where a dimension is missing, or a coordinate names other joints. Joints in another order are put in the
    robot's.
    """
    import xarray as xr

    arrays = [
        _in_order(robot, function, quantity, given) if is_labelled(given) else given
        for quantity, given in zip(function.inputs, inputs, strict=True)
    ]
    found = xr.apply_ufunc(
        call,
        *arrays,
        input_core_dims=[list(dimensions(quantity)) for quantity in function.inputs],
        output_core_dims=[list(dimensions(quantity)) for quantity in function.outputs],
        dask="allowed",
    )
    several = found if isinstance(found, tuple) else (found,)
    return tuple(
        _named(robot, output.name, array) for output, array in zip(function.outputs, several, strict=True)
    )


def dimensions(quantity: Quantity) -> tuple[str, ...]:
    """The names of a quantity's axes, each once."""
    names: list[str] = []
    for axis in quantity.axes:
        name = _DIMENSIONS.get(axis, f"axis_of_{axis}" if axis not in WORDS else axis)
        names.append(_COLUMNS.get(name, f"{name}_column") if name in names else name)
    return tuple(names)


def _in_order(robot: RobotFacts, function: Signature, quantity: Quantity, given: Any) -> Any:
    if not hasattr(given, "dims") or hasattr(given, "data_vars"):
        raise InputError(
            f"{function.name}: {quantity.name} is a {type(given).__name__}, expected a DataArray",
            "give one of its variables: dataset['q']",
        )
    missing = [name for name in dimensions(quantity) if name not in given.dims]
    if missing:
        raise InputError(
            f"{function.name}: {quantity.name} has dimensions {given.dims}, expected one called {missing[0]!r}",
            f"rename the one that runs along it: {quantity.name}.rename(old={missing[0]!r})",
        )
    if JOINT not in given.coords or given.coords[JOINT].dtype.kind not in "UOT":
        return given
    names = [str(name) for name in given.coords[JOINT].values]
    if sorted(names) != sorted(robot.joint_names):
        raise InputError(
            f"{function.name}: {quantity.name} is of joints {', '.join(map(repr, names))}",
            f"the robot has {', '.join(robot.joint_names)}",
        )
    return given.sel({JOINT: list(robot.joint_names)})


def _named(robot: RobotFacts, name: str, array: xr.DataArray) -> xr.DataArray:
    """With the joints' names where they are missing."""
    fits = [d for d in (JOINT, COLUMN) if d in array.dims and array.sizes[d] == len(robot.joint_names)]
    missing = [dimension for dimension in fits if dimension not in array.coords]
    named: xr.DataArray = array.assign_coords({dimension: list(robot.joint_names) for dimension in missing})
    return named.rename(name)
