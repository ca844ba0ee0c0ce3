"""C text for the functions that add a load to theta_b (the vector of base parameters of the robot)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.backends.c.prototypes import Prototype, payload_prototypes
from psdmc.backends.c.reals import CReal
from psdmc.backends.c.tables import number


@dataclass(frozen=True, slots=True, eq=False)
class PayloadView:
    """The functions of one robot that add a load to theta_b (the base parameters), as C text for float or double.

    matrices  (l, 10) each: factors from the ten inertial parameters of a load to the change of the l base parameters.
              The first is for a load at the tip, then there is one for each named frame
    """

    robot: str
    real: CReal
    matrices: tuple[NDArray[np.float64], ...]

    @property
    def prototypes(self) -> tuple[Prototype, Prototype]:
        return payload_prototypes(self.robot, self.real)

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """Each matrix's rows as C text."""
        return tuple(
            tuple(", ".join(number(value, self.real) for value in row) for row in matrix.tolist())
            for matrix in self.matrices
        )
