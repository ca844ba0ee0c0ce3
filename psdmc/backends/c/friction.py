"""Friction of a calibrated model, as templates print it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.backends.c.reals import rounded_out
from psdmc.backends.c.tables import number
from psdmc.model.linear_friction import Array, LinearFriction

TOLERANCE = {"double": "1e-13", "float": "1e-5"}
"""Of the self-test, beside the largest friction: a few roundings of tanh and of powers."""


@dataclass(frozen=True, slots=True)
class FrictionView:
    """The numbers of `R_friction`, printed for one real type."""

    friction: LinearFriction
    real: str

    @property
    def beyond(self) -> tuple[str, ...]:
        """What else the calibration found, in words without names from files."""
        return self.friction.beyond

    @property
    def sign_speed(self) -> str:
        return number(self.friction.sign_speed, self.real)

    @property
    def exponents(self) -> tuple[str, ...]:
        return tuple(f"{d:g}" for d in self.friction.exponents)

    @property
    def powers(self) -> tuple[str, ...]:
        """|v| to each exponent, in C."""
        suffix = "" if self.real == "double" else "f"
        by_pow = (f"pow{suffix}(speed, {number(d, self.real)})" for d in self.friction.exponents)
        return tuple(
            "speed" if d == 1.0 else "speed * speed" if d == 2.0 else text
            for d, text in zip(self.friction.exponents, by_pow, strict=True)
        )

    @property
    def stribeck(self) -> tuple[str, ...]:
        """exp(-(v / v_s)^2) for each Stribeck velocity, in C."""
        suffix = "" if self.real == "double" else "f"
        each = (number(v, self.real) for v in self.friction.stribeck_speeds)
        return tuple(f"exp{suffix}(-(v / {v}) * (v / {v}))" for v in each)

    @property
    def sizes(self) -> tuple[str, ...]:
        """What the terms after Coulomb friction are multiplied by."""
        return (*self.powers, *self.stribeck)

    @property
    def headings(self) -> tuple[str, ...]:
        """Names of the numbers per joint."""
        viscous = tuple(f"viscous (speed to the power {d})" for d in self.exponents)
        peaks = tuple(f"Stribeck at speed {v:g}" for v in self.friction.stribeck_speeds)
        return ("Coulomb", *viscous, *peaks, *(("asymmetry",) if self.uneven else ()), "constant")

    @property
    def law(self) -> str:
        """The factor of tanh, for the header."""
        viscous = "".join(f" + viscous |v|^{d}" for d in self.exponents)
        peaks = "".join(f" + Stribeck exp(-(v / {v:g})^2)" for v in self.friction.stribeck_speeds)
        return f"Coulomb{viscous}{peaks}"

    @property
    def uneven(self) -> bool:
        """Whether Coulomb friction differs between the directions."""
        return len(self.friction.asymmetry) > 0

    @property
    def width(self) -> int:
        """Numbers per joint."""
        return 2 + len(self.friction.exponents) + len(self.friction.stribeck_speeds) + self.uneven

    @property
    def rows(self) -> tuple[str, ...]:
        friction = self.friction
        columns = [friction.coulomb, friction.viscous]
        columns += [friction.stribeck] if friction.stribeck_speeds else []
        columns += [friction.asymmetry] if self.uneven else []
        return self._printed(np.column_stack([*columns, friction.offset]))

    @property
    def speeds(self) -> tuple[str, ...]:
        """Of the self-test: rest, a tenth of the speed over which the sign changes, both ways beyond it, and the Stribeck
        velocities."""
        return self._printed(self._speeds)

    @property
    def expected(self) -> tuple[str, ...]:
        return self._printed(self.friction.torque(self._speeds))

    @property
    def tolerance(self) -> str:
        return TOLERANCE[self.real]

    @property
    def _speeds(self) -> Array:
        n = len(self.friction.coulomb)
        ramp = np.linspace(0.5, 1.5, n) * np.where(np.arange(n) % 2, -1.0, 1.0)
        shares = (0.0, 0.1 * self.friction.sign_speed, 1.0, -0.7, *self.friction.stribeck_speeds)
        rounded = [rounded_out(float(v), self.real) for v in np.outer(shares, ramp).reshape(-1)]
        return np.array(rounded).reshape(len(shares), n)

    def _printed(self, rows: Array) -> tuple[str, ...]:
        return tuple(", ".join(number(float(value), self.real) for value in row) for row in rows)
