"""Articulated bodies against Pinocchio's and against a factorized mass matrix, on trees with every joint type."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from random_trees import CHOICES, COUNT, TREES, RandomTree, columns, on_trees

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.forward_dynamics import forward_dynamics
from psdmc.dynamics.frames import Mimic
from psdmc.dynamics.momentum_and_energy import momentum_matrix, total_momentum
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.solve import SingularMatrix, factorize

KINDS = ("RRRRRRRR", "RPRRPRPR", "RHRPHRRH", "FRRRRRRR", "FSLTRPRS", "SRFRPLTR", "TLRRSRRF")

trees = on_trees(KINDS)


def condition(tree: RandomTree, q: np.ndarray) -> float:
    rows = mass_matrix(tree.frames, tree.bodies, tree.drives, list(q.T))
    return float(np.linalg.cond(np.stack([columns(row) for row in rows], axis=1)).max())


@trees
def test_accelerations_are_pinocchios_however_they_are_arranged(parents, kinds, parallel) -> None:
    tree = RandomTree(31, parents, kinds, parallel)
    q, qd, tau = tree.motion(COUNT)
    expected = tree.each(pin.aba, q, qd, tau)
    allowed = 1e-15 * max(condition(tree, q), 1e3) * np.abs(expected).max()
    for choices in tree.choices:
        states = (list(q.T), list(qd.T), list(tau.T))
        found, _ = forward_dynamics(tree.frames, tree.bodies, tree.drives, *states, tree.up, choices)
        np.testing.assert_allclose(columns(found), expected, rtol=0, atol=allowed)


@trees
def test_pivots_are_those_of_the_factorized_mass_matrix(parents, kinds, parallel) -> None:
    tree = RandomTree(32, parents, kinds, parallel)
    q, qd, tau = tree.motion(COUNT)
    factors = factorize(mass_matrix(tree.frames, tree.bodies, tree.drives, list(q.T)))
    _, pivots = forward_dynamics(
        tree.frames, tree.bodies, tree.drives, list(q.T), list(qd.T), list(tau.T), tree.up
    )
    np.testing.assert_allclose(columns(pivots), columns(factors.pivots), rtol=1e-8)
    assert np.all(columns(pivots) > 0.0)


@pytest.mark.parametrize("kinds", ["RRRPRR", "FRRPRR", "SRRLRR"])
def test_wrenches_of_the_world_accelerate_the_links(kinds: str) -> None:
    """The torques that give these accelerations under the same wrenches are those given."""
    tree = RandomTree(33, TREES["a trunk with two arms"], kinds, 0.6)
    q, qd, tau = tree.motion(1)
    rng = np.random.default_rng(3)
    external = {i: (tuple(rng.normal(size=3)), tuple(rng.normal(size=3))) for i in (0, 2, 5)}
    for choices in CHOICES:
        args = (tree.frames, tree.bodies, tree.drives, q[0], qd[0])
        found, _ = forward_dynamics(*args, tau[0], tree.up, choices, external)
        back = inverse_dynamics(*args, found, tree.up, external=external)
        np.testing.assert_allclose(back, tau[0], atol=1e-9)


def test_a_joint_that_moves_no_inertia_is_named() -> None:
    tree = RandomTree(34, TREES["a fork"], "FRR")
    bodies = [body._replace(mass=0.0, moment=(0.0,) * 3, second=(0.0,) * 6) for body in tree.bodies]
    with pytest.raises(SingularMatrix) as caught:
        forward_dynamics(
            tree.frames, [*tree.bodies[:2], bodies[2]], [0.0] * 3, [0.3] * 9, [0.1] * 8, [0.0] * 8, tree.up
        )
    assert caught.value.row == 7


def test_joints_that_follow_others_are_left_to_the_mass_matrix() -> None:
    tree = RandomTree(35, TREES["a fork"], "RRR")
    frames = [*tree.frames[:2], replace(tree.frames[2], mimic=Mimic(((1, -0.5),), 0.1))]
    with pytest.raises(ValueError, match="follows another"):
        forward_dynamics(frames, tree.bodies, tree.drives, [0.1] * 2, [0.1] * 2, [0.0] * 2, tree.up)


@pytest.mark.parametrize("kinds", ["RRPRRR", "FRPRRR"])
def test_momentum_columns_of_mimic_joints_are_their_leaders(kinds: str) -> None:
    """By the momentum of all bodies at unit rates of the coordinates."""
    tree = RandomTree(36, TREES["a trunk with two arms"], kinds, 0.5)
    frames = [*tree.frames[:5], replace(tree.frames[5], mimic=Mimic(((3, -0.7),), 0.2))]
    q = tree.motion(1)[0][0][:-1]
    found = np.array(momentum_matrix(frames, tree.bodies, q), float)
    assert found.shape == (6, tree.nv - 1)
    for column, unit in zip(found.T, np.eye(tree.nv - 1), strict=True):
        linear, angular = total_momentum(frames, tree.bodies, q, unit)
        np.testing.assert_allclose(column, [*linear, *angular], atol=1e-12)
