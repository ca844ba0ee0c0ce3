"""Whole robots of the example-robot-data wheel on a fixed or a free base, Pinocchio's own model of each file, mimic joints
too, and the file's numbers in extended precision."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import pinocchio as pin
from extended_tree import ROOT_V, ExtendedTree
from installed import in_wheel

from psdmc.robot.coordinates import MimicMap
from psdmc.robot.load import LoadedRobot, load_robot

ROBOTS = {
    "alex_sake_hands.urdf": 23,
    "allegro_right_hand.urdf": 16,
    "anymal.urdf": 12,
    "anymal-kinova.urdf": 18,
    "b1-z1.urdf": 19,
    "baxter.urdf": 19,
    "centauro.urdf": 39,
    "g1_29dof_with_hand_rev_1_0.urdf": 43,
    "go2.urdf": 12,
    "human.urdf": 36,
    "icub.urdf": 32,
    "panda.urdf": 9,
    "pr2.urdf": 30,
    "quadruped.urdf": 8,
    "romeo_small.urdf": 31,
    "simple_humanoid.urdf": 29,
    "solo12.urdf": 12,
    "talos_reduced.urdf": 32,
    "tiago.urdf": 48,
    "tiago_pro.urdf": 33,
}
"""Movable joints of each; those of baxter, panda, pr2 and tiago_pro that mimic others are among them."""

COUNT = 30
FIGURES = ("rnea", "nle", "gravity", "M", "kinetic", "potential", "cmm")
Array = np.ndarray


class RealTree:
    """One robot, none of its rotations snapped: exactly the file's.

    oracle   Pinocchio's buildModelFromXML of the file; a continuous joint is an angle, not a cosine and a sine
    free     the same, every joint with a coordinate of its own: Pinocchio has no energies of mimic joints
    """

    def __init__(self, name: str, is_floating: bool = False) -> None:
        self.loaded: LoadedRobot = load_robot(in_wheel(name), snap=0.0, floating=is_floating)
        text = self.loaded.source_text.replace('type="continuous"', 'type="revolute"')
        root = [pin.JointModelFreeFlyer()] if is_floating else []
        self.oracle = pin.buildModelFromXML(text, *root, mimic=True)
        self.free = pin.buildModelFromXML(text, *root)
        self.mimic_map = MimicMap.of(self.loaded.mechanism.coordinates, self.loaded.mechanism.types)
        n = self.oracle.nv
        self.q, self.qd, self.qdd = (
            np.random.default_rng(len(name)).uniform(-1.0, 1.0, (3, COUNT, n))
            * (np.array([np.pi, 3.0, 5.0])[:, None, None])
        )
        if is_floating:
            turns = np.random.default_rng(COUNT).normal(size=(COUNT, 4))
            turns /= np.linalg.norm(turns, axis=1, keepdims=True)
            self.q = np.hstack([self.q[:, :3], turns, self.q[:, ROOT_V:]])
        joints = list(self.oracle.names)[1 + len(root) :]
        self.extended = ExtendedTree(self.loaded.source_text, joints, is_floating)

    def each(self, function: Callable[..., object], *states: Array, model: pin.Model | None = None) -> Array:
        model = model or self.oracle
        data = model.createData()
        return np.array([np.array(function(model, data, *row)) for row in zip(*states, strict=True)])

    @cached_property
    def tau(self) -> Array:
        return self.each(pin.rnea, self.q, self.qd, self.qdd)

    @cached_property
    def truth(self) -> dict[str, Array]:
        """In extended precision, of the file's numbers, a name of FIGURES each."""
        still = np.zeros_like(self.qd)
        moving, resting = self.extended.at(self.q, self.qd, self.qdd), self.extended.at(self.q, still, still)
        at_zero = self.extended.at(self.neutral[None, :], still[:1], still[:1])
        return {
            "rnea": moving.torques,
            "nle": self.extended.at(self.q, self.qd, still).torques,
            "gravity": resting.torques,
            "M": moving.mass_matrix,
            "kinetic": moving.kinetic_energy,
            "potential": moving.potential_energy - at_zero.potential_energy,
            "cmm": moving.centroidal_momentum_matrix,
        }

    @cached_property
    def pinocchios(self) -> dict[str, Array]:
        found = (self.tau, self.bias, self.gravity, self.mass, self.kinetic, self.potential, self.momentum)
        return dict(zip(FIGURES, found, strict=True))

    @property
    def neutral(self) -> Array:
        return np.asarray(pin.neutral(self.oracle))

    @cached_property
    def mass(self) -> Array:
        upper = np.triu(self.each(pin.crba, self.q))
        return upper + np.triu(upper, 1).transpose(0, 2, 1)

    @cached_property
    def bias(self) -> Array:
        return self.each(pin.nonLinearEffects, self.q, self.qd)

    @cached_property
    def gravity(self) -> Array:
        return self.each(pin.computeGeneralizedGravity, self.q)

    @cached_property
    def kinetic(self) -> Array:
        q, qd = self.mimic_map.positions(self.q), self.mimic_map.rates(self.qd)
        return self.each(pin.computeKineticEnergy, q, qd, model=self.free)

    @cached_property
    def potential(self) -> Array:
        """Above that where every joint is at zero."""
        neutral = self.mimic_map.positions(self.neutral)
        at_zero = pin.computePotentialEnergy(self.free, self.free.createData(), neutral)
        q = self.mimic_map.positions(self.q)
        return self.each(pin.computePotentialEnergy, q, model=self.free) - at_zero

    @cached_property
    def momentum(self) -> Array:
        """The centroidal momentum matrix, (count, 6, nv)."""
        q = self.mimic_map.positions(self.q)
        return self.mimic_map.summed(self.each(pin.computeCentroidalMap, q, model=self.free))

    @cached_property
    def condition(self) -> float:
        return float(np.linalg.cond(self.mass).max())

    @cached_property
    def base_parameters(self) -> int:
        """Rank of Pinocchio's regressor, over bodies that the file has; columns that are rounding beside the largest have no
        effect."""
        data, rng = self.free.createData(), np.random.default_rng(1)
        bodies = self.free.njoints - 1
        factor = np.zeros((0, 10 * bodies))
        for _ in range(3 * len(self.loaded.chain)):
            q, qd, qdd = rng.uniform(-2.0, 2.0, (3, self.oracle.nv))
            if self.extended.is_floating:
                turn = rng.normal(size=4)
                q = np.hstack([q[:3], turn / np.linalg.norm(turn), q[ROOT_V:]])
            joints = self.mimic_map.positions(q), self.mimic_map.rates(qd), self.mimic_map.rates(qdd)
            rows = pin.computeJointTorqueRegressor(self.free, data, *joints)
            factor = np.linalg.qr(np.vstack([factor, self.mimic_map.ratios.T @ rows]), mode="r")
        sizes = np.linalg.norm(factor, axis=0)
        sizes[np.repeat([body.mass == 0.0 for body in self.free.inertias.tolist()[1:]], 10)] = 0.0
        kept = factor[:, sizes > 1e-13 * sizes.max()]
        values = np.linalg.svd(kept / np.linalg.norm(kept, axis=0), compute_uv=False)
        return int(np.count_nonzero(values > 1e-10 * values[0]))


NOTHING = 1e-12
"""Share of a robot's largest value below which a joint's is rounding: a vertical axis under gravity, for one."""


def error(found: Array, expected: Array, least: Array | float = 0.0) -> float:
    """Largest difference relative to the largest value of the same joint (a matrix's row), or to the robot's where that is
    NOTHING beside it, or to `least` where that is larger; of the momentum matrix, rows are its six parts."""
    others = (0, 2) if expected.ndim == 3 else 0
    overall = float(np.abs(expected).max())
    scale = np.abs(expected).max(axis=others)
    scale = np.maximum(np.where(scale > NOTHING * overall, scale, overall or 1.0), least)
    return float(np.max(np.abs(found - expected).max(axis=others) / scale))
