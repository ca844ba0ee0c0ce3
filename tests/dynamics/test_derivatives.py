"""Derivatives of inverse dynamics on small trees, sliding and helical joints included, against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from random_trees import CHOICES, COUNT, EXACT, KINDS, TREES, RandomTree, columns, on_trees

from psdmc.dynamics.choices import Choices
from psdmc.dynamics.derivatives import inverse_dynamics_derivatives

trees = on_trees(KINDS)
CHAINS = {"a chain of one": (-1,), "a chain of two": (-1, 0), "a chain of seven": (-1, 0, 1, 2, 3, 4, 5)}


def found_in(tree: RandomTree, states, choices: Choices = CHOICES[0]) -> list[np.ndarray]:
    given = [list(values.T) for values in states]
    blocks = inverse_dynamics_derivatives(tree.frames, tree.bodies, tree.drives, *given, tree.up, choices)
    return [np.stack([columns(row) for row in block], axis=1) for block in blocks[:3]]


def pinocchios(tree: RandomTree, states) -> list[np.ndarray]:
    def blocks(model, data, *state):
        by_q, by_qd, by_qdd = pin.computeRNEADerivatives(model, data, *state)
        whole = np.stack([by_q, by_qd, np.triu(by_qdd) + np.triu(by_qdd, 1).T])
        return whole[:, tree.order]

    return list(np.moveaxis(tree.each(blocks, *states), 1, 0))


def assert_blocks_near(found: list[np.ndarray], expected: list[np.ndarray]) -> None:
    scale = max(float(np.abs(block).max()) for block in expected)
    for one, other in zip(found, expected, strict=True):
        largest = float(np.abs(other).max())
        assert np.abs(one - other).max() <= EXACT * (largest if largest > 1e-9 * scale else scale)


@trees
def test_the_derivatives_are_pinocchios_however_they_are_arranged(parents, kinds, parallel) -> None:
    tree = RandomTree(11, parents, kinds, parallel)
    states = tree.states(COUNT, 3)
    expected = pinocchios(tree, states)
    for choices in tree.choices:
        assert_blocks_near(found_in(tree, states, choices), expected)


@on_trees(KINDS, CHAINS.values())
def test_chains_too(parents, kinds, parallel) -> None:
    tree = RandomTree(12, parents, kinds, parallel)
    states = tree.states(COUNT, 3)
    expected = pinocchios(tree, states)
    for choices in tree.choices:
        assert_blocks_near(found_in(tree, states, choices), expected)


def test_joints_on_different_branches_do_not_feel_each_other() -> None:
    tree = RandomTree(13, TREES["a trunk with two arms"], "RRRRRR")
    blocks = inverse_dynamics_derivatives(
        tree.frames, tree.bodies, tree.drives, [0.3] * 6, [0.1] * 6, [0.2] * 6, tree.up
    )
    for block in blocks[:3]:
        for i, j in ((2, 4), (4, 2), (3, 5), (5, 2)):
            assert block[i][j] == 0.0
            assert isinstance(block[i][j], float)


@trees
def test_gravity_comes_with_them(parents, kinds, parallel) -> None:
    tree = RandomTree(15, parents, kinds, parallel)
    states = tree.states(COUNT, 3)
    expected = tree.each(pin.computeGeneralizedGravity, states[0])
    for choices in CHOICES[::5]:
        found = inverse_dynamics_derivatives(
            tree.frames, tree.bodies, tree.drives, *(list(values.T) for values in states), tree.up, choices
        )
        assert np.abs(columns(found.gravity) - expected).max() <= EXACT * np.abs(expected).max()
