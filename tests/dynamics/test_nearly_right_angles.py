"""Torques of a chain whose last axis is off a right angle by so little that in double the cosine is one, the sine not 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_chains import Oracle, random_chain, relative_error, states

from psdmc.dynamics.choices import Choices
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.robot.mechanism import Placement

EVERY = [Choices(compound, fold, True) for compound in (False, True) for fold in (False, True)]


@pytest.mark.parametrize("choices", EVERY)
@pytest.mark.parametrize("tilt", [1e-10, 1e-9, 9e-9])
def test_every_arrangement_feels_the_tilt(tilt: float, choices: Choices) -> None:
    chain = random_chain(4, "RRR")
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, tilt, -1.0], [0.0, 1.0, tilt]])
    last = replace(chain.joints[2], placement=Placement(about_x, np.array([0.2, 0.0, 0.3])))
    chain = replace(chain, joints=(*chain.joints[:2], last))
    q, qd, qdd = states(3, 100)
    x = chain.parameters.reshape(-1)
    vectors = [list(vector.T) for vector in (q, qd, qdd)]
    up = base_acceleration(chain)
    found = inverse_dynamics(
        frames_of(chain), bodies_of(chain, x), drive_inertia_of(x), *vectors, up, choices
    )
    assert relative_error(np.stack(found, axis=1), Oracle(chain).rnea(q, qd, qdd)) < 1e-13
