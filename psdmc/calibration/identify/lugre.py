"""LuGre friction: its seven parameters and its torque along a motion, compiled."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np

from psdmc.backends.c.render import render
from psdmc.calibration.logs.log import Array
from psdmc.errors import InputError
from psdmc.toolchain.cache import cache_key, cached
from psdmc.toolchain.compiler_command import FLAGS, find_compiler, run

UNITS = ("Nm", "Nm", "rad/s", "Nms/rad", "-", "Nm/rad", "Nms/rad")
"""Units of the seven, for turning joints; viscous is N m (s/rad)^d."""


@dataclass(frozen=True, slots=True)
class Lugre:
    """Friction of one joint, (12) to (14); SI.

    coulomb, static    N m       F_c > 0, F_s >= F_c
    stribeck_velocity  rad/s     v_s > 0
    viscous            N m (s/rad)^d
    viscous_exponent   d_v > 0
    stiffness          N m/rad   sigma_0 > 0
    damping            N m s/rad sigma_1 >= 0
    """

    coulomb: float
    static: float
    stribeck_velocity: float
    viscous: float
    viscous_exponent: float
    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        positive = (self.coulomb, self.stribeck_velocity, self.viscous_exponent, self.stiffness)
        if not all(value > 0 for value in positive):
            raise InputError(
                f"LuGre parameters {self}: F_c, v_s, d_v and sigma_0 must be positive",
                "correct the parameters",
            )
        if self.static < self.coulomb or self.viscous < 0 or self.damping < 0:
            raise InputError(
                f"LuGre parameters {self}: expected F_s >= F_c, F_v >= 0 and sigma_1 >= 0",
                "correct the parameters",
            )

    def as_array(self) -> Array:
        """(7,) in the order of the fields."""
        return np.array(astuple(self))


PARAMETERS = tuple(field.name for field in fields(Lugre))


@dataclass(frozen=True, slots=True)
class LugreView:
    """The data of the templates: the number type, its functions and a prefix for names."""

    real: str = "double"
    prefix: str = ""

    @property
    def suffix(self) -> str:
        return "f" if self.real == "float" else ""

    @property
    def exp(self) -> str:
        return f"exp{self.suffix}"

    @property
    def expm1(self) -> str:
        return f"expm1{self.suffix}"

    @property
    def fabs(self) -> str:
        return f"fabs{self.suffix}"

    @property
    def pow(self) -> str:
        return f"pow{self.suffix}"

    def number(self, value: float) -> str:
        return f"{value!r}{self.suffix}"


def friction_torque(friction: Lugre, qd: Array, period: float, z: float = 0.0) -> Array:
    """(N,) N m along speeds (N,) at even samples, linear between them; bristles start at deflection z (rad)."""
    speeds = np.ascontiguousarray(qd, dtype=np.float64)
    if speeds.ndim != 1:
        raise ValueError(f"qd has shape {speeds.shape}, expected (N,)")
    tau = np.empty_like(speeds)
    ffi, library = _compiled()
    parameters = friction.as_array()
    library.psdmc_lugre_simulate(
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
    source = render("calibration/lugre_simulate.c.jinja", view=LugreView())
    compiler = find_compiler()
    parts = ("lugre", *compiler.command, compiler.version, compiler.target, *FLAGS)
    key = cache_key({"lugre_simulate.c": source}, parts)

    def build(folder: Path) -> None:
        (folder / "lugre_simulate.c").write_text(source, encoding="utf-8")
        words = [
            *compiler.command,
            "-std=c99",
            *FLAGS,
            "-shared",
            "-o",
            "lugre.so",
            "lugre_simulate.c",
            "-lm",
        ]
        run(words, "LuGre simulation", str(folder))

    ffi = cffi.FFI()
    ffi.cdef(
        "void psdmc_lugre_simulate(size_t count, const double *qd, double dt, const double *parameters, double z, "
        "double *tau);"
    )
    return ffi, ffi.dlopen(str(cached(key, build, ["lugre.so"]) / "lugre.so"))
