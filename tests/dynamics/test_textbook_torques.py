"""Torques and mass matrices of textbook mechanisms, by the textbooks' formulas."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.dynamics.choices import Choices
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.frames import BASE, Frame, frame_at
from psdmc.dynamics.momentum_and_energy import kinetic_energy, potential_energy
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.spatial import body_from_parameters
from psdmc.robot.joints import PRISMATIC, REVOLUTE
from psdmc.robot.mechanism import Placement

G = 9.81
ALONG_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""A joint frame whose z, x, y are the outer frame's x, y, z."""

ARRANGED = [Choices(), Choices(compound=True), Choices(fold=True), Choices(True, True, True, True)]


def states(n: int, count: int = 50) -> list[list[np.ndarray]]:
    """q, qd, qdd: n arrays each."""
    return [list(v) for v in np.random.default_rng(1).uniform(-2.0, 2.0, (3, n, count))]


def body(mass: float, centre: tuple[float, float, float], inertia: tuple[float, float, float]):
    """A body by its inertia about its centre of mass, along the joint frame's axes."""
    about = np.diag(inertia) + mass * (np.dot(centre, centre) * np.eye(3) - np.outer(centre, centre))
    six = about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return body_from_parameters([mass, *(mass * np.array(centre)), *six])


@pytest.mark.parametrize("choices", ARRANGED)
def test_double_pendulum(choices: Choices) -> None:
    """Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, section 7.4: two-link planar arm, q1 from the
    horizontal."""
    m1, m2, l1, c1, c2, i1, i2 = 1.3, 0.9, 0.7, 0.3, 0.25, 0.05, 0.02
    frames = [
        frame_at(REVOLUTE, BASE, Placement.identity()),
        frame_at(REVOLUTE, 0, Placement(np.eye(3), np.array([l1, 0.0, 0.0]))),
    ]
    bodies = [body(m1, (c1, 0.0, 0.0), (0.0, 0.0, i1)), body(m2, (c2, 0.0, 0.0), (0.0, 0.0, i2))]
    q, qd, qdd = states(2)
    tau = inverse_dynamics(frames, bodies, [0.0, 0.0], q, qd, qdd, (0.0, G, 0.0), choices)

    d11 = m1 * c1**2 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * np.cos(q[1])) + i1 + i2
    d12 = m2 * (c2**2 + l1 * c2 * np.cos(q[1])) + i2
    d22 = m2 * c2**2 + i2
    h = -m2 * l1 * c2 * np.sin(q[1])
    g2 = m2 * c2 * G * np.cos(q[0] + q[1])
    g1 = (m1 * c1 + m2 * l1) * G * np.cos(q[0]) + g2
    first = d11 * qdd[0] + d12 * qdd[1] + h * qd[1] * qd[0] + h * (qd[0] + qd[1]) * qd[1] + g1
    second = d12 * qdd[0] + d22 * qdd[1] - h * qd[0] * qd[0] + g2
    np.testing.assert_allclose(tau[0], first, atol=1e-13)
    np.testing.assert_allclose(tau[1], second, atol=1e-13)

    M = mass_matrix(frames, bodies, [0.0, 0.0], q, choices)
    np.testing.assert_allclose(M[0][0], d11, atol=1e-14)
    np.testing.assert_allclose(M[1][0], d12, atol=1e-14)
    np.testing.assert_allclose(M[1][1], d22, atol=1e-14)
    kinetic = 0.5 * (d11 * qd[0] ** 2 + 2 * d12 * qd[0] * qd[1] + d22 * qd[1] ** 2)
    np.testing.assert_allclose(kinetic_energy(frames, bodies, [0.0, 0.0], q, qd), kinetic, atol=1e-13)
    height = m1 * c1 * np.sin(q[0]) + m2 * (l1 * np.sin(q[0]) + c2 * np.sin(q[0] + q[1]))
    np.testing.assert_allclose(potential_energy(frames, bodies, q, (0.0, G, 0.0)), G * height, atol=1e-13)


@pytest.mark.parametrize("choices", ARRANGED)
def test_cart_and_pole(choices: Choices) -> None:
    """(M + m) x'' + m l (cos(a) a'' - sin(a) a'^2) = F, m l cos(a) x'' + (I + m l^2) a'' - m g l sin(a) = T, with a from
    upright, towards +x (Florian 2007, Correct equations for the dynamics of the cart-pole system, without friction)."""
    cart, m, l, inertia = 2.1, 0.4, 0.6, 0.03
    # The pole's hinge is along the cart's y (world: x along the rail, z up), its own x along the pole.
    hinge = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    upright = ALONG_X.T @ hinge
    frames: list[Frame] = [
        frame_at(PRISMATIC, BASE, Placement(ALONG_X, np.zeros(3))),
        frame_at(REVOLUTE, 0, Placement(upright, np.zeros(3))),
    ]
    bodies = [
        body(cart, (0.1, 0.2, 0.3), (0.1, 0.1, 0.1)),
        body(m, (l, 0.0, 0.0), (0.0, inertia, inertia)),
    ]
    (_x, a), (_, ad), (xdd, add) = states(2)
    q, qd, qdd = states(2)
    force, torque = inverse_dynamics(frames, bodies, [0.0, 0.0], q, qd, qdd, (0.0, 0.0, G), choices)
    np.testing.assert_allclose(
        force, (cart + m) * xdd + m * l * (np.cos(a) * add - np.sin(a) * ad**2), atol=1e-13
    )
    np.testing.assert_allclose(
        torque, m * l * np.cos(a) * xdd + (inertia + m * l**2) * add - m * G * l * np.sin(a), atol=1e-13
    )


@pytest.mark.parametrize("choices", ARRANGED)
def test_furuta_pendulum(choices: Choices) -> None:
    """Cazzolato and Prime 2011, On the dynamics of the Furuta pendulum, eq. 33 and 34: slender pendulum, a2 from hanging;
    J1 is the arm about its axis, J2 the pendulum about its hinge."""
    arm, length, m, l, own = 0.8, 0.4, 0.3, 0.25, 0.004
    j1, j2 = 0.05, own + m * l**2
    centre = 0.15
    frames = [
        frame_at(REVOLUTE, BASE, Placement.identity()),
        frame_at(REVOLUTE, 0, Placement(ALONG_X, np.array([length, 0.0, 0.0]))),
    ]
    # Along the hinge's axes: the pendulum hangs along -y, which is the arm's -z.
    bodies = [
        body(arm, (centre, 0.0, 0.0), (0.0, 0.01, j1 - arm * centre**2)),
        body(m, (0.0, -l, 0.0), (own, 0.0, own)),
    ]
    (_, a), (bd, ad), (bdd, add) = states(2)
    q, qd, qdd = states(2)
    tau = inverse_dynamics(frames, bodies, [0.0, 0.0], q, qd, qdd, (0.0, 0.0, G), choices)
    j0 = j1 + m * length**2
    first = bdd * (j0 + j2 * np.sin(a) ** 2) + add * m * length * l * np.cos(a)
    first += -m * length * l * np.sin(a) * ad**2 + bd * ad * np.sin(2 * a) * j2
    second = bdd * m * length * l * np.cos(a) + add * j2 - 0.5 * bd**2 * np.sin(2 * a) * j2
    second += G * m * l * np.sin(a)
    np.testing.assert_allclose(tau[0], first, atol=1e-13)
    np.testing.assert_allclose(tau[1], second, atol=1e-13)


def test_two_pendulums_on_one_cart() -> None:
    """A fork in closed form: each pole adds its own terms to the cart's force, and neither feels the other but through
    the cart."""
    cart, poles = 2.1, ((0.4, 0.6, 0.03), (0.7, 0.3, 0.01))
    hinge = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    upright = Placement(ALONG_X.T @ hinge, np.zeros(3))
    frames = [
        frame_at(PRISMATIC, BASE, Placement(ALONG_X, np.zeros(3))),
        frame_at(REVOLUTE, 0, upright),
        frame_at(REVOLUTE, 0, upright),
    ]
    bodies = [body(cart, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))]
    bodies += [body(m, (l, 0.0, 0.0), (0.0, i, i)) for m, l, i in poles]
    q, qd, qdd = states(3)
    for choices in ARRANGED:
        tau = inverse_dynamics(frames, bodies, [0.0] * 3, q, qd, qdd, (0.0, 0.0, G), choices)
        force = (cart + sum(m for m, _, _ in poles)) * qdd[0]
        for k, (m, l, i) in enumerate(poles, start=1):
            a = q[k]
            force = force + m * l * (np.cos(a) * qdd[k] - np.sin(a) * qd[k] ** 2)
            torque = m * l * np.cos(a) * qdd[0] + (i + m * l**2) * qdd[k] - m * G * l * np.sin(a)
            np.testing.assert_allclose(tau[k], torque, atol=1e-13)
        np.testing.assert_allclose(tau[0], force, atol=1e-13)
