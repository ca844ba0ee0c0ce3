"""The data for the generated function that computes theta_b from the masses and inertias of all bodies of a robot.

They are the map from bodies to theta_b, and one robot's bodies for the self-test of the package.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.model.bodies import refuse_outside
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.inertia import six_of
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK

Array = NDArray[np.float64]

MASS = 1.25
COM = np.array([0.0625, -0.03125, 0.125])
INERTIA = np.array([[0.03, 0.003, -0.002], [0.003, 0.04, 0.001], [-0.002, 0.001, 0.035]])
"""kg, m, kg m^2 about the centre of mass of the self-test's first body; the next ones are heavier and longer."""


@dataclass(frozen=True, slots=True, eq=False)
class BodiesMap:
    """theta_b = constant + columns @ (ten standard parameters of each body), for n bodies and l base parameters.

    links     n names, untrusted text
    columns   (l, 10 n)
    constant  (l,) the contribution of the drive inertias
    masses, coms, inertias, theta_b   (n,), (n, 3), (n, 6), (l,) of one robot, for the self-test
    """

    links: tuple[str, ...]
    columns: Array
    constant: Array
    masses: Array
    coms: Array
    inertias: Array
    theta_b: Array


def bodies_map(model: DynamicsModel) -> BodiesMap:
    """Return the map from bodies to theta_b of a model.

    Raises InputError if the model's assumptions exclude a parameter of a body, or if a drive inertia is unknown.
    """
    n = model.n
    each = [np.tile(row, n) for row in np.eye(PARAMETERS_PER_LINK)[:BODY_PARAMETERS]]
    refuse_outside(model.mechanism, each, f"{model.mechanism.name}: theta_from_bodies takes bodies whose")
    sizes = 1.0 + np.arange(n) / 8.0
    masses, coms = MASS * sizes, np.outer(sizes, COM)
    inertias = sizes[:, None, None] ** 2 * INERTIA
    B = model.B.reshape(model.l, n, PARAMETERS_PER_LINK)
    still = np.zeros((n, 3))
    return BodiesMap(
        links=model.link_names,
        columns=B[:, :, :BODY_PARAMETERS].reshape(model.l, -1),
        constant=model.theta_for(np.zeros(n), still, np.zeros((n, 3, 3))),
        masses=masses,
        coms=coms,
        inertias=np.array([six_of(matrix) for matrix in inertias]),
        theta_b=model.theta_for(masses, coms, inertias),
    )
