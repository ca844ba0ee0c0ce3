"""A compiled robot called from Python: functions that broadcast over leading axes, like ufuncs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cffi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError, ToolchainError
from psdmc.program.functions import BY_NAME
from psdmc.toolchain.interface import Interface, batch_symbol

Array = NDArray[Any]


class CompiledRobot:
    """The functions of a compiled package on NumPy arrays (..., n).

    Leading axes broadcast; results are float64 or float32 as the package was compiled. Calls release the GIL
    and may run in several threads. `theta_b` (l,), where a function takes it, replaces the parameters
    compiled in.
    """

    def __init__(self, interface: Interface, library: Path) -> None:
        self._ffi = cffi.FFI()
        self._ffi.cdef(interface.cdef)
        self._library = _opened(self._ffi, library, interface.robot)
        self._robot = interface.robot
        self._n, self._l = interface.n, interface.l
        self._dtype = np.dtype(interface.dtype)
        self._pointer = self._ffi.typeof(f"{interface.real} *")
        self._kernels = {name: _bound(interface, self._library, name) for name in interface.kernels}
        self.joint_names = interface.joint_names
        self.library = library

    def inverse_dynamics(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, theta_b: ArrayLike | None = None
    ) -> Array:
        """Torques (..., n): M(q) qdd + h(q, qd)."""
        return self._call("inverse_dynamics", (q, qd, qdd), theta_b)

    def forward_dynamics(
        self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, theta_b: ArrayLike | None = None
    ) -> Array:
        """Accelerations (..., n); NaN in the states whose mass matrix is not positive definite."""
        return self._call("forward_dynamics", (q, qd, tau), theta_b)

    def mass_matrix(self, q: ArrayLike, theta_b: ArrayLike | None = None) -> Array:
        """M(q), (..., n, n)."""
        return self._call("mass_matrix", (q,), theta_b)

    def nonlinear_effects(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None) -> Array:
        """h(q, qd) = C(q, qd) qd + g(q), (..., n)."""
        return self._call("nonlinear_effects", (q, qd), theta_b)

    def coriolis_matrix(self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None) -> Array:
        """C(q, qd), (..., n, n), with dM/dt - 2 C skew-symmetric."""
        return self._call("coriolis_matrix", (q, qd), theta_b)

    def gravity(self, q: ArrayLike, theta_b: ArrayLike | None = None) -> Array:
        """g(q), (..., n)."""
        return self._call("gravity", (q,), theta_b)

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Y, (..., n, l), with tau = Y theta_b."""
        return self._call("regressor", (q, qd, qdd))

    def regressor_slotine_li(self, q: ArrayLike, qd: ArrayLike, qd_r: ArrayLike, qdd_r: ArrayLike) -> Array:
        """Y, (..., n, l), with M(q) qdd_r + C(q, qd) qd_r + g(q) = Y theta_b."""
        return self._call("regressor_slotine_li", (q, qd, qd_r, qdd_r))

    def jacobian(self, q: ArrayLike) -> Array:
        """J, (..., 6, n): linear, then angular velocity of the tip per unit joint rate, in the base frame."""
        return self._call("jacobian", (q,))

    def _call(self, name: str, inputs: Sequence[ArrayLike], theta_b: ArrayLike | None = None) -> Array:
        kernel = self._kernel(name if theta_b is None else f"{name}_theta")
        arrays = [self._states(name, v, x) for v, x in zip(kernel.inputs, inputs, strict=True)]
        shape, rows = self._rows(kernel, arrays)
        if theta_b is not None:
            rows.append(self._parameters(name, theta_b))
        out = np.empty(shape[:-1] + kernel.tail, self._dtype)
        kernel.batch(math.prod(shape[:-1]), *map(self._address, rows), self._address(out))
        return out

    def _kernel(self, name: str) -> _Kernel:
        try:
            return self._kernels[name]
        except KeyError:
            compiled = ", ".join(self._kernels)
            raise InputError(f"{self._robot}: {name} was not compiled", f"compiled are {compiled}") from None

    def _states(self, name: str, vector: str, values: ArrayLike) -> Array:
        array = np.asarray(values, self._dtype)
        if array.ndim == 0 or array.shape[-1] != self._n:
            raise InputError(
                f"{name}: {vector} has shape {array.shape}, expected (..., {self._n})",
                f"the robot has {self._n} joints: {', '.join(self.joint_names)}",
            )
        return array

    def _rows(self, kernel: _Kernel, arrays: list[Array]) -> tuple[tuple[int, ...], list[Array]]:
        """The common shape, and the arrays as contiguous rows of it."""
        shape = arrays[0].shape
        if any(array.shape != shape for array in arrays):
            shape = self._common_shape(kernel, arrays)
            arrays = [np.broadcast_to(array, shape) for array in arrays]
        return shape, [np.ascontiguousarray(array) for array in arrays]

    def _common_shape(self, kernel: _Kernel, arrays: list[Array]) -> tuple[int, ...]:
        try:
            return np.broadcast_shapes(*(array.shape for array in arrays))
        except ValueError:
            shapes = ", ".join(f"{v} {array.shape}" for v, array in zip(kernel.inputs, arrays, strict=True))
            raise InputError(
                f"{kernel.name}: shapes do not broadcast: {shapes}",
                "give arrays of one shape, or shapes that NumPy broadcasts",
            ) from None

    def _parameters(self, name: str, theta_b: ArrayLike) -> Array:
        array = np.ascontiguousarray(theta_b, self._dtype)
        if array.shape != (self._l,):
            raise InputError(
                f"{name}: theta_b has shape {array.shape}, expected ({self._l},)",
                "give one value per base parameter",
            )
        return array

    def _address(self, array: Array) -> Any:
        return self._ffi.from_buffer(self._pointer, array)


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
    """One compiled kernel: its batch function in C, its inputs and the trailing axes of its result."""

    name: str
    inputs: tuple[str, ...]
    tail: tuple[int, ...]
    batch: Callable[..., int | None]


def _bound(interface: Interface, library: Any, name: str) -> _Kernel:
    inputs = BY_NAME[name.removesuffix("_theta")].inputs
    batch = getattr(library, batch_symbol(interface.robot, name))
    return _Kernel(name, inputs, interface.kernels[name], batch)
