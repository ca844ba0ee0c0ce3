"""Facts about a compiled robot: names, sizes, limits, gravity and base parameters, from its interface."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.toolchain.interface import Interface

MOST_NAMES = 8
"""Names that a repr lists."""

Vector = NDArray[np.float64]


class JointLimits(NamedTuple):
    """Limits of n joints as (n,) arrays, in rad or m and their rates, N m or N; infinite where the robot's file has none."""

    lower: Vector
    upper: Vector
    speed: Vector
    acceleration: Vector
    effort: Vector


class RobotFacts:
    """Names, sizes, limits and parameters of a compiled robot with n joints and l base parameters."""

    def __init__(self, interface: Interface) -> None:
        self._interface = interface

    @property
    def name(self) -> str:
        """Return the name of the robot in C, with which the names of its C functions begin."""
        return self._interface.robot

    @property
    def n(self) -> int:
        """Return the number of joints; mimic joints, which follow another joint, are not counted."""
        return self._interface.n

    @property
    def nq(self) -> int:
        """Return the length of q: the joint positions, with four entries for a quaternion."""
        return self._interface.nq

    @property
    def nv(self) -> int:
        """Return the length of qd, qdd and tau: the number of joint rates."""
        return self._interface.nv

    @property
    def l(self) -> int:  # noqa: E743  the paper's letter
        """Return the number of base parameters, the length of theta_b."""
        return self._interface.l

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of the n joints, from base to tip."""
        return self._interface.joint_names

    @property
    def q_names(self) -> tuple[str, ...]:
        """Return the names of the nq entries of q, such as 'elbow', or 'root_joint.x' if a joint has several entries."""
        return self._interface.q_names

    @property
    def v_names(self) -> tuple[str, ...]:
        """Return the names of the nv entries of rates, accelerations and torques, such as 'elbow' or 'root_joint.vx'."""
        return self._interface.v_names

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Return the names of the frames for poses, Jacobians and wrenches, in the order of the results."""
        return self._interface.frame_names

    @property
    def dtype(self) -> np.dtype[np.float64] | np.dtype[np.float32]:
        """Return the NumPy type of all results: float64 or float32."""
        single, double = np.dtype(np.float32), np.dtype(np.float64)
        return single if self._interface.dtype == "float32" else double

    @property
    def functions(self) -> tuple[str, ...]:
        """Return the names of the functions that are compiled so far, such as 'inverse_dynamics'."""
        return tuple(dict.fromkeys(name.removesuffix("_theta") for name in self._interface.kernels))

    @cached_property
    def limits(self) -> JointLimits:
        """Return the joint limits of the robot file, each (n,). The functions do not enforce these limits."""
        columns = np.array(self._interface.limits, np.float64).T
        return JointLimits(*(_frozen(column) for column in columns))

    @cached_property
    def gravity_acceleration(self) -> Vector:
        """Return the acceleration of gravity in the code, (3,) m/s^2 in the base frame (world frame for a floating base)."""
        return _frozen(self._interface.gravity)

    @cached_property
    def theta_b(self) -> Vector | None:
        """Return the compiled-in base parameters, (l,), SI units; None if unknown: pass `theta_b` in each call then."""
        values = self._interface.theta_b
        return None if values is None else _frozen(values)

    def __repr__(self) -> str:
        return "\n  ".join([self._title, *self._facts()])

    def _repr_html_(self) -> str:
        facts = "".join(f"<li>{escape(fact)}</li>" for fact in self._facts())
        return f"<div><p><b>{escape(self._title)}</b></p><ul>{facts}</ul></div>"

    @property
    def _title(self) -> str:
        return f"CompiledRobot {self.name!r}: {self.n} joints, {self._interface.dtype}"

    def _facts(self) -> list[str]:
        lengths = [] if self.nq == self.nv == self.n else [f"nq = {self.nq}, nv = {self.nv}"]
        gravity = " ".join(f"{value:g}" for value in self._interface.gravity)
        compiled_in = "given in calls" if self._interface.theta_b is None else "compiled in"
        return [
            f"joints: {_listed(map(repr, self.joint_names))}",
            *lengths,
            f"gravity: {gravity} m/s^2 in the {self._interface.base_frame}",
            f"l = {self.l} base parameters, {compiled_in}",
            f"functions: {_listed(self.functions)}",
        ]


def _listed(names: Iterable[str]) -> str:
    found = tuple(names)
    more = len(found) - MOST_NAMES
    return ", ".join(found[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _frozen(values: object) -> Vector:
    array = np.array(values, np.float64)
    array.setflags(write=False)
    return array
