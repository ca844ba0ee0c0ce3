"""Whole robots of the example-robot-data wheel on a fixed base, and Pinocchio's own model of each file, mimic joints too."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from psdmc.derivation.last_digit import extended_torques
from psdmc.robot.coordinates import Following
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
Array = np.ndarray


def path_of(name: str) -> Path:
    try:
        wheel = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")
    found = sorted(str(file) for file in wheel.files or () if file.name == name)
    return Path(str(wheel.locate_file(found[0])))


class RealTree:
    """One robot, none of its rotations snapped: exactly the file's.

    oracle   Pinocchio's buildModelFromXML of the file; a continuous joint is an angle, not a cosine and a sine
    free     the same, every joint with a coordinate of its own: Pinocchio has no energies of mimic joints
    """

    def __init__(self, name: str) -> None:
        self.loaded: LoadedRobot = load_robot(path_of(name), snap=0.0)
        text = self.loaded.source_text.replace('type="continuous"', 'type="revolute"')
        self.oracle = pin.buildModelFromXML(text, mimic=True)
        self.free = pin.buildModelFromXML(text)
        self.following = Following.of(self.loaded.mechanism.coordinates, self.loaded.mechanism.types)
        n = self.oracle.nv
        self.q, self.qd, self.qdd = (
            np.random.default_rng(len(name)).uniform(-1.0, 1.0, (3, COUNT, n))
            * (np.array([np.pi, 3.0, 5.0])[:, None, None])
        )

    def each(self, function: Callable[..., object], *states: Array, model: pin.Model | None = None) -> Array:
        model = model or self.oracle
        data = model.createData()
        return np.array([np.array(function(model, data, *row)) for row in zip(*states, strict=True)])

    @cached_property
    def tau(self) -> Array:
        return self.each(pin.rnea, self.q, self.qd, self.qdd)

    def exact(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Torques in extended precision."""
        chain = self.loaded.mechanism
        states = [list(vector.T) for vector in (q, qd, qdd)]
        return extended_torques(chain, chain.parameters.reshape(-1), states)

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
        q, qd = self.following.positions(self.q), self.following.rates(self.qd)
        return self.each(pin.computeKineticEnergy, q, qd, model=self.free)

    @cached_property
    def potential(self) -> Array:
        """Above that where every joint is at zero."""
        at_zero = pin.computePotentialEnergy(self.free, self.free.createData(), np.zeros(self.free.nq))
        q = self.following.positions(self.q)
        return self.each(pin.computePotentialEnergy, q, model=self.free) - at_zero

    @cached_property
    def condition(self) -> float:
        return float(np.linalg.cond(self.mass).max())

    @cached_property
    def base_parameters(self) -> int:
        """Rank of Pinocchio's regressor, over bodies that the file has; columns that are rounding beside the largest have no
        effect."""
        data, rng = self.free.createData(), np.random.default_rng(1)
        bodies = self.free.nv
        factor = np.zeros((0, 10 * bodies))
        for _ in range(3 * len(self.loaded.chain)):
            q, qd, qdd = rng.uniform(-2.0, 2.0, (3, self.oracle.nv))
            joints = self.following.positions(q), self.following.rates(qd), self.following.rates(qdd)
            rows = pin.computeJointTorqueRegressor(self.free, data, *joints)
            factor = np.linalg.qr(np.vstack([factor, self.following.ratios.T @ rows]), mode="r")
        sizes = np.linalg.norm(factor, axis=0)
        sizes[np.repeat([body.mass == 0.0 for body in self.free.inertias.tolist()[1:]], 10)] = 0.0
        kept = factor[:, sizes > 1e-13 * sizes.max()]
        values = np.linalg.svd(kept / np.linalg.norm(kept, axis=0), compute_uv=False)
        return int(np.count_nonzero(values > 1e-10 * values[0]))


NOTHING = 1e-12
"""Share of a robot's largest value below which a joint's is rounding: a vertical axis under gravity, for one."""


def error(found: Array, expected: Array) -> float:
    """Largest difference, column by column relative to the column's largest value, or to the robot's where that is NOTHING
    beside it; a matrix as one."""
    overall = float(np.abs(expected).max())
    scale = overall if expected.ndim == 3 else np.abs(expected).max(axis=0)
    scale = np.where(scale > NOTHING * overall, scale, overall or 1.0)
    return float(np.max(np.abs(found - expected).max(axis=None if expected.ndim == 3 else 0) / scale))
