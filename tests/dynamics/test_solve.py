"""M x = b for mass matrices of trees: zeros between branches stay numbers, and cost nothing."""

from __future__ import annotations

import numpy as np
import pytest
from random_trees import TREES, RandomTree

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.kinematics import path_to
from psdmc.dynamics.solve import factorize, inverse, solve
from psdmc.program.program import Slot
from psdmc.program.trace import Tracer

COUNT = 20

trees = pytest.mark.parametrize("parents", TREES.values(), ids=TREES)


def drawn(parents: tuple[int, ...]) -> tuple[RandomTree, np.ndarray, list]:
    """A tree, its states and its mass matrix there."""
    tree = RandomTree(21, parents, "RPRRPRPR")
    (q,) = tree.states(COUNT, 1)
    return tree, q, [list(row) for row in mass_matrix(tree.frames, tree.bodies, tree.drives, list(q.T))]


def arrays(rows: list) -> np.ndarray:
    return np.stack(
        [np.stack([np.broadcast_to(np.asarray(x, float), (COUNT,)) for x in row], axis=-1) for row in rows],
        axis=-2,
    )


def carries(tree: RandomTree) -> np.ndarray:
    """(n, n) whether the joint of the column carries that of the row."""
    return np.array([[j in path_to(tree.frames, i)[:-1] for j in range(tree.n)] for i in range(tree.n)])


@trees
def test_solutions_and_inverses_are_numpys(parents: tuple[int, ...]) -> None:
    tree, _, rows = drawn(parents)
    factors, matrices = factorize(rows), arrays(rows)
    right = np.random.default_rng(1).normal(size=(COUNT, tree.n))
    found = np.stack(solve(factors, list(right.T)), axis=-1)
    np.testing.assert_allclose(found, np.linalg.solve(matrices, right[..., None])[..., 0], rtol=1e-9)
    np.testing.assert_allclose(arrays(inverse(factors)), np.linalg.inv(matrices), rtol=1e-9, atol=1e-9)


@trees
def test_factors_have_entries_where_one_joint_carries_the_other_and_nowhere_else(
    parents: tuple[int, ...],
) -> None:
    """On arrays too, where a product with zero would be an array of zeros."""
    tree, _, rows = drawn(parents)
    factors, below = factorize(rows), carries(tree)
    for part in (factors.lower, factors.scaled):
        pattern = [[not (isinstance(x, float) and x == 0.0) for x in row] for row in part]
        for i, row in enumerate(pattern):
            assert row == below[i, :i].tolist()


@trees
def test_elimination_costs_what_the_branches_cost(parents: tuple[int, ...]) -> None:
    """Featherstone 2008, section 6.5: of a joint that d others carry, d + d (d + 1) / 2 products and a division."""
    tree = RandomTree(22, parents, "RRRRRRRR")
    below, tracer = carries(tree), Tracer()
    entry = {
        (i, j): tracer.symbol(Slot("M", i * tree.n + j))
        for i in range(tree.n)
        for j in range(i + 1)
        if i == j or below[i, j]
    }
    rows = [[entry.get((max(i, j), min(i, j)), 0.0) for j in range(tree.n)] for i in range(tree.n)]
    factors = factorize(rows)
    values = [*factors.inverses, *(x for row in factors.lower for x in row)]
    found = tracer.cost([(Slot("F", k), value) for k, value in enumerate(values)])
    depth = below.sum(axis=1)
    assert found.mul == sum(depth + depth * (depth + 1) // 2)
    assert found.add == sum(depth * (depth + 1) // 2)
    assert found.div == tree.n
