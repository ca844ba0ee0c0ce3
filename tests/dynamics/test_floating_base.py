"""Columns of forward dynamics' derivatives that need no dynamics, against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from limbed import SHAPES, limbed

from psdmc.dynamics.forward_dynamics import KNOWN_BY_Q, KNOWN_BY_QD, known_derivatives
from psdmc.dynamics.frames import has_floating_base


@pytest.mark.parametrize("seed", [1, 2])
def test_they_are_a_block_and_zeros(seed: int) -> None:
    tree = limbed(seed, *SHAPES["four legs of a floating body"])
    q, qd, tau = (rows[0] for rows in tree.motion(1))
    assert has_floating_base(tree.frames)
    by_turn, by_rate = known_derivatives(tree.frames, list(q), list(qd), tree.up)

    pin.computeABADerivatives(tree.model, tree.data, q, qd, tau)

    wanted = np.zeros((2, len(qd), 6))
    wanted[0, :3, 3:6], wanted[1, :3, :3] = by_turn, by_rate
    for found, expected, count in (
        (tree.data.ddq_dq, wanted[0], KNOWN_BY_Q),
        (tree.data.ddq_dv, wanted[1], KNOWN_BY_QD),
    ):
        np.testing.assert_allclose(found[:, :count], expected[:, :count], atol=1e-11 * np.abs(found).max())


def test_a_fixed_base_and_a_ball_joint_have_none() -> None:
    for trunk in ("RR", "S"):
        assert not has_floating_base(limbed(1, trunk, [(0, "RP", 2)]).frames)
