"""Random small trees and the second derivatives of their weighted torques and accelerations: a textbook's Newton-Euler on
CasADi's symbols, differentiated by CasADi along q (+) x. No psdmc in it, and no finite differences."""

from __future__ import annotations

import operator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import casadi
import numpy as np
from hypothesis import strategies as st
from pinocchio_in_casadi import following, hessian, inverse_dynamics, solved, stepped
from random_trees import PARALLEL, TREES, RandomTree

from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.coordinates import Coordinate

Array = np.ndarray

SHAPES = (*(TREES[name] for name in ("a fork", "a wrist with two fingers", "two on the base")), (-1, 0, 1))
"""Parents; in these trees psdmc and Pinocchio count joints alike."""


@dataclass(frozen=True)
class HessianTree:
    """A tree, of whose joints some may follow others."""

    tree: RandomTree
    coordinates: tuple[Coordinate, ...] = ()

    @cached_property
    def model(self) -> DynamicsModel:
        return derive_model(replace(self.tree.mechanism(), coordinates=self.coordinates), expand=False)

    @cached_property
    def given(self) -> dict[str, Array]:
        """Two states: (2, ...) each."""
        q, qd, qdd = self.tree.motion(2, seed=1)
        states = {"q": q, "qd": qd, "qdd": qdd, "cotangent": np.random.default_rng(2).normal(size=qd.shape)}
        kept = [i for i, each in enumerate(self.coordinates) if each.leader == i] or slice(None)
        found = {name: values[:, kept] for name, values in states.items()}
        rows = zip(found["q"], found["qd"], found["qdd"], strict=True)
        return found | {"tau": np.array([np.array(self._torques(*row))[:, 0] for row in rows])}

    @cached_property
    def arrays(self) -> RobotOnArrays:
        return RobotOnArrays.of(self.model, np.asarray(self.model.theta_b))

    @cached_property
    def _torques(self) -> casadi.Function:
        whole = inverse_dynamics(self.tree.model)
        if not self.coordinates:
            return whole
        own = [i for i, each in enumerate(self.coordinates) if each.leader == i]
        spread = np.zeros((len(self.coordinates), len(own)))
        for row, each in zip(spread, self.coordinates, strict=True):
            row[own.index(each.leader)] = each.ratio
        return following(whole, spread, np.array([each.offset for each in self.coordinates]))

    def expected(self, third: str) -> Array:
        """Second derivatives of the weighted torques (third: qdd) or accelerations (tau)."""
        found = self._torques if third == "qdd" else solved(self._torques)
        move = operator.add if self.coordinates else partial(stepped, self.tree.model)
        second = hessian(found, move)
        names = ("q", "qd", third, "cotangent")
        return np.array([second(*row) for row in zip(*(self.given[name] for name in names), strict=True)])


@st.composite
def trees(draw: st.DrawFn, letters: str = "RPFS") -> HessianTree:
    """Of sliding and turning joints, and of free and ball joints anywhere."""
    parents = draw(st.sampled_from(SHAPES))
    kinds = "".join(draw(st.lists(st.sampled_from(letters), min_size=len(parents), max_size=len(parents))))
    seed, parallel = draw(st.integers(0, 1000)), draw(st.sampled_from(PARALLEL))
    return HessianTree(RandomTree(seed, parents, kinds, parallel))


@st.composite
def with_mimic_joints(draw: st.DrawFn) -> HessianTree:
    """The last joint follows another one."""
    tree = draw(trees("RP")).tree
    leader = draw(st.integers(0, tree.n - 2))
    ratio, offset = draw(st.sampled_from((-1.5, 0.7, 2.0))), draw(st.floats(-1.0, 1.0))
    own = [Coordinate(i) for i in range(tree.n - 1)]
    return HessianTree(tree, (*own, Coordinate(leader, ratio, offset)))


def error(found: Array, expected: Array) -> float:
    """Relative to the largest entry; absolute if all entries are zero, as of joints that only slide."""
    return float(np.abs(found - expected).max() / (np.abs(expected).max() or 1.0))
