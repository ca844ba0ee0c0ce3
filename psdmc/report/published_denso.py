"""Tables 2 to 4 as printed in Denso-2022, which the report shows with the results of the virtual Denso's calibration.

Denso-2022: Application of Pseudo-Symbolic Dynamic Modeling (PSDM) in the Modeling & Calibration of a 6-DOF Articulated
Robot. Of table 4, this module has only the rows whose printed equations can be read and are true for the robot. The
other rows lost signs or indices in print.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.errors import InternalError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

PARAMETERS: Mapping[str, tuple[float, ...]] = {
    "torque_constant": (36.1, 40.3, 24.4, 17.9, 14.6, 5.42),
    "coulomb": (9.59, 8.86, 6.20, 3.59, 2.39, 1.60),
    "static": (12.5, 9.92, 7.77, 4.00, 2.67, 1.53),
    "stribeck_velocity": (14.4e-3, 20.1e-3, 32.0e-3, 210e-3, 81.1e-3, 10.4e-3),
    "viscous": (23.7, 28.7, 10.7, 2.38, 4.50, 1.61),
    "viscous_exponent": (0.61, 0.62, 0.73, 0.63, 0.59, 0.74),
    "stiffness": (288e3, 250e3, 130e3, 5.36e3, 35.9e3, 13.0e3),
    "damping": (22.8, 21.2, 19.2, 8.91, 13.9, 10.3),
}
"""Table 2, joints 1 to 6, SI; of damping, whose header says kN m s/rad, the numbers are N m s/rad."""

NAN = float("nan")
ACCURACY: Mapping[str, tuple[tuple[float, float], ...]] = {
    "Motor": ((0.24, 1.00), (0.46, 1.00), (0.35, 1.00), (0.06, 1.00), (0.12, 1.00), (0.04, 1.00)),
    "Gravity": ((0.30, 1.00), (0.41, 1.00), (0.55, 1.00), (0.13, 0.98), (0.18, 0.95), (0.16, NAN)),
    "Friction": ((2.16, 0.99), (3.06, 0.98), (0.61, 1.00), (0.52, 0.99), (0.49, 0.99), (0.27, 0.99)),
    "Inertial": ((2.16, 0.78), (2.79, 0.84), (3.02, 0.35), (0.95, 0.05), (0.55, 0.40), (0.90, 0.06)),
    "All": ((NAN, 0.99), (NAN, 0.97), (NAN, 0.86), (NAN, 0.91), (NAN, 0.96), (NAN, 0.81)),
}
"""Table 3: RMSE (N m) and R^2 on validation data, joints 1 to 6; nan: not printed."""

A1, A2, A3, D4 = 0.075, -0.27, -0.09, 0.295
"""m, the robot's lengths."""
NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz", "Im")
"""Of a link's standard parameters, in their order."""


@dataclass(frozen=True, slots=True)
class PublishedParameter:
    """A row of table 4 of Denso-2022: a base parameter.

    value     in SI units
    equation  in standard parameters about the links' frames (mx = m rx; Ixx and so on about the origin)
    terms     the equation as coefficients by parameter and link
    fitted    whether the masses and inertias of the virtual robot were chosen to give this value, as nearly as real
              bodies can
    """

    name: str
    value: float
    unit: str
    equation: str
    terms: Mapping[str, float]
    fitted: bool = True

    def by_base_parameters(self, model: DynamicsModel) -> Array:
        """(l,) its coefficients in the model's theta_b."""
        wanted = np.zeros(PARAMETERS_PER_LINK * len(model.mechanism))
        for term, coefficient in self.terms.items():
            wanted[PARAMETERS_PER_LINK * (int(term[-1]) - 1) + NAMES.index(term[:-1])] = coefficient
        span = model.mechanism.parameter_span
        found = np.linalg.lstsq((model.B @ span).T, span.T @ wanted, rcond=None)[0]
        if np.abs(found @ model.B @ span - wanted @ span).max() > ROUNDING * np.abs(wanted).max():
            raise InternalError(
                f"{self.name} of Denso-2022 is no combination of {model.mechanism.name}'s theta_b"
            )
        return np.where(np.abs(found) < ROUNDING * np.abs(found).max(), 0.0, found)


ROUNDING = 1e-9
"""Of coefficients."""

_line = PublishedParameter
BASE_PARAMETERS = (
    _line("θ1", 7.42, "kg", "m1 + mx1/a1 - mx2/a2", {"m1": 1, "mx1": 1 / A1, "mx2": -1 / A2}),
    _line("θ2", 0.566, "kg m", "mz1 + mz2 + my3", {"mz1": 1, "mz2": 1, "my3": 1}),
    _line("θ4", 5.46, "kg", "m2 + mx2/a2 - mx3/a3", {"m2": 1, "mx2": 1 / A2, "mx3": -1 / A3}),
    _line("θ5", -0.0632, "kg m", "my2", {"my2": 1}),
    _line(
        "θ11",
        4.10,
        "kg",
        "m3 - (mz3 - my4)/d4 + mx3/a3",
        {"m3": 1, "mz3": -1 / D4, "my4": 1 / D4, "mx3": 1 / A3},
    ),
    _line("θ12", 3.38, "kg", "(mz3 - my4)/d4 + m4 + m5", {"mz3": 1 / D4, "my4": -1 / D4, "m4": 1, "m5": 1}),
    _line("θ19", -0.0165, "kg m", "mz4 + my5", {"mz4": 1, "my5": 1}),
    _line("θ20", -0.0179, "kg m", "mx4", {"mx4": 1}),
    _line("θ27", 0.0793, "kg m", "mz5", {"mz5": 1}),
    _line("θ18", 0.561, "kg m^2", "Im3", {"Im3": 1}),
    _line("θ26", 0.0838, "kg m^2", "Im4", {"Im4": 1}),
    _line("θ28", -0.00706, "kg m^2", "Ixx5 - Iyy5 - Izz5", {"Ixx5": 1, "Iyy5": -1, "Izz5": -1}),
    _line("θ29", 0.00694, "kg m^2", "Iyy5", {"Iyy5": 1}),
    _line("θ31", 0.092, "kg m^2", "Im5", {"Im5": 1}),
    _line("θ32", 0.0306, "kg m^2", "Im6", {"Im6": 1}),
    _line("θ15", 0.0397, "kg m^2", "Ixz3", {"Ixz3": 1}, False),
    _line("θ16", -0.0199, "kg m^2", "Ixy3 - a3 my3", {"Ixy3": 1, "my3": -A3}, False),
    _line("θ17", -0.0123, "kg m^2", "Iyz3", {"Iyz3": 1}, False),
    _line(
        "θ21",
        -0.0573,
        "kg m^2",
        "Ixx4 + Iyy4 - Izz4 + 2 Izz5",
        {"Ixx4": 1, "Iyy4": 1, "Izz4": -1, "Izz5": 2},
        False,
    ),
    _line("θ23", -0.0172, "kg m^2", "Ixy4", {"Ixy4": 1}, False),
    _line("θ24", 0.00447, "kg m^2", "-Iyz4", {"Iyz4": -1}, False),
    _line("θ25", -0.0704, "kg m^2", "-Ixz4", {"Ixz4": -1}, False),
    _line("θ30", -0.00622, "kg m^2", "-Iyz5", {"Iyz5": -1}, False),
)
"""Table 4."""
