"""A load, and what it adds to theta_b at every frame, for the self-test of the functions that add loads at run time."""

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
    """A load for the self-test.

    added  (1 + frames, l) what the load adds to theta_b: at the tip, then at each named frame
    """

    added: Array


def reference_load(model: DynamicsModel) -> ReferenceLoad:
    """Return the self-test's load for a model. What it adds to theta_b is computed by DynamicsModel.with_payload."""
    chain = model.mechanism
    places = [(None, chain.tip_body), *((frame.name, frame.joint) for frame in chain.frames)]
    rows = [
        times(model.B[:, body_parameters(body)], load_parameters(chain, MASS, COM, INERTIA, frame))
        for frame, body in places
    ]
    return ReferenceLoad(np.array(rows))
