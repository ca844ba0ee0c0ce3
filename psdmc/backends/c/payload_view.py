"""The functions that add a load to theta_b, in the form that templates print."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.backends.c.prototypes import Prototype, payload_prototypes
from psdmc.backends.c.reals import CReal
from psdmc.backends.c.tables import number


@dataclass(frozen=True, slots=True, eq=False)
class PayloadView:
    """The functions of one robot that add a load to theta_b, for one real type.

    matrices  (l, 10) each: from a load's ten inertial parameters to what the load adds to theta_b, at the tip and each frame
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
