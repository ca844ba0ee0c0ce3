"""Random trees of up to twenty bodies, derived and lowered, against Pinocchio.

`make test` takes a few, `make test-trees` 300.
"""

from __future__ import annotations

import os

import numpy as np
import pinocchio as pin
import pytest
from random_trees import RandomTree
from slow_cases import slow_but_for

from psdmc.derivation.derive import derive_model
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.interpret import interpret

COUNT = 300 if os.environ.get("PSDMC_TREES") == "whole" else 12
LOWERED = 100 if os.environ.get("PSDMC_TREES") == "whole" else 4
BODIES, BODIES_LOWERED = 20, 7
SEEDS = range(1000, 1000 + LOWERED)
"""Of 1001, the largest of the first four, lowering takes as long as of all others together."""
STATES = 20
EXACT = 1e-12


def drawn(seed: int, bodies: int) -> RandomTree:
    """Any parents, axes oblique, at right angles or parallel; joints that turn, slide or screw, and, in every other tree,
    those of several coordinates too: free, spherical, planar, translating."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, bodies + 1))
    parents = tuple(int(rng.integers(-1, i)) for i in range(n))
    kinds = "".join(rng.choice(list("RRRPPH" if seed % 2 == 0 else "RRRPHFSLT"), n))
    return RandomTree(seed, parents, kinds, parallel=float(rng.choice([0.0, 0.3, 0.7])))


def rank(tree: RandomTree) -> int:
    """Of Pinocchio's regressor and the drive inertias beside, column by column of length one."""
    driven = np.flatnonzero(tree.model.armature)
    factor = np.zeros((0, 10 * tree.n + len(driven)))
    for q, qd, qdd in zip(*tree.motion(4 * tree.nv + 20, seed=1), strict=True):
        state = tree.theirs_at(q), tree.theirs(qd), tree.theirs(qdd)
        own = pin.computeJointTorqueRegressor(tree.model, tree.data, *state)
        rows = np.hstack([own, np.diag(state[2])[:, driven]])
        factor = np.linalg.qr(np.vstack([factor, rows]), mode="r")
    sizes = np.linalg.norm(factor, axis=0)
    kept = factor[:, sizes > 1e-13 * sizes.max()]
    values = np.linalg.svd(kept / np.linalg.norm(kept, axis=0), compute_uv=False)
    return int(np.count_nonzero(values > 1e-10 * values[0]))


def mass_matrices(tree: RandomTree, q: np.ndarray) -> np.ndarray:
    def whole(model: pin.Model, data: pin.Data, row: np.ndarray) -> np.ndarray:
        upper = np.triu(pin.crba(model, data, row))
        return (upper + np.triu(upper, 1).T)[tree.order]

    return tree.each(whole, q)


def error(found: np.ndarray, expected: np.ndarray) -> float:
    """Relative to each joint's largest value, a matrix's as one; absolute where a joint has none."""
    axis = None if expected.ndim == 3 else 0
    scale = np.abs(expected).max(axis=axis)
    return float(np.max(np.abs(found - expected).max(axis=axis) / np.where(scale > 1e-13, scale, 1.0)))


SLIGHT = 1e-3
"""A slider that gravity is all but square to has a torque to which the last digit of a direction adds 1e-12 of itself:
gravity torques below this share of the robot's largest are compared on that scale."""


def gravity_error(found: np.ndarray, expected: np.ndarray) -> float:
    scale = np.maximum(np.abs(expected).max(axis=0), SLIGHT * np.abs(expected).max())
    return float(np.max(np.abs(found - expected).max(axis=0) / scale))


@pytest.mark.parametrize("seed", range(COUNT))
def test_models_of_random_trees(seed: int) -> None:
    tree = drawn(seed, BODIES)
    model = derive_model(tree.mechanism(), expand=False)  # the tests' own screws have no E and P
    q, qd, qdd = tree.motion(STATES)
    tau, bias = tree.each(pin.rnea, q, qd, qdd), tree.each(pin.nonLinearEffects, q, qd)
    gravity = tree.each(pin.computeGeneralizedGravity, q)
    assert error(model.inverse_dynamics(q, qd, qdd), tau) <= EXACT
    assert error(model.nonlinear_effects(q, qd), bias) <= EXACT
    assert gravity_error(model.gravity(q), gravity) <= EXACT
    assert error(model.regressor(q, qd, qdd) @ model.theta_b, tau) <= EXACT
    assert error(model.mass_matrix(q), mass_matrices(tree, q)) <= EXACT
    assert model.l == rank(tree)


@pytest.mark.parametrize("seed", slow_but_for([seed for seed in SEEDS if seed != 1001], SEEDS))
def test_programs_of_random_trees(seed: int) -> None:
    tree = drawn(seed, BODIES_LOWERED)
    model: DynamicsModel = derive_model(tree.mechanism(), expand=False)
    made = lower(model, "factored", ("inverse_dynamics", "forward_dynamics", "mass_matrix"))
    q, qd, qdd = tree.motion(STATES)
    tau, mass = tree.each(pin.rnea, q, qd, qdd), mass_matrices(tree, q)
    n = tree.nv
    given = {"q": q, "qd": qd, "qdd": qdd, "tau": tau}
    given["theta_b"] = np.broadcast_to(model.theta_b, (STATES, model.l))
    condition = float(np.linalg.cond(mass).max())
    sizes = {"tau": n, "qdd": n, "M": n * n, "pivot": n}
    for name, kernel in made.items():
        for program in (kernel.single, kernel.batch):
            found = interpret(program, given, sizes)
            if name.startswith("inverse_dynamics"):
                assert error(found["tau"], tau) <= EXACT
            elif name.startswith("mass_matrix"):
                assert error(found["M"].reshape(-1, n, n), mass) <= EXACT
            else:
                assert found["pivot"].min() > 0.0
                assert error(found["qdd"], qdd) <= 1e-10 * max(1.0, condition / 1e6)
