"""Random masses and inertias, which could exist physically, for a robot whose real parameters are unknown."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.parameters import inertia_of, standard_parameters
from psdmc.reproducible import times
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Array, Mechanism
from psdmc.robot.zeros import leading_rows

SEED = 14_630


def random_parameters(chain: Mechanism) -> Array:
    """Return (11 n,) random standard parameters of links that can exist physically, as far as the robot's assumptions
    allow. Parameters that are assumed zero are zero."""
    rng = np.random.default_rng(SEED)
    x = np.zeros((len(chain), PARAMETERS_PER_LINK))
    for link in x:
        mass, centre = rng.uniform(1.0, 5.0), rng.uniform(-0.1, 0.1, size=3)
        shape = rng.normal(scale=0.1, size=(3, 3))
        second = mass * (times(shape, shape.T) + np.outer(centre, centre))
        link[:BODY_PARAMETERS] = standard_parameters(mass, mass * centre, inertia_of(second))
        link[BODY_PARAMETERS] = rng.uniform(0.1, 0.5)
    span = chain.parameter_span
    leads = leading_rows(span)
    admitted: Array = times(span, x.reshape(-1)[leads])
    return admitted
