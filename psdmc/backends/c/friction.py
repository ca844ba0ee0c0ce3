"""The joint friction of a calibrated model as C text for the templates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.backends.c.expressions import CallView, number, rounded_out
from psdmc.backends.c.kernel_view import Prototype
from psdmc.backends.c.scalar_function import ScalarFunction, calls_in
from psdmc.friction.joints import Friction
from psdmc.friction.law import Array

TOLERANCE = {"double": "1e-13", "float": "1e-5"}
"""Of the self-test, beside the largest friction: a few roundings of tanh and of powers."""


@dataclass(frozen=True, slots=True)
class FrictionView:
    """`R_friction`, printed for one real type."""

    friction: Friction
    robot: str
    real: str

    @property
    def prototype(self) -> Prototype:
        given = ("q", "qd") if self.by_position else ("qd",)
        arguments = (*(f"const {self.real} *{name}" for name in given), f"{self.real} *tau_f")
        return Prototype("void", f"{self.robot}_friction", arguments)

    @property
    def by_position(self) -> bool:
        """Whether the function takes positions, too."""
        return self.friction.by_position

    @property
    def one_joint(self) -> ScalarFunction:
        suffix = "" if self.real == "double" else "f"
        return ScalarFunction("joint_friction", self.friction.program(), ("q", "v"), suffix)

    @property
    def calls(self) -> tuple[CallView, ...]:
        return calls_in([self.one_joint])

    @property
    def passed(self) -> str:
        """Joint i's state behind its values."""
        state = {"q": "q[i]", "v": "qd[i]"}
        return "".join(f", {state[name]}" for name in self.one_joint.taken)

    @property
    def beyond(self) -> tuple[str, ...]:
        """Return sentences about effects that the calibration found in addition to joint friction and rigid bodies,
        such as springs. The sentences contain no names from files."""
        return self.friction.beyond

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the numbers per joint."""
        return tuple(name for term in self.friction.terms for name in term.names)

    @property
    def formula(self) -> str:
        """The law, for the header."""
        return self.friction.formula

    @property
    def sign_speed(self) -> str:
        return number(self.friction.sign_speed, self.real)

    @property
    def rows(self) -> tuple[str, ...]:
        return self._printed(self.friction.values)

    @property
    def speeds(self) -> tuple[str, ...]:
        """Return, as C text, the joint speeds at which the self-test of the package compares friction torques.

        The speeds are zero, a tenth of the speed over which friction changes sign, and speeds in both directions.
        Constants of a friction law that are speeds are included, too.
        """
        return self._printed(self._states)

    @property
    def expected(self) -> tuple[str, ...]:
        """Return the friction torques that the self-test of the package expects, as C text. The self-test passes the
        joint speeds as joint positions, too."""
        return self._printed(self.friction.torque(self._states, self._states))

    @property
    def tolerance(self) -> str:
        return TOLERANCE[self.real]

    @property
    def _states(self) -> Array:
        n = len(self.friction.values)
        ramp = np.linspace(0.5, 1.5, n) * np.where(np.arange(n) % 2, -1.0, 1.0)
        numbers = (term.number for term in self.friction.terms if term.number is not None)
        shares = (0.0, 0.1 * self.friction.sign_speed, 1.0, -0.7, *numbers)
        rounded = [rounded_out(float(v), self.real) for v in np.outer(shares, ramp).reshape(-1)]
        return np.array(rounded).reshape(len(shares), n)

    def _printed(self, rows: Array) -> tuple[str, ...]:
        return tuple(", ".join(number(float(value), self.real) for value in row) for row in rows)
