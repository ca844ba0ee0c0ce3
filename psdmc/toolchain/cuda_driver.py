"""Calls the driver of NVIDIA's GPUs: memory, machine code and launches on one GPU. It uses the GPU's primary context, as
CuPy, PyTorch and JAX do."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError, ToolchainError

NAMES = ("libcuda.so.1", "nvcuda.dll")
"""Names of the driver's library on Linux and Windows."""

MAJOR, MINOR = 75, 76
"""Numbers of two attributes of a device: its compute capability."""

POINTERS_DEVICE = 9
"""Number of the attribute of an address: the device that has this memory."""

NO_SUCH_VALUE = 1
"""Status of a question about an address that no GPU knows."""

DEFAULT_STREAM = 1
"""Handle of the stream on which work without another stream runs."""


class Driver:
    """One GPU. Raises ToolchainError if the driver is missing, finds no such GPU or fails."""

    def __init__(self, ordinal: int) -> None:
        self.ordinal = ordinal
        self._cuda = _opened()
        self._call("cuInit", 0)
        count, self._device = ctypes.c_int(), ctypes.c_int()
        self._call("cuDeviceGetCount", ctypes.byref(count))
        if not 0 <= ordinal < count.value:
            raise InputError(
                f"there is no GPU {ordinal}: the driver finds {count.value}", "numbers begin with 0"
            )
        self._call("cuDeviceGet", ctypes.byref(self._device), ordinal)
        self._context = ctypes.c_void_p()
        self._call("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), self._device)

    @property
    def arch(self) -> int:
        """Return ten times the compute capability of the GPU, such as 90."""
        found = ctypes.c_int(), ctypes.c_int()
        for value, attribute in zip(found, (MAJOR, MINOR), strict=True):
            self._call("cuDeviceGetAttribute", ctypes.byref(value), attribute, self._device)
        return 10 * found[0].value + found[1].value

    def module(self, code: bytes) -> ctypes.c_void_p:
        """Load machine code, and return its handle."""
        module = ctypes.c_void_p()
        with self._current():
            self._call("cuModuleLoadData", ctypes.byref(module), code)
        return module

    def kernel(self, module: ctypes.c_void_p, symbol: str) -> ctypes.c_void_p:
        """Return the handle of a kernel by its name."""
        found = ctypes.c_void_p()
        with self._current():
            self._call("cuModuleGetFunction", ctypes.byref(found), module, symbol.encode())
        return found

    def launch(
        self, kernel: ctypes.c_void_p, blocks: int, threads: int, stream: int, arguments: Sequence[Any]
    ) -> None:
        """Start a kernel on a stream, and return without waiting. The arguments are ctypes objects."""
        places = (ctypes.c_void_p * len(arguments))(*(ctypes.addressof(each) for each in arguments))
        grid = [ctypes.c_uint(each) for each in (blocks, 1, 1, threads, 1, 1, 0)]
        with self._current():
            self._call("cuLaunchKernel", kernel, *grid, ctypes.c_void_p(stream), places, None)

    def wait(self, stream: int) -> None:
        """Wait until all work on a stream is done."""
        with self._current():
            self._call("cuStreamSynchronize", ctypes.c_void_p(stream))

    def allocated(self, size: int) -> int:
        """Return the address of new memory of this number of bytes."""
        place = ctypes.c_uint64()
        with self._current():
            self._call("cuMemAlloc_v2", ctypes.byref(place), ctypes.c_size_t(max(size, 1)))
        return place.value

    def free(self, place: int) -> None:
        """Wait until the GPU is idle, and free memory."""
        with self._current():
            self._call("cuCtxSynchronize")
            self._call("cuMemFree_v2", ctypes.c_uint64(place))

    def copy_in(self, place: int, array: NDArray[Any]) -> None:
        """Copy an array of the CPU to the GPU."""
        with self._current():
            source = array.ctypes.data_as(ctypes.c_void_p)
            self._call("cuMemcpyHtoD_v2", ctypes.c_uint64(place), source, ctypes.c_size_t(array.nbytes))

    def copy_out(self, place: int, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """Return memory of the GPU as a new array of the CPU."""
        array = np.empty(shape, dtype)
        with self._current():
            target = array.ctypes.data_as(ctypes.c_void_p)
            self._call("cuMemcpyDtoH_v2", target, ctypes.c_uint64(place), ctypes.c_size_t(array.nbytes))
        return array

    def device_of(self, place: int) -> int | None:
        """Return the number of the GPU that has memory at this address; None: it is memory of the CPU."""
        found = ctypes.c_int()
        with self._current():
            words = ctypes.byref(found), POINTERS_DEVICE, ctypes.c_uint64(place)
            status = self._cuda.cuPointerGetAttribute(*words)
            self._checked("cuPointerGetAttribute", 0 if status == NO_SUCH_VALUE else status)
        return None if status == NO_SUCH_VALUE else found.value

    @contextmanager
    def _current(self) -> Iterator[None]:
        """Make the GPU's context that of this thread."""
        self._call("cuCtxPushCurrent_v2", self._context)
        try:
            yield
        finally:
            self._cuda.cuCtxPopCurrent_v2(ctypes.byref(ctypes.c_void_p()))

    def _call(self, name: str, *given: Any) -> None:
        self._checked(name, getattr(self._cuda, name)(*given))

    def _checked(self, name: str, status: int) -> None:
        if status:
            text = ctypes.c_char_p()
            self._cuda.cuGetErrorString(status, ctypes.byref(text))
            said = (text.value or b"error %d" % status).decode()
            raise ToolchainError(
                f"{name}: the driver of the GPU says: {said}", "nvidia-smi shows the GPU's state"
            )


@cache
def _opened() -> Any:
    for name in NAMES:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise ToolchainError(
        'target "cuda" needs an NVIDIA GPU: its driver (libcuda) is not installed',
        "psdmc emit --backend cuda writes the source without a GPU",
    )
