"""Models whose base parameters determine the torques under every gravity, for gravity as an input of generated code.

Gravity along an axis or a plane of the robot hides parameters. The first joint of a SCARA robot is vertical, so its
weight exerts no torque on it. Base parameters for a general direction of gravity suffice for every direction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from psdmc.errors import InputError
from psdmc.model import recursive
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import random_parameters, states_of
from psdmc.reproducible import times
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Mechanism

DIRECTION = (4.27, -3.19, -8.23)
"""m/s^2, along no axis, plane or diagonal that robots have."""

OTHERS = ((9.1, 2.3, 1.7), (-1.9, 8.7, 3.1))
"""m/s^2, for which the base parameters are tested."""

STATES, SEED = 8, 20_261_128

HIDDEN = 1e-9
"""Torque, as a share of a joint's largest one, beyond which a model lacks a parameter. Rounding leaves less than 1e-12."""


def under_general_gravity(chain: Mechanism) -> Mechanism:
    """Return the robot with gravity in a general direction."""
    return replace(chain, gravity=np.array(DIRECTION))


def for_every_gravity(model: DynamicsModel) -> DynamicsModel:
    """Return the model with gravity in a general direction. Its code depends on no property of the file's gravity.

    Raises InputError if the base parameters do not determine the torques under every gravity. Then a change of the link
    parameters that the model does not see changes torques.
    """
    chain = model.mechanism
    x = random_parameters(chain)
    seen = times(model.representative, times(model.B, x))
    states = list(states_of(chain, np.random.default_rng(SEED), STATES))
    for gravity in OTHERS:
        turned = replace(chain, gravity=np.array(gravity))
        torques = recursive.torques(turned, x, states)
        largest = np.abs(torques).max(axis=0)
        lacking = np.abs(recursive.torques(turned, seen, states) - torques).max(axis=0)
        if (lacking > HIDDEN * largest).any():
            raise InputError(
                f"{shown(chain.name)}: its base parameters determine the torques under the gravity of its file only",
                "derive the model with --gravity-input (gravity_input=True)",
            )
    return replace(model, mechanism=under_general_gravity(chain))
