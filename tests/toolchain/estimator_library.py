"""The load estimator of an emitted package, compiled and called from Python."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import cffi
import numpy as np
from numpy.typing import NDArray

from psdmc.compiler import emit_c
from psdmc.model.dynamics_model import DynamicsModel

Array = NDArray[np.float64]


class EstimatorLibrary:
    """`emit-c --estimator KIND` of a model, as a shared library."""

    def __init__(self, model: DynamicsModel, kind: str, folder: Path, real: str = "float64") -> None:
        emit_c(model, folder, functions=["gravity"], name="arm", real=real, estimator=kind)  # type: ignore[arg-type]
        sources = [str(folder / "src" / name) for name in ("estimator.c", "load_momentum.c")]
        flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wdouble-promotion"]
        library = folder / "libestimator.so"
        words = [
            "gcc",
            *flags,
            "-shared",
            "-fPIC",
            f"-I{folder / 'include'}",
            *sources,
            "-lm",
            "-o",
            str(library),
        ]
        subprocess.run(words, check=True)
        header = (folder / "include" / "arm" / "arm.h").read_text()
        self.ffi: Any = cffi.FFI()
        self.ffi.cdef(header[header.index("typedef struct") : header.index("#ifdef __cplusplus\n}")])
        self.library: Any = self.ffi.dlopen(str(library))
        self.real = np.float64 if real == "float64" else np.float32

    def began(self, tau_sd: Array, largest_mass: float = 10.0, reach: float = 0.5, **settings: Any) -> Any:
        """A state after estimate_init, with further settings."""
        state = self.ffi.new("arm_estimator *")
        self.library.arm_estimate_init(state, largest_mass, reach, self._pointer(tau_sd))
        for name, value in settings.items():
            setattr(state, name, value)
        return state

    def step(self, state: Any, q: Array, qd: Array, tau: Array, dt: float) -> int:
        return int(self.library.arm_estimate_step(state, *map(self._pointer, (q, qd, tau)), dt))

    def load(self, state: Any) -> dict[str, Array]:
        """The estimate by the names of the C struct."""
        load = self.ffi.new("arm_load *")
        self.library.arm_estimate_load(state, load)
        fields = [name for name, _ in self.ffi.typeof("arm_load").fields]
        found = {name: getattr(load, name) for name in fields}
        return {
            name: np.array(value if isinstance(value, float) else list(value), np.float64)
            for name, value in found.items()
        }

    def bytes(self, state: Any) -> bytes:
        return bytes(self.ffi.buffer(state))

    def _pointer(self, values: Array) -> Any:
        kept = np.ascontiguousarray(values, self.real)
        return self.ffi.from_buffer("double *" if self.real is np.float64 else "float *", kept)
