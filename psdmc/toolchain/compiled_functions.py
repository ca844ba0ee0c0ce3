"""Calls the functions of a compiled package with NumPy arrays. Leading axes broadcast as in NumPy's ufuncs."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import cffi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError, ToolchainError
from psdmc.functions import no_function
from psdmc.program.kernel import GRAVITY, THETA_ROWS
from psdmc.program.signature import Signature
from psdmc.robot.mechanism import ROW_NAMES
from psdmc.toolchain.call_arguments import (
    RobotAxes,
    checked_outputs,
    common_lead,
    finite_states,
    has_rows,
    indefinite,
    parameters,
    states,
    takes_results,
    with_gravity,
    with_rows,
)
from psdmc.toolchain.interface import Interface, Origin, batch_symbol, single_symbol
from psdmc.toolchain.labelled_arrays import foreign, is_foreign, refuse_out
from psdmc.toolchain.stubs import result_name

MOST_NAMES = 8
"""Names that a repr lists."""

Vector = NDArray[np.float64]


class JointLimits(NamedTuple):
    """Limits of n joints as arrays (n,), rad or m and rates, N m or N; infinite if the file has none."""

    lower: Vector
    upper: Vector
    speed: Vector
    acceleration: Vector
    effort: Vector


class RobotFacts:
    """The properties of a compiled robot with n joints and l base parameters: names, sizes, limits and parameters."""

    def __init__(self, interface: Interface) -> None:
        self._interface = interface

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise no_function(self, name)

    @property
    def name(self) -> str:
        """Return the name of the robot in C. The names of all C functions of the robot begin with this name."""
        return self._interface.robot

    @property
    def n(self) -> int:
        """Return the number of joints. Mimic joints, which follow another joint, are not counted."""
        return self._interface.n

    @property
    def nq(self) -> int:
        """Return the number of entries of q. A joint with one coordinate has one entry, and a quaternion has four."""
        return self._interface.nq

    @property
    def nv(self) -> int:
        """Return the length of qd, qdd and tau: the number of joint rates."""
        return self._interface.nv

    @property
    def l(self) -> int:  # noqa: E743  the paper's letter
        """Return the number of base parameters, which is the length of theta_b."""
        return self._interface.l

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of the n joints, from base to tip."""
        return self._interface.joint_names

    @property
    def q_names(self) -> tuple[str, ...]:
        """Return the names of the nq entries of q, such as 'elbow', or 'root_joint.x' if a joint has several entries."""
        return self._interface.q_names

    @property
    def v_names(self) -> tuple[str, ...]:
        """Return the names of the nv entries of rates, accelerations and torques, such as 'elbow' or 'root_joint.vx'."""
        return self._interface.v_names

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Return the names of the named frames, in the order in which `forward_kinematics` returns their positions."""
        return self._interface.frame_names

    @property
    def contacts(self) -> dict[str, int]:
        """Return, by name of contact, the number of force components: 3 for a point, 6 for a surface (force, then moment).

        `constrained_forward_dynamics` and other functions return contact forces in the order of this dictionary.
        """
        return dict(self._interface.contacts)

    @property
    def loops(self) -> dict[str, tuple[str, ...]]:
        """Return a dictionary from each closed loop's name to the directions of relative motion that the loop blocks.

        A direction is 'x', 'y' or 'z' (along an axis of the loop's first frame), or 'rx', 'ry' or 'rz' (about an axis).
        In arrays of contact forces, the entries of the loops come after those of the contacts, in the order of this
        dictionary.
        """
        return {name: tuple(ROW_NAMES[row] for row in rows) for name, rows in self._interface.loops}

    @property
    def dtype(self) -> np.dtype[np.float64] | np.dtype[np.float32]:
        """Return the NumPy type of all results: float64 or float32."""
        single, double = np.dtype(np.float32), np.dtype(np.float64)
        return single if self._interface.dtype == "float32" else double

    @property
    def functions(self) -> tuple[str, ...]:
        """Return the names of the functions that are compiled so far, such as 'inverse_dynamics'."""
        return tuple(dict.fromkeys(name.removesuffix("_theta") for name in self._interface.kernels))

    @cached_property
    def limits(self) -> JointLimits:
        """Return the joint limits of the robot file: lower, upper, speed, acceleration and effort, each of shape (n,).

        A limit that the file does not give is infinite. The robot's functions do not check the limits.
        """
        columns = np.array(self._interface.limits, np.float64).T
        return JointLimits(*(_frozen(column) for column in columns))

    @cached_property
    def gravity_acceleration(self) -> Vector:
        """Return the acceleration of gravity that the code contains, (3,), m/s^2, along the axes of the base frame.

        If the robot has a floating base, the axes are those of the world frame.
        """
        return _frozen(self._interface.gravity)

    @cached_property
    def theta_b(self) -> Vector | None:
        """Return the base parameters that the code contains, (l,), SI units, or None if they are unknown.

        If the base parameters are unknown, pass `theta_b` in each call.
        """
        values = self._interface.theta_b
        return None if values is None else _frozen(values)

    def __repr__(self) -> str:
        return "\n  ".join([self._title, *self._facts()])

    def _repr_html_(self) -> str:
        facts = "".join(f"<li>{escape(fact)}</li>" for fact in self._facts())
        return f"<div><p><b>{escape(self._title)}</b></p><ul>{facts}</ul></div>"

    @property
    def _title(self) -> str:
        return f"{type(self).__name__} {self.name!r}: {self.n} joints, {self._interface.dtype}"

    def _facts(self) -> list[str]:
        lengths = [] if self.nq == self.nv == self.n else [f"nq = {self.nq}, nv = {self.nv}"]
        gravity = " ".join(f"{value:g}" for value in self._interface.gravity)
        compiled_in = "given in calls" if self._interface.theta_b is None else "compiled in"
        return [
            f"joints: {_listed(map(repr, self.joint_names))}",
            *lengths,
            f"gravity: {gravity} m/s^2 in the {self._interface.base_frame}",
            f"l = {self.l} base parameters, {compiled_in}",
            f"functions: {_listed(self.functions)}",
        ]


def _listed(names: Iterable[str]) -> str:
    found = tuple(names)
    more = len(found) - MOST_NAMES
    return ", ".join(found[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _frozen(values: object) -> Vector:
    array = np.array(values, np.float64)
    array.setflags(write=False)
    return array


Array = NDArray[Any]


class CompiledFunctions(RobotFacts):
    """Calls the C functions of a compiled package with NumPy arrays. The signature of a function says which inputs and
    outputs it has.

    more    function that compiles a generated function, by name, that the package does not have; None: such a call
            fails
    origin  the request from which another process builds the same robot; None: the robot cannot be pickled
    """

    def __init__(
        self,
        interface: Interface,
        library: Path,
        more: Callable[[str], CompiledFunctions] | None = None,
        origin: Origin | None = None,
    ) -> None:
        super().__init__(interface)
        self._ffi = cffi.FFI()
        self._ffi.cdef(interface.cdef)
        self._library = _opened(self._ffi, library, interface.robot)
        self._robot = interface.robot
        self._sizes = interface.sizes
        self._units = interface.units
        self._axes = RobotAxes(interface.sizes, interface.names, interface.units)
        self._dtype = np.dtype(interface.dtype)
        self._pointer = self._ffi.typeof(f"{interface.real} *")
        self._kernels = {
            name: _Kernel(
                interface.kernels[name],
                getattr(self._library, batch_symbol(interface.robot, name)),
                getattr(self._library, single_symbol(interface.robot, name), None),
            )
            for name in interface.kernels
        }
        self._patterns = dict(interface.patterns)
        self.library = library
        self._more = more
        self._origin = origin
        self._others: list[CompiledFunctions] = []  # whose libraries stay open as long as this one's
        self._bind(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the request that the robot was compiled for, its model included, without machine code."""
        if self._origin is None:
            raise TypeError(f"{self.name}: only robots from psdmc.compile can be pickled")
        return self._origin.again, (self._origin.request,)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: object) -> Self:
        """Itself: nothing about a compiled robot can be changed."""
        return self

    def __dask_tokenize__(self) -> tuple[str, str]:
        """Return the key by which Dask recognises equal robots."""
        return ("psdmc.CompiledRobot", self._origin.key if self._origin else str(self.library))

    def call(
        self,
        function: Signature,
        inputs: Sequence[ArrayLike],
        theta_b: ArrayLike | None = None,
        out: Any = None,
        gravity: ArrayLike | None = None,
    ) -> Any:
        """Call a generated function by its entry in `psdmc.functions.SIGNATURES`, and return the result.

        For example, `robot.call(SIGNATURES["gravity"], [q])` returns the same as `robot.gravity(q)`.

        function  an entry of `psdmc.functions.SIGNATURES`
        inputs    the inputs of the function, as a list of arrays
        theta_b   base parameters that replace those in the code, (l,), or (..., l), one set per state; optional
        out       array into which psdmc writes the result, or a tuple of arrays for several results; optional
        gravity   (3,), or (..., 3), one gravity per state, for a robot compiled with `gravity_input=True`; optional
        """
        function, inputs = self.with_gravity(function, inputs, gravity)
        variant = "" if theta_b is None else "_theta"
        if has_rows(function, theta_b):
            variant = THETA_ROWS
            function, inputs, theta_b = with_rows(function), (*inputs, theta_b), None  # type: ignore[arg-type]
        if any(map(is_foreign, inputs)):
            return self._foreign(function, self._kernel(function.name + variant), inputs, theta_b, out)
        arrays = states(function, self._axes, inputs, self._dtype)
        lead = common_lead(function, arrays)
        kernel = self._kernel(function.name + variant)
        rows = self._rows(lead, function, arrays)
        if theta_b is not None:
            rows.append(parameters(function, self._sizes.l, theta_b, self._dtype))
        shapes = [lead + tail for tail in kernel.tails]
        kept = () if out is None else checked_outputs(function, out, shapes, self._dtype)
        is_direct = bool(kept) and all(takes_results(array, rows) for array in kept)
        outs = kept if is_direct else tuple(np.empty(shape, self._dtype) for shape in shapes)
        failed = kernel.batch(math.prod(lead), *map(self._address, rows), *map(self._address, outs))
        if failed and function.raises:
            self._refuse_indefinite(function, kernel, lead, rows, outs)
        if kept and not is_direct:
            for array, values in zip(kept, outs, strict=True):
                array[...] = values
        outs = kept or outs
        return outs[0] if len(outs) == 1 else results(function)(*outs)

    def with_gravity(
        self, function: Signature, inputs: Sequence[Any], gravity: Any = None
    ) -> tuple[Signature, tuple[Any, ...]]:
        """Return a function's signature and inputs, with gravity as the last input if the package has it there. Without
        `gravity`, this is the model's. Raises InputError if gravity is given and no input."""
        own = list(self._interface.gravity) if self._interface.gravity_input else None
        return with_gravity(self._robot, function, inputs, gravity, own)

    def pattern(self, name: str) -> tuple[Array, Array]:
        """Return the row indices and the column indices, (k,) each, of the k matrix entries that can differ from zero.

        For example, after `rows, columns = robot.pattern('mass_matrix_packed')`, the array
        `robot.mass_matrix(q)[..., rows, columns]` equals `robot.mass_matrix_packed(q)`.

        name  name of a function that returns one matrix, such as 'mass_matrix', 'regressor' or 'regressor_packed'

        Raises InputError if the function does not return one matrix, or is not compiled.
        """
        self._kernel(name)
        if name not in self._patterns:
            matrices = ", ".join(self._patterns)
            raise InputError(
                f"{self._robot}: {name} is no function of one matrix", f"compiled are {matrices or 'none'}"
            )
        rows, columns = np.array(self._patterns[name], dtype=np.intp).reshape(-1, 2).T
        return rows, columns

    def _refuse_indefinite(
        self,
        function: Signature,
        kernel: _Kernel,
        lead: tuple[int, ...],
        rows: Sequence[Array],
        outs: Sequence[Array],
    ) -> None:
        """InputError for the first state, of finite inputs, in which a matrix is not positive definite that has an error."""
        tails = [self._sizes.shape(quantity.axes) for quantity in function.inputs]
        assert kernel.single is not None
        given = [row.reshape(lead + tail) for row, tail in zip(rows, tails, strict=False)]
        failed = finite_states(function, given) & np.isnan(outs[0]).reshape(*lead, -1).any(axis=-1)
        for state in map(tuple, np.argwhere(failed).tolist()):
            one = [np.ascontiguousarray(row[state]) for row in given] + list(rows[len(given) :])
            unused = [np.empty(tail, self._dtype) for tail in kernel.tails]
            number = kernel.single(*map(self._address, one), *map(self._address, unused))
            error = indefinite(function, self._axes, number - 1, given, state)
            if error:
                raise error

    def _foreign(
        self,
        function: Signature,
        kernel: _Kernel,
        inputs: Sequence[Any],
        theta_b: ArrayLike | None,
        out: Any,
    ) -> Any:
        """The outputs as Dask's or xarray's arrays, as the inputs are."""
        refuse_out(function, out)
        gravity = function.inputs.index(GRAVITY) if GRAVITY in function.inputs else None
        call = OnArrays(self, function.name, theta_b, gravity)
        found = foreign(call, self._axes, function, inputs, kernel.tails, self._dtype)
        return found[0] if len(found) == 1 else results(function)(*found)

    def _kernel(self, name: str) -> _Kernel:
        found = self._kernels.get(name)
        if found is None and f"{name}_theta" not in self._kernels and self._more is not None:
            other = self._more(name.removesuffix("_theta"))
            self._others.append(other)
            self._kernels = other._kernels | self._kernels
            self._patterns = other._patterns | self._patterns
            self._bind(other)
            found = self._kernels.get(name)
        if found is None and f"{name}_theta" in self._kernels:
            raise InputError(
                f"{self._robot}: {name} wants parameters, and this model's theta_b is unknown",
                f"give theta_b=, {self._sizes.l} numbers; psdmc calibrate finds them from logs",
            )
        if found is None:
            compiled = ", ".join(self._kernels)
            raise InputError(
                f"{self._robot}: {name} was not compiled",
                f"add {name.removesuffix('_theta')!r} to the argument functions of psdmc.compile; compiled are {compiled}",
            )
        return found

    def _bind(self, compiled: CompiledFunctions) -> None:
        """Take over what is called without a detour through Python; here nothing is."""

    def _tails_of(self, function: str) -> tuple[tuple[int, ...], ...]:
        """Trailing axes of each output of a function that the library has, with parameters compiled in or given."""
        kernels = self._kernels
        return (kernels[function] if function in kernels else kernels[f"{function}_theta"]).tails

    def call_at(self, kernel: str, count: int, addresses: Sequence[int]) -> None:
        """Compute `count` states from memory addresses of the arrays: those of the inputs, then theta_b, then the
        outputs. An array has the states in contiguous rows.

        Nothing is checked. If a matrix is not positive definite, the results of that state are NaN.
        """
        self._kernel(kernel).batch(count, *(self._ffi.cast(self._pointer, address) for address in addresses))

    def tails(self, kernel: str) -> tuple[tuple[int, ...], ...]:
        """Return for each output of a generated function the shape for one state, without batch axes."""
        return self._kernel(kernel).tails

    def address_of(self, kernel: str) -> int:
        """Return the memory address of a batch function in C, such as 'gravity' or 'gravity_theta'.

        psdmc compiles the function if that has not been done. The address is valid as long as the robot object exists.
        """
        return int(self._ffi.cast("uintptr_t", self._kernel(kernel).batch))

    def _rows(self, lead: tuple[int, ...], function: Signature, arrays: Sequence[Array]) -> list[Array]:
        """The arrays as contiguous rows of the common leading shape."""
        tails = [
            array.shape[array.ndim - len(q.axes) :] for q, array in zip(function.inputs, arrays, strict=True)
        ]
        whole = (
            array if array.shape == lead + tail else np.broadcast_to(array, lead + tail)
            for tail, array in zip(tails, arrays, strict=True)
        )
        return [np.ascontiguousarray(array) for array in whole]

    def _address(self, array: Array) -> Any:
        return self._ffi.from_buffer(self._pointer, array)


@dataclass(frozen=True, slots=True)
class OnArrays:
    """A function of a robot, with optional base parameters theta_b, that can be called with arrays. The object can be
    pickled and sent to other processes.

    gravity  number of the array that is gravity; None: none is
    """

    robot: CompiledFunctions
    function: str
    theta_b: ArrayLike | None
    gravity: int | None

    def __call__(self, *arrays: Any) -> Any:
        named = {} if self.theta_b is None else {"theta_b": self.theta_b}
        if self.gravity is not None:
            named["gravity"] = arrays[self.gravity]
            arrays = (*arrays[: self.gravity], *arrays[self.gravity + 1 :])
        return getattr(self.robot, self.function)(*arrays, **named)


def _opened(ffi: cffi.FFI, library: Path, robot: str) -> Any:
    try:
        return ffi.dlopen(str(library))
    except OSError as error:
        raise ToolchainError(
            f"{robot}: the compiled library cannot be loaded: {error}",
            "set CC to a compiler that makes libraries for this machine, or unset it",
        ) from error


@dataclass(frozen=True, slots=True)
class _Kernel:
    """One compiled kernel: its batch function in C, that for one state of a function that raises errors, and the trailing
    axes of its results."""

    tails: tuple[tuple[int, ...], ...]
    batch: Callable[..., int | None]
    single: Callable[..., int] | None


@cache
def results(function: Signature) -> Any:
    """Return the named tuple class for the results of a function with several outputs."""
    return namedtuple(result_name(function), [output.name for output in function.outputs])
