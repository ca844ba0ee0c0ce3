"""A load, and the change of theta_b (the base parameters) that the load causes at every frame. The self-test of the
package compares functions that add loads with these values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.payload import body_parameters, load_parameters
from psdmc.reproducible import times

Array = NDArray[np.float64]

MASS = 1.25
COM = (0.05, -0.03, 0.11)
INERTIA = np.array([[0.02, 0.003, -0.002], [0.003, 0.03, 0.001], [-0.002, 0.001, 0.025]])
"""kg, m, kg m^2 about the centre of mass: a body that no symmetry makes easier."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceLoad:
    """The changes of the base parameters that the example load of the self-test causes.

    added  (1 + number of named frames, l) change of the l base parameters: load at the tip, then at each named frame
    """

    added: Array


def reference_load(model: DynamicsModel) -> ReferenceLoad:
    """Return the changes of theta_b that the self-test's load causes at the tip and at each named frame."""
    chain = model.mechanism
    places = [(None, chain.tip_body), *((frame.name, frame.joint) for frame in chain.frames)]
    rows = [
        times(model.B[:, body_parameters(body)], load_parameters(chain, MASS, COM, INERTIA, frame))
        for frame, body in places
    ]
    return ReferenceLoad(np.array(rows))
