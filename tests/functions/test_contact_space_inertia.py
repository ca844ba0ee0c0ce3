"""Contact-space inertias against Pinocchio, in closed form, as inverses of the Delassus matrix, and where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import EVERY, matches_pinocchio
from contact_trees import BRICK, brick, contact_tree

from psdmc.errors import InputError


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    """Trees with every mask at mu = 0 are in the test of constrained_forward_dynamics."""
    matches_pinocchio("contact_space_inertia", robot, real)


def test_it_inverts_the_delassus_matrix_of_the_active_contacts() -> None:
    own = contact_tree(1, True)
    q, active, mu = own.given["q"], own.given["active"], np.linspace(0.0, 1.0, len(own.given["q"]))
    found, seen = own.robot.contact_space_inertia(q, active, mu), own.robot.delassus(q)
    assert np.array_equal(found, np.swapaxes(found, -1, -2))
    for inertia, matrix, on, shift in zip(found, seen, active, mu, strict=True):
        chosen = np.repeat(on, own.loaded.mechanism.rows_of_contacts) > 0.0
        assert not inertia[~chosen].any()
        whole = matrix[np.ix_(chosen, chosen)] + shift * np.eye(chosen.sum())
        inverse = inertia[np.ix_(chosen, chosen)]
        assert np.abs(inverse @ whole - np.eye(len(whole))).max(initial=0.0) < 1e-9


def test_a_body_has_its_own_mass_and_inertia() -> None:
    found = brick("brick:6").contact_space_inertia(BRICK, [1.0])
    np.testing.assert_allclose(found, np.diag([4.0, 4.0, 4.0, 0.02, 0.03, 0.04]), atol=1e-12)


def test_two_contacts_that_hold_the_same_motion_need_mu() -> None:
    model = brick("edge", "side")
    with pytest.raises(InputError, match="of the active contacts is not positive definite at mu = 0"):
        model.contact_space_inertia(BRICK, [1.0, 1.0])
    with pytest.raises(InputError, match=r"active of 'edge' is 0\.5"):
        model.contact_space_inertia(BRICK, [0.5, 0.0])
    with pytest.raises(InputError, match=r"mu is -0\.1"):
        model.contact_space_inertia(BRICK, [1.0, 0.0], -0.1)
    assert np.isfinite(model.contact_space_inertia(BRICK, [1.0, 1.0], mu=1e-6)).all()
