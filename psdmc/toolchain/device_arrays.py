"""Arrays in the memory of a GPU: what CuPy, PyTorch and JAX pass by the CUDA array interface or DLPack, and results."""

from __future__ import annotations

import ctypes
import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.toolchain.cuda_driver import DEFAULT_STREAM, Driver

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
