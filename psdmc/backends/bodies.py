"""The data for the generated function that computes theta_b (the vector of base parameters) from the masses and
inertias of all bodies.

The data are the linear map from body parameters to theta_b, and example bodies for the self-test of the package.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.model.bodies import refuse_outside
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.inertia import six_of
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Array

MASS = 1.25
COM = np.array([0.0625, -0.03125, 0.125])
INERTIA = np.array([[0.03, 0.003, -0.002], [0.003, 0.04, 0.001], [-0.002, 0.001, 0.035]])
"""kg, m, kg m^2 about the centre of mass of the self-test's first body; the next ones are heavier and longer."""


@dataclass(frozen=True, slots=True, eq=False)
class BodiesMap:
    """The linear map theta_b = constant + columns @ p. theta_b are the l base parameters. p (10 n,) are the ten
    standard parameters (mass, first moments, inertia) of each of the n bodies.

    links     n names of bodies, untrusted text
    columns   (l, 10 n) factors of p
    constant  (l,) the part of theta_b that comes from drive inertias (motors and gears)
    masses    (n,) kg, of the example robot in the self-test
    coms      (n, 3) m, centres of mass of the example robot
    inertias  (n, 6) kg m^2, of the example robot
    theta_b   (l,) expected result for the example robot
    """

    links: tuple[str, ...]
    columns: Array
    constant: Array
    masses: Array
    coms: Array
    inertias: Array
    theta_b: Array


def bodies_map(model: DynamicsModel) -> BodiesMap:
    """Return the linear map from the parameters of all bodies to theta_b (the base parameters) for one model.

    Raises InputError if the model was derived under an assumption that excludes some bodies, such as a link without
    mass. Also raises InputError if a drive inertia is unknown.
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
