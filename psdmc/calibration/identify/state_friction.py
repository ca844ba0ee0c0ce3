"""Computes the torque of a friction law with a state (LuGre) along a motion, with compiled code."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np

from psdmc.backends.c.expressions import CallView
from psdmc.backends.c.render import render
from psdmc.backends.c.scalar_function import ScalarFunction, calls_in
from psdmc.calibration.logs.log import Array
from psdmc.friction.state import STATE_LAW, state_programs
from psdmc.toolchain.cache import cache_key, cached
from psdmc.toolchain.compiler_command import FLAGS, find_compiler, run

PARAMETERS = STATE_LAW.parameters
"""Names of the law's values, in order."""


@dataclass(frozen=True, slots=True)
class StateLawView:
    """The options from which a template makes the C functions of the friction law with a state."""

    real: str = "double"

    @property
    def suffix(self) -> str:
        return "f" if self.real == "float" else ""

    def functions(self, *names: str) -> tuple[ScalarFunction, ...]:
        found = state_programs(STATE_LAW)
        return tuple(ScalarFunction(name, *found[name], self.suffix) for name in names)

    def calls(self, *names: str) -> tuple[CallView, ...]:
        return calls_in(self.functions(*names))

    def number(self, value: float) -> str:
        return f"{value!r}{self.suffix}"


def friction_torque(values: Array, qd: Array, period: float, z: float = 0.0) -> Array:
    """Return the friction torque (N,), N m, of one joint along N speeds (rad/s or m/s) at equal time steps.

    Speeds between the steps are interpolated linearly.

    values  (m,) parameters of the friction law, in the order of PARAMETERS
    period  s, time step
    z       state of the friction law at the start, such as the deflection of bristles
    """
    speeds = np.ascontiguousarray(qd, dtype=np.float64)
    if speeds.ndim != 1:
        raise ValueError(f"qd has shape {speeds.shape}, expected (N,)")
    tau = np.empty_like(speeds)
    ffi, library = _compiled()
    parameters = np.ascontiguousarray(values, dtype=np.float64)
    library.psdmc_friction_along(
        len(speeds),
        ffi.cast("const double *", speeds.ctypes.data),
        period,
        ffi.cast("const double *", parameters.ctypes.data),
        z,
        ffi.cast("double *", tau.ctypes.data),
    )
    return tau


@cache
def _compiled() -> tuple[Any, Any]:
    """The simulation, compiled once per machine and kept in psdmc's compile cache."""
    source = render("calibration/friction_along.c.jinja", view=StateLawView())
    compiler = find_compiler()
    parts = ("friction_along", *compiler.command, compiler.version, compiler.target, *FLAGS)
    key = cache_key({"friction_along.c": source}, parts)

    def build(folder: Path) -> None:
        (folder / "friction_along.c").write_text(source, encoding="utf-8")
        output = ("-shared", "-o", "friction_along.so", "friction_along.c", "-lm")
        run([*compiler.command, "-std=c99", *FLAGS, *output], "the friction simulation", str(folder))

    ffi = cffi.FFI()
    ffi.cdef(
        "void psdmc_friction_along(size_t count, const double *qd, double dt, const double *p, double z, double *tau);"
    )
    return ffi, ffi.dlopen(str(cached(key, build, ["friction_along.so"]) / "friction_along.so"))
