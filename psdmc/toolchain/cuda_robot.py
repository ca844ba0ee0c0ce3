"""A robot whose functions run on an NVIDIA GPU. `psdmc.compile(model, target="cuda")` makes such robots.

Their inputs and results are arrays in the memory of the GPU. CuPy, PyTorch and JAX pass them by the CUDA array interface
or DLPack.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from psdmc.backends.cuda.back_end import BLOCK, symbol_of
from psdmc.errors import InputError
from psdmc.functions import SIGNATURES
from psdmc.program.kernel import GRAVITY, THETA_ROWS, THETAS
from psdmc.program.signature import Quantity, Signature
from psdmc.toolchain.call_arguments import THETA_B, bound_arguments, with_gravity
from psdmc.toolchain.compiled_functions import RobotFacts, results
from psdmc.toolchain.cuda_libraries import DEFAULT_STREAM, Driver, machine_code
from psdmc.toolchain.interface import Interface
from psdmc.toolchain.stubs import documentation

ON_CUDA = 2, 13
"""Numbers of DLPack for a GPU's memory, and for memory that CPU and GPU share."""

LETTERS = {0: "i", 1: "u", 2: "f", 5: "c", 6: "b"}
"""NumPy's letters for the kinds of numbers of DLPack."""


@dataclass(frozen=True, slots=True)
class Seen:
    """An array of another library. `strides` counts bytes; `kept` must live as long as the array is used."""

    place: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    strides: tuple[int, ...] | None
    is_fixed: bool
    stream: int | None = None
    kept: Any = None

    @property
    def is_contiguous(self) -> bool:
        """Return whether the entries lie one after the other. NumPy judges it by shape and strides alone."""
        return bool(as_strided(np.empty((), self.dtype), self.shape, self.strides).flags.c_contiguous)


def seen(what: str, given: Any, stream: int) -> Seen:
    """Return address, shape and type of an array on a GPU, without a copy. Raises InputError for anything else.

    stream  on which the array will be used
    """
    face = getattr(given, "__cuda_array_interface__", None)
    if face is not None:
        (place, is_fixed), strides = face["data"], face.get("strides")
        own = (tuple(face["shape"]), np.dtype(face["typestr"]), strides and tuple(strides), bool(is_fixed))
        return Seen(place or 0, *own, face.get("stream"))
    if hasattr(given, "__dlpack__") and given.__dlpack_device__()[0] in ON_CUDA:
        return _of_capsule(given.__dlpack__(stream=stream))
    raise InputError(
        f"{what} is a {type(given).__name__} in the CPU's memory, expected an array in the memory of the GPU",
        'move it there, for example with cupy.asarray, torch.Tensor.to("cuda") or jax.device_put',
    )


class _Tensor(ctypes.Structure):
    """The beginning of DLPack's DLManagedTensor."""

    _fields_ = (
        ("data", ctypes.c_uint64),
        ("device", ctypes.c_int32 * 2),
        ("ndim", ctypes.c_int32),
        ("kind", ctypes.c_uint8),
        ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("offset", ctypes.c_uint64),
    )


def _of_capsule(capsule: Any) -> Seen:
    read = ctypes.pythonapi.PyCapsule_GetPointer
    read.restype, read.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    tensor = _Tensor.from_address(read(capsule, b"dltensor"))
    dtype = np.dtype(f"{LETTERS.get(tensor.kind, 'V')}{tensor.bits // 8}")
    steps = tensor.strides[: tensor.ndim] if tensor.strides else None
    strides = None if steps is None else tuple(dtype.itemsize * step for step in steps)
    place, shape = tensor.data + tensor.offset, tuple(tensor.shape[: tensor.ndim])
    return Seen(place, shape, dtype, strides, is_fixed=False, kept=capsule)


class DeviceArray:
    """A result in the memory of a GPU. CuPy, PyTorch and JAX take it without a copy: `cupy.asarray(x)`,
    `torch.as_tensor(x, device="cuda")`, `jax.numpy.asarray(x)`. `x.numpy()` copies it to the CPU.

    shape, dtype  as of a NumPy array
    place         address on the GPU
    stream        handle of the stream on which it is computed
    kept          arrays that live as long as this one
    """

    def __init__(
        self, driver: Driver, shape: tuple[int, ...], dtype: np.dtype[Any], stream: int = DEFAULT_STREAM
    ) -> None:
        self.shape, self.dtype, self.stream = shape, dtype, stream
        self.kept: Any = None
        self._driver = driver
        self.place = driver.allocated(math.prod(shape) * dtype.itemsize)

    def __del__(self) -> None:
        with suppress(Exception):  # at the end of a program, the driver may be gone before
            self._driver.free(self.place)

    @classmethod
    def of(cls, driver: Driver, array: NDArray[Any]) -> DeviceArray:
        """Return a copy of an array of the CPU."""
        made = cls(driver, array.shape, array.dtype)
        driver.copy_in(made.place, np.ascontiguousarray(array))
        return made

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        """Return the description of the array by which other libraries read it."""
        place, text = (self.place, False), self.dtype.str
        return {"shape": self.shape, "typestr": text, "data": place, "version": 3, "stream": self.stream}

    def numpy(self) -> NDArray[Any]:
        """Wait for the result, and return a copy as a NumPy array."""
        self._driver.wait(self.stream)
        return self._driver.copy_out(self.place, self.shape, self.dtype)

    def __repr__(self) -> str:
        return f"DeviceArray {self.shape} {self.dtype} on GPU {self._driver.ordinal}"


OF_MODEL = object()
"""Stands for the gravity of the model, if a call gives no other."""


@dataclass(frozen=True, slots=True)
class CudaSource:
    """The CUDA source of some functions of a robot, of which the kernels are R_NAME_rows.

    robot      prefix of all its names, R
    interface  names, sizes and results of the functions
    failing    functions whose kernels have the argument `status`
    """

    text: str
    robot: str
    interface: Interface
    failing: frozenset[str]


class CudaRobot(RobotFacts):
    """A robot whose methods, one for each generated function, compute on an NVIDIA GPU, a state in each thread.

    Inputs are arrays in the memory of the GPU, of CuPy, PyTorch, JAX or another library with the CUDA array interface or
    DLPack. They are not copied. All inputs have the same axes in front of those of one state, and the robot's dtype. Inputs
    with one number per state, such as a time step, theta_b and gravity can also be numbers or NumPy arrays, which are
    copied. theta_b has the shape (l,), or (..., l) for one per state.

    All methods have more arguments:

    out     array of the GPU into which psdmc writes the result, or a tuple of arrays, which overlap no input. Without it,
            results are DeviceArrays
    stream  stream on which the function runs, of CuPy or PyTorch, or its handle; None: the default stream
    gravity  acceleration of gravity in m/s^2, (3,) from the CPU or (..., 3), along the axes of the base frame. Only robots
            that were compiled with gravity_input=True take it. Without it, gravity is that of the model

    The methods return without waiting for the GPU. Only calls that copy an input and have the argument `out` wait. If a
    matrix such as the mass matrix is not positive definite, the results of this state are NaN. Quaternions in q must have
    length one: psdmc does not check them.
    """

    def __init__(self, source: CudaSource, driver: Driver, more: Callable[[str], CudaSource] | None) -> None:
        super().__init__(source.interface)
        self._driver, self._more = driver, more
        self._kernels: dict[str, tuple[ctypes.c_void_p, bool]] = {}
        self._own_gravity: DeviceArray | None = None
        self._add(source)

    def _add(self, source: CudaSource) -> None:
        """Compile further functions. A kernel has a handle, and may have the argument `status`."""
        own = source.interface.kernels
        code = machine_code(source.text, f"{source.robot}_KERNELS", self._driver.arch)
        handles = self._driver.kernels(code, [f"{symbol_of(source.robot, name)}_rows" for name in own])
        pairs = zip(own, handles, strict=True)
        self._kernels |= {name: (handle, name in source.failing) for name, handle in pairs}
        self._interface = replace(source.interface, kernels={**self._interface.kernels, **own})

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Callable[..., Any]: ...

    def __reduce__(self) -> Any:
        raise TypeError(
            'a CudaRobot cannot be pickled: call psdmc.compile(model, target="cuda") in each process'
        )

    def call(
        self,
        function: Signature,
        inputs: Sequence[Any],
        theta_b: Any = None,
        out: Any = None,
        stream: Any = None,
        gravity: Any = None,
    ) -> Any:
        """Call a generated function; `function` is an entry of `psdmc.functions.SIGNATURES`."""
        handle = handle_of(stream)
        own = OF_MODEL if self._interface.gravity_input else None
        function, inputs = with_gravity(self.name, function, inputs, gravity, own)
        named = list(zip(function.inputs, inputs, strict=True))
        variant = ""
        if theta_b is not None:
            has_rows = len(_shape(f"{function.name}: theta_b", theta_b, handle)) > 1
            variant = THETA_ROWS if has_rows else "_theta"
            named.append((THETAS if has_rows else THETA_B, theta_b))
        name = function.name + variant
        kernel, has_status = self._kernel(name)
        lead, arrays, copies = self._arrays(function, named, handle)
        outs = self._results(function, [lead + tail for tail in self._interface.kernels[name]], out, handle)
        places = [each.place for each in (*arrays, *(seen("", each, handle) for each in outs))]
        words: list[Any] = [ctypes.c_uint64(place) for place in (*places, *([0] if has_status else []))]
        states = math.prod(lead)
        if states:
            words.append(ctypes.c_longlong(states))
            self._driver.launch(kernel, -(-states // BLOCK), BLOCK, handle, words)
        if out is None:
            outs[0].kept = copies
        return outs[0] if len(outs) == 1 else results(function)(*outs)

    def _arrays(
        self, function: Signature, named: Sequence[tuple[Quantity, Any]], stream: int
    ) -> tuple[tuple[int, ...], list[Seen], list[DeviceArray]]:
        """The states' leading axes, the inputs, and those that are copies."""
        what = [f"{function.name}: {(THETA_B if q is THETAS else q).name}" for q, _ in named]
        found = [
            None if _is_of_cpu(quantity, given) else seen(name, given, stream)
            for name, (quantity, given) in zip(what, named, strict=True)
        ]
        leads = [
            each.shape[: max(len(each.shape) - len(quantity.axes), 0)]
            for each, (quantity, _) in zip(found, named, strict=True)
            if each is not None and quantity is not THETA_B
        ]
        lead = leads[0] if leads else ()
        copies: list[DeviceArray] = []
        for k, (quantity, given) in enumerate(named):
            tail = self._interface.sizes.shape(quantity.axes)
            whole = tail if quantity is THETA_B else lead + tail
            if given is OF_MODEL:
                found[k] = self._gravity_of(lead, stream)
                continue
            array = found[k]
            if array is None:
                copies.append(DeviceArray.of(self._driver, self._copied(what[k], quantity, given, whole)))
                array = seen(what[k], copies[-1], stream)
            found[k] = self._checked(what[k], array, whole, stream)
        return lead, [each for each in found if each is not None], copies

    def _gravity_of(self, lead: tuple[int, ...], stream: int) -> Seen:
        """The model's gravity for each state. It is kept for further calls with as many states."""
        if self._own_gravity is None or self._own_gravity.shape[:-1] != lead:
            whole = np.full((*lead, 3), self._interface.gravity, self.dtype)
            self._own_gravity = DeviceArray.of(self._driver, whole)
        return seen("gravity", self._own_gravity, stream)

    def _copied(self, what: str, quantity: Quantity, given: Any, shape: tuple[int, ...]) -> Any:
        """Numbers of the CPU as an array of this shape, and of the robot's dtype."""
        array = np.asarray(given, self.dtype)
        repeats = quantity is GRAVITY or not quantity.axes or quantity.default is not None
        single = shape[-1:] if quantity is GRAVITY else ()
        if array.shape != shape and not (repeats and array.shape == single):
            raise InputError(f"{what} has shape {array.shape}, expected {shape}", "give an array")
        return np.full(shape, array)

    def _checked(self, what: str, array: Seen, shape: tuple[int, ...], stream: int) -> Seen:
        """An array of the right shape, type and place. Work of its library on another stream is waited for."""
        if array.dtype != self.dtype:
            raise InputError(
                f"{what} has dtype {array.dtype}, expected {self.dtype}", f'compile with real="{array.dtype}"'
            )
        if array.shape != shape:
            raise InputError(
                f"{what} has shape {array.shape}, expected {shape}", "all inputs have the same leading axes"
            )
        if not array.is_contiguous:
            raise InputError(
                f"{what} has strides {array.strides}, expected contiguous rows", "copy the array first"
            )
        where = self._driver.device_of(array.place) if 0 not in shape else self._driver.ordinal
        if where != self._driver.ordinal:
            place = "in the CPU's memory" if where is None else f"on GPU {where}"
            raise InputError(
                f"{what} is {place}, expected GPU {self._driver.ordinal}",
                'move the array, or compile for target "cuda:N"',
            )
        if array.stream not in (None, stream):
            self._driver.wait(array.stream or DEFAULT_STREAM)
        return array

    def _results(
        self, function: Signature, shapes: Sequence[tuple[int, ...]], out: Any, stream: int
    ) -> list[Any]:
        """New arrays, or those that the caller gives."""
        if out is None:
            return [DeviceArray(self._driver, shape, self.dtype, stream) for shape in shapes]
        given = list(out) if isinstance(out, tuple) else [out]
        if len(given) != len(shapes):
            raise InputError(
                f"{function.name}: out has {len(given)} arrays, expected {len(shapes)}", "give a tuple"
            )
        for array, shape in zip(given, shapes, strict=True):
            what = f"{function.name}: out"
            if self._checked(what, seen(what, array, stream), shape, stream).is_fixed:
                raise InputError(f"{what} is read-only", "give an array that can be written")
        return given

    def _kernel(self, name: str) -> tuple[ctypes.c_void_p, bool]:
        stem = name.removesuffix("_theta")  # a name that ends in _theta_rows is a function of its own
        if stem not in self._kernels and f"{stem}_theta" not in self._kernels and self._more is not None:
            self._add(self._more(stem))
        if name not in self._kernels:
            hint = f"compiled are {', '.join(self._kernels)}: add {name} or others to the argument functions"
            raise InputError(f"{self.name}: {name} was not compiled for the GPU", hint)
        return self._kernels[name]


def _is_of_cpu(quantity: Quantity, given: Any) -> bool:
    """Whether an input is numbers of the CPU, which a call copies."""
    is_copied = quantity in (THETA_B, THETAS, GRAVITY)
    return (
        given is OF_MODEL
        or np.isscalar(given)
        or (is_copied and isinstance(given, (np.ndarray, list, tuple)))
    )


def _shape(what: str, given: Any, stream: int) -> tuple[int, ...]:
    return (
        np.shape(given) if isinstance(given, (list, tuple, np.ndarray)) else seen(what, given, stream).shape
    )


def handle_of(stream: Any) -> int:
    """Return the handle of a stream: an integer, or a stream object of CuPy or PyTorch. Raises InputError for others."""
    found = DEFAULT_STREAM if stream is None else stream
    for name in ("ptr", "cuda_stream"):
        found = getattr(found, name, found)
    if not isinstance(found, int):
        raise InputError(
            f"stream is a {type(stream).__name__}", "give a stream of CuPy or PyTorch, or its handle"
        )
    return found or DEFAULT_STREAM


def _method(function: Signature) -> Callable[..., Any]:
    def method(self: CudaRobot, *given: Any, stream: Any = None, gravity: Any = None, **named: Any) -> Any:
        inputs, theta_b, out = bound_arguments(function, given, named)
        return self.call(function, inputs, theta_b, out, stream, gravity)

    method.__name__, method.__doc__ = function.name, documentation(function)
    method.__qualname__ = f"{CudaRobot.__name__}.{function.name}"
    return method


for _function in SIGNATURES.values():
    setattr(CudaRobot, _function.name, _method(_function))
