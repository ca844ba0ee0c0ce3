"""The C controller, built with the emitted package and called from Python: here Python only plays the fieldbus."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cffi
import numpy as np
from reference import Array, Reference

HERE = Path(__file__).parent

Controller = Callable[[Reference, Array, Array], Array]
"""(reference now, measured q, measured qd) -> tau"""

DECLARATIONS = """
struct reference { const double *q, *qd, *qdd; };
struct measurement { const double *q, *qd; };
struct gains { double kp, kd; };
void independent_joints(struct gains, const double *, struct reference, struct measurement, double *);
void computed_torque(struct gains, const double *, struct reference, struct measurement, double *);
void joint_inertias(const double *, double *);
"""


class ControllerLibrary:
    """controller.c, linked with one robot's package.

    bandwidth  rad/s of the error dynamics, critically damped: kp = bandwidth^2, kd = 2 bandwidth
    """

    def __init__(self, package: Path, bandwidth: float) -> None:
        subprocess.run(["make", "--silent", "-f", str(HERE / "Makefile"), f"PACKAGE={package}"], check=True)
        self._ffi = cffi.FFI()
        self._ffi.cdef(DECLARATIONS)
        self._library: Any = self._ffi.dlopen(str((package / "controller" / "libcontroller.so").resolve()))
        self.kp, self.kd = bandwidth**2, 2 * bandwidth

    def joint_inertias(self, q: Array) -> Array:
        inertia = np.empty_like(q)
        self._library.joint_inertias(self._pointer(q), self._pointer(inertia))
        return inertia

    def independent_joints(self, inertia: Array) -> Controller:
        return self._bound(self._library.independent_joints, inertia)

    def computed_torque(self, theta_b: Array | None = None) -> Controller:
        return self._bound(self._library.computed_torque, theta_b)

    def _bound(self, function: Callable[..., None], own: Array | None) -> Controller:
        parameters = self._ffi.NULL if own is None else self._pointer(own)

        def torque(reference: Reference, q: Array, qd: Array) -> Array:
            tau = np.empty_like(q)
            wanted = tuple(map(self._pointer, (reference.q, reference.qd, reference.qdd)))
            measured = (self._pointer(q), self._pointer(qd))
            function((self.kp, self.kd), parameters, wanted, measured, self._pointer(tau))
            return tau

        return torque

    def _pointer(self, array: Array) -> Any:
        return self._ffi.from_buffer("double *", array)
