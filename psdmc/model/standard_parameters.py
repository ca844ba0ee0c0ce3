"""A test of whether mass, centre of mass and inertia of each single link are known. Torques determine only combinations
of them, the base parameters."""

from __future__ import annotations

import numpy as np

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.reproducible import times

BELONGS = 1e-9
"""Share of the largest base parameter by which B x may differ from theta_b: both were rounded."""


def lack_of_standard_parameters(model: DynamicsModel) -> str | None:
    """Return a sentence on why the model lacks mass, centre and inertia of some link; None if it has them."""
    parameters = model.mechanism.parameters
    if np.isnan(parameters).any():
        return "it needs mass and inertia of every link, and some are unknown"
    if not parameters[:, 0].sum() > 0.0:
        return "it needs mass, and the links have none"
    theta = times(model.B, parameters.reshape(-1))
    if model.theta_b is None or np.abs(theta - model.theta_b).max() > BELONGS * np.abs(theta).max():
        return (
            "it needs mass and inertia of every link, which torques do not show, and the model's base parameters are "
            "not those of the links in its file"
        )
    return None
