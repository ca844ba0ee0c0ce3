"""Impacts against Pinocchio, by what they keep, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import EVERY, matches_pinocchio
from contact_trees import BRICK, brick, contact_tree

from psdmc.errors import InputError


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_impacts_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("impulse", robot, real)


def test_contacts_stop_or_rebound_and_an_elastic_impact_keeps_the_energy() -> None:
    own = contact_tree(0, floating=True)
    q, before, active = own.given["q"], own.given["qd_before"], own.given["active"]
    on = np.repeat(active, own.model.mechanism.rows_of_contacts, axis=1) > 0
    rows = own.robot.contact_jacobian(q)
    for restitution in (0.0, 0.4, 1.0):
        after, impulses = own.robot.impulse(q, before, active, restitution)
        left = np.einsum("kij,kj->ki", rows, after + restitution * before)
        assert np.abs(left[on]).max() < 1e-10 * np.abs(before).max()
        assert not impulses[~on].any()
    energies = [own.model.kinetic_energy(q, rates) for rates in (before, after)]
    np.testing.assert_allclose(*energies, rtol=1e-11)
    plain = own.robot.impulse(q, before, active)
    assert np.array_equal(plain.qd_after, own.robot.impulse(q, before, active, 0.0, 0.0).qd_after)


def test_a_brick_that_lands_on_its_centre_of_mass() -> None:
    model = brick("brick")
    after, impulse = model.impulse(BRICK, [0.3, 0.0, -2.0, 0.0, 0.0, 1.0], [1.0], 0.5)
    np.testing.assert_allclose(after, [-0.15, 0.0, 1.0, 0.0, 0.0, 1.0], atol=1e-14)
    np.testing.assert_allclose(impulse, [-1.8, 0.0, 12.0], atol=1e-14)


@pytest.mark.parametrize("restitution", [-0.1, 1.5])
def test_restitution_is_from_0_to_1(restitution: float) -> None:
    own = contact_tree(0, floating=True)
    state = [own.given[name][0] for name in ("q", "qd_before", "active")]
    for robot in (own.robot, own.model):
        with pytest.raises(InputError, match=rf": restitution is {restitution:g}\nhint: give 0 to 1$"):
            robot.impulse(*state, restitution)
