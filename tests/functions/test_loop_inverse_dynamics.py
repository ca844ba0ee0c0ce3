"""Torques of a four-bar's motor from energies along the closed form; test_closed_loops.py has those of trees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from test_closed_loops import assembled, four_bar, rates


def test_a_four_bar_has_the_torque_of_its_one_coordinate(tmp_path: Path) -> None:
    """Rates in closed form, accelerations as their differences; one torque, from the energies along the closed form."""
    model, step = four_bar(tmp_path, passive=["coupler_pin", "rocker_pin"]), 1e-4

    def slope(function: object, crank: float) -> float:
        near, far = (function(crank + k * step) - function(crank - k * step) for k in (1, 2))
        return (8 * near - far) / (12 * step)

    def inertia(crank: float) -> float:
        along = rates(assembled(crank), 1.0)
        return float(along @ model.mass_matrix(assembled(crank)) @ along)

    for crank, rate, acceleration in ((0.4, 3.0, 0.0), (2.0, -1.5, 4.0), (-1.0, 0.0, -2.0)):
        q = assembled(crank)
        given = q, [rate, 7.0, -8.0], [acceleration, 9.0, 5.0]
        found = model.passive_motion(*given)
        np.testing.assert_allclose(found.qd_closed, rates(q, rate), atol=1e-12)
        bent = np.array(
            [slope(lambda angle, k=k, rate=rate: rates(assembled(angle), rate)[k], crank) for k in range(3)]
        )
        np.testing.assert_allclose(found.qdd_closed, bent * rate + rates(q, acceleration), atol=1e-8)
        pull = slope(lambda angle: float(model.potential_energy(assembled(angle))), crank)
        expected = inertia(crank) * acceleration + 0.5 * slope(inertia, crank) * rate**2 + pull
        tau, forces = model.loop_inverse_dynamics(*given)
        assert abs(tau[0] - expected) < 1e-8 * max(1.0, abs(expected))
        assert not tau[1:].any()
        held = model.contact_inverse_dynamics(
            q, found.qd_closed, found.qdd_closed, np.ones(len(model.contacts))
        )
        np.testing.assert_allclose(held.tau, tau, atol=1e-10)
        np.testing.assert_allclose(held.forces[-2:], forces, atol=1e-10)
        assert not held.forces[:-2].any()
        # The torque and the loops' forces move the mechanism so.
        moved = model.constrained_forward_dynamics(q, found.qd_closed, tau, np.zeros(len(model.contacts)))
        np.testing.assert_allclose(moved.qdd, found.qdd_closed, atol=1e-9)
        np.testing.assert_allclose(moved.forces[-2:], forces, atol=1e-9)
