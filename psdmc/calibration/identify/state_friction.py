"""Generates C code of the friction law with a state (LuGre). psdmc compiles it to simulate friction along a motion, and
writes it for users, with the motors, beside the code of the robot's bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import cffi
import numpy as np

from psdmc.backends.c.expressions import CallView
from psdmc.backends.c.friction import ScalarFunction, calls_in
from psdmc.backends.c.render import identifier, render
from psdmc.calibration.logs.log import Array
from psdmc.errors import InputError
from psdmc.friction.terms import STATE_LAW, state_programs
from psdmc.model.calibrated import Calibrated, by_joint
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


@dataclass(frozen=True, slots=True)
class ActuatorView(StateLawView):
    """The data for the templates of the C code of friction and motors.

    joint_names       names of the joints
    friction          values of the LuGre friction law, one vector for each joint
    torque_constants  N m/A, one for each joint; empty if they are unknown
    """

    robot: str = "robot"
    joint_names: tuple[str, ...] = ()
    friction: tuple[Array, ...] = ()
    torque_constants: tuple[float, ...] = field(default=())

    @property
    def name(self) -> str:
        return identifier(self.robot)

    @property
    def header(self) -> str:
        return f"{self.name}_actuators.h"

    @property
    def guard(self) -> str:
        return f"{self.name.upper()}_ACTUATORS_H"

    @property
    def n(self) -> int:
        return len(self.joint_names)

    @property
    def about(self) -> str:
        """One sentence that describes the friction law."""
        return STATE_LAW.about

    @property
    def headings(self) -> tuple[str, ...]:
        return PARAMETERS

    @property
    def friction_rows(self) -> list[list[str]]:
        return [[self.number(value) for value in joint.tolist()] for joint in self.friction]

    @property
    def constant_row(self) -> list[str]:
        return [self.number(value) for value in self.torque_constants]


def actuator_files(view: ActuatorView) -> dict[str, str]:
    """Return the C99 files include/R_actuators.h and src/R_actuators.c by path, for the identifier R."""
    if len(view.friction) != view.n or (view.torque_constants and len(view.torque_constants) != view.n):
        raise ValueError(
            f"{view.n} joints, {len(view.friction)} frictions, {len(view.torque_constants)} constants"
        )
    return {
        f"include/{view.header}": render("calibration/actuators.h.jinja", view=view),
        f"src/{view.name}_actuators.c": render("calibration/actuators.c.jinja", view=view),
    }


def calibrated_actuators(
    robot: str, joint_names: Sequence[str], found: Calibrated, real: str = "double"
) -> ActuatorView:
    """Return the data for the C code of friction and motors, from the results of a calibration. Raises InputError if a
    joint has no LuGre friction (a friction law with bristle deflection as its state)."""
    values = by_joint(found.friction)
    missing = [joint for joint in joint_names if any((joint, name) not in values for name in PARAMETERS)]
    if missing:
        raise InputError(
            f"{robot}: no friction with a state was identified for joint(s) {', '.join(missing)}",
            "calibrate with friction runs of every joint; friction of one log's fit is in `psdmc emit-c --friction`",
        )
    constants = {row.joint: row.value for row in found.motors}
    return ActuatorView(
        real=real,
        robot=robot,
        joint_names=tuple(joint_names),
        friction=tuple(
            STATE_LAW.require(np.array([values[joint, name] for name in PARAMETERS])) for joint in joint_names
        ),
        torque_constants=tuple(constants[joint] for joint in joint_names) if constants else (),
    )
