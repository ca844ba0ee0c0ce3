"""Calls NVIDIA's libraries: the driver, for memory, machine code and launches on one GPU, and the compiler NVRTC.

The driver uses the GPU's primary context, as CuPy, PyTorch and JAX do.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError, InternalError, ToolchainError

DRIVERS = ("libcuda.so.1", "nvcuda.dll")
"""Names of the driver's library on Linux and Windows."""

MAJOR, MINOR = 75, 76
"""Numbers of two attributes of a device: its compute capability."""

POINTERS_DEVICE, NO_VALUE = 9, 1
"""Number of the attribute of an address that names its GPU, and status if the address belongs to no GPU."""

LONGEST_NAME = 100
"""Characters of the name of a GPU that are kept."""

DEFAULT_STREAM = 1
"""Handle of the stream on which work without another stream runs."""


class Driver:
    """One GPU. Raises ToolchainError if the driver is missing or fails, InputError if there is no GPU of this number."""

    def __init__(self, ordinal: int) -> None:
        self.ordinal, self._cuda = ordinal, driver_library()
        count, device = ctypes.c_int(), ctypes.c_int()
        self._context = ctypes.c_void_p()
        self._check("cuInit", 0)
        self._check("cuDeviceGetCount", ctypes.byref(count))
        if not 0 <= ordinal < count.value:
            raise InputError(
                f"there is no GPU {ordinal}: the driver finds {count.value}", "numbers begin with 0"
            )
        self._check("cuDeviceGet", ctypes.byref(device), ordinal)
        self._check("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), device)
        self.arch = sum(
            scale * self._attribute(number, device) for scale, number in ((10, MAJOR), (1, MINOR))
        )
        """Ten times the compute capability of the GPU, such as 90."""
        text = ctypes.create_string_buffer(LONGEST_NAME)
        self._check("cuDeviceGetName", text, LONGEST_NAME, device)
        self.name = text.value.decode()
        """Name of the GPU, such as NVIDIA H200."""

    def kernels(self, code: bytes, symbols: Sequence[str]) -> list[ctypes.c_void_p]:
        """Load machine code, and return the handles of its kernels by their names."""
        module, found = ctypes.c_void_p(), [ctypes.c_void_p() for _ in symbols]
        self._call("cuModuleLoadData", ctypes.byref(module), code)
        for handle, symbol in zip(found, symbols, strict=True):
            self._call("cuModuleGetFunction", ctypes.byref(handle), module, symbol.encode())
        return found

    def launch(
        self, kernel: ctypes.c_void_p, blocks: int, threads: int, stream: int, given: list[Any]
    ) -> None:
        """Start a kernel on a stream, and return without waiting. The arguments are ctypes objects."""
        places = (ctypes.c_void_p * len(given))(*map(ctypes.addressof, given))
        grid = map(ctypes.c_uint, (blocks, 1, 1, threads, 1, 1, 0))
        self._call("cuLaunchKernel", kernel, *grid, ctypes.c_void_p(stream), places, None)

    def wait(self, stream: int) -> None:
        """Wait until all work on a stream is done."""
        self._call("cuStreamSynchronize", ctypes.c_void_p(stream))

    def allocated(self, size: int) -> int:
        """Return the address of new memory of this number of bytes."""
        place = ctypes.c_uint64()
        self._call("cuMemAlloc_v2", ctypes.byref(place), ctypes.c_size_t(max(size, 1)))
        return place.value

    def free(self, place: int) -> None:
        """Wait until the GPU is idle, and free memory."""
        self._call("cuCtxSynchronize")
        self._call("cuMemFree_v2", ctypes.c_uint64(place))

    def copy_in(self, place: int, array: NDArray[Any]) -> None:
        """Copy a contiguous array of the CPU to the GPU."""
        size = ctypes.c_size_t(array.nbytes)
        self._call("cuMemcpyHtoD_v2", ctypes.c_uint64(place), ctypes.c_void_p(array.ctypes.data), size)

    def copy_out(self, place: int, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """Return memory of the GPU as a new array of the CPU."""
        array = np.empty(shape, dtype)
        size = ctypes.c_size_t(array.nbytes)
        self._call("cuMemcpyDtoH_v2", ctypes.c_void_p(array.ctypes.data), ctypes.c_uint64(place), size)
        return array

    def copy(self, to: int, place: int, size: int, stream: int) -> None:
        """Start a copy of `size` bytes from one address of the GPU to another one."""
        words = ctypes.c_uint64(to), ctypes.c_uint64(place), ctypes.c_size_t(size)
        self._call("cuMemcpyDtoDAsync_v2", *words, ctypes.c_void_p(stream))

    def device_of(self, place: int) -> int | None:
        """Return the number of the GPU that has memory at this address; None: it is memory of the CPU."""
        found = ctypes.c_int()
        words = ctypes.byref(found), POINTERS_DEVICE, ctypes.c_uint64(place)
        is_known = self._call("cuPointerGetAttribute", *words, allowed=NO_VALUE) == 0
        return found.value if is_known else None

    def _attribute(self, number: int, device: ctypes.c_int) -> int:
        value = ctypes.c_int()
        self._check("cuDeviceGetAttribute", ctypes.byref(value), number, device)
        return value.value

    def _call(self, name: str, *given: Any, allowed: int = 0) -> int:
        """Call a function of the driver for this GPU, whatever GPU the thread used before."""
        self._check("cuCtxPushCurrent_v2", self._context)
        try:
            return self._check(name, *given, allowed=allowed)
        finally:
            self._cuda.cuCtxPopCurrent_v2(ctypes.byref(ctypes.c_void_p()))

    def _check(self, name: str, *given: Any, allowed: int = 0) -> int:
        status = int(getattr(self._cuda, name)(*given))
        if status not in (0, allowed):
            text = ctypes.c_char_p()
            self._cuda.cuGetErrorString(status, ctypes.byref(text))
            said = (text.value or b"unknown error").decode()
            raise ToolchainError(
                f"{name}: the driver of the GPU says: {said}", "nvidia-smi shows the GPU's state"
            )
        return status


@cache
def driver_library() -> Any:
    """Return the library of the driver. Raises ToolchainError if it is not installed."""
    fault = 'target "cuda" needs an NVIDIA GPU: its driver (libcuda) is not installed'
    return _opened(DRIVERS, fault, "psdmc emit --backend cuda writes the source without a GPU")


def _opened(names: Iterable[str], fault: str, hint: str) -> Any:
    """The first of these libraries that the system has."""
    for name in names:
        with suppress(OSError):
            return ctypes.CDLL(name)
    raise ToolchainError(fault, hint)


# NVRTC, which compiles CUDA source to machine code for one kind of GPU; it needs no GPU


COMPILERS = ("libnvrtc.so.13", "libnvrtc.so.12", "libnvrtc.so")
"""Names of the library that the system may have; those of pip's wheels come first."""


def machine_code(source: str, definition: str, arch: int) -> bytes:
    """Return the machine code of a source without includes, compiled for one kind of GPU. If NVRTC is older than the GPU,
    the result is PTX (code of a virtual GPU), which the driver translates.

    definition  name of a macro that is defined
    arch        kind of GPU, ten times its compute capability: 90 for an H100

    Raises ToolchainError if NVRTC is not installed, or knows no GPU so old.
    """
    count, program = ctypes.c_int(), ctypes.c_void_p()
    _nvrtc("GetNumSupportedArchs", ctypes.byref(count))
    known = (ctypes.c_int * count.value)()
    _nvrtc("GetSupportedArchs", known)
    usable = [each for each in known if each <= arch]
    if not usable:
        raise ToolchainError(
            f"NVRTC knows no GPU as old as compute capability {arch / 10}", "install an older NVRTC"
        )
    kind, what = ("sm", "CUBIN") if arch in usable else ("compute", "PTX")
    given = (f"--gpu-architecture={kind}_{max(usable)}".encode(), f"-D{definition}".encode())
    _nvrtc("CreateProgram", ctypes.byref(program), source.encode(), b"robot.cuh", 0, None, None)
    try:
        words = (ctypes.c_char_p * len(given))(*given)
        if compiler().nvrtcCompileProgram(program, len(given), words):
            log = _read(program, "ProgramLog").decode(errors="replace")
            raise InternalError(f"NVRTC refuses generated code: {' '.join(log.split())[:500]}")
        return _read(program, what)
    finally:
        compiler().nvrtcDestroyProgram(ctypes.byref(program))


@cache
def compiler() -> Any:
    """Return the library NVRTC. Raises ToolchainError if it is not installed."""
    fault = 'target "cuda" needs NVRTC, which is not installed'
    return _opened(_candidates(), fault, "pip install 'psdmc[cuda]', or install CUDA")


def _candidates() -> Iterator[str]:
    """Paths and names of the library, pip's wheels first."""
    spec = find_spec("nvidia")
    for folder in (spec and spec.submodule_search_locations) or ():
        yield from map(str, sorted(Path(folder).glob("*/lib/libnvrtc.so.1?")))
    yield from COMPILERS


def _read(program: ctypes.c_void_p, what: str) -> bytes:
    size = ctypes.c_size_t()
    _nvrtc(f"Get{what}Size", program, ctypes.byref(size))
    text = ctypes.create_string_buffer(size.value)
    _nvrtc(f"Get{what}", program, text)
    return text.raw


def _nvrtc(name: str, *given: Any) -> None:
    if status := getattr(compiler(), f"nvrtc{name}")(*given):
        raise ToolchainError(f"nvrtc{name} failed with status {status}", "install NVRTC again")
