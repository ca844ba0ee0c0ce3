"""Random small trees of bodies, and Pinocchio's own model of each: an oracle that shares no code; and how answers for them
are laid out and compared."""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from helical import HELICAL, PITCH
from random_chains import _body, _rotation, _tidy
from slow_cases import slow_but_for

from psdmc.dynamics.choices import Choices
from psdmc.dynamics.coordinates import first_rates
from psdmc.dynamics.frames import BASE, Frame, frame_at
from psdmc.dynamics.parameters import moved
from psdmc.dynamics.spatial import Body, body_from_parameters
from psdmc.robot.joints import FREE, PLANAR, PRISMATIC, REVOLUTE, SPHERICAL, TRANSLATION
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Joint, Mechanism, Placement

TYPES = {
    "R": REVOLUTE,
    "P": PRISMATIC,
    "H": HELICAL,
    "F": FREE,
    "S": SPHERICAL,
    "L": PLANAR,
    "T": TRANSLATION,
}

TREES = {
    "a fork": (BASE, 0, 0),
    "two on the base": (BASE, BASE, 1),
    "a wrist with two fingers": (BASE, 0, 1, 1),
    "a trunk with two arms": (BASE, 0, 1, 2, 1, 4),
    "four legs on a body": (BASE, 0, 1, 0, 3, 0, 5, 0),
    "interleaved": (BASE, BASE, 0, 1, 2, 0, 3, 5),
}
"""Parents, body by body."""

KINDS = ("RRRRRRRR", "RPRRPRPR", "PRPPRRRP", "RHRPHRRH")
"""Joints of one coordinate each, body by body."""

PARALLEL = (0.0, 0.6, 1.0)
"""How probable it is that an axis is parallel to its parent's."""

CHOICES = [Choices(*flags) for flags in product((False, True), repeat=4)]
WHOLE = os.environ.get("PSDMC_TREES") == "whole"
COUNT = 5
"""States."""

EXACT = 1e-12
"""Of the largest value: of a joint, or of a block."""


def on_trees(
    kinds: Iterable[str], parents: Iterable[tuple[int, ...]] = TREES.values()
) -> pytest.MarkDecorator:
    """A test of (parents, kinds, parallel) on every tree; quick: every tree with every kinds, each with one `parallel`."""
    pairs = list(product(parents, kinds))
    quick = [(*pair, PARALLEL[k % len(PARALLEL)]) for k, pair in enumerate(pairs)]
    every = [(*pair, parallel) for pair in pairs for parallel in PARALLEL]
    return pytest.mark.parametrize(("parents", "kinds", "parallel"), slow_but_for(quick, every, spread=True))


def columns(values: Iterable[object], count: int = COUNT) -> np.ndarray:
    """Values of joints, each a number or one number per state, as (count, joints)."""
    return np.stack([np.broadcast_to(np.asarray(v, float), (count,)) for v in values], axis=1)


def assert_near(found: np.ndarray, expected: np.ndarray, exact: float = EXACT) -> None:
    """Each column to its own largest value; one that is zero throughout, to 1."""
    largest = np.abs(expected).reshape(-1, expected.shape[-1]).max(axis=0)
    error = np.abs(found - expected).reshape(-1, expected.shape[-1]).max(axis=0)
    relative = error / np.where(largest > 0.0, largest, 1.0)
    assert np.all(relative <= exact), relative


class RandomTree:
    """Frames and bodies by psdmc, and Pinocchio's model of the same numbers.

    parallel   how probable it is that an axis is parallel to its parent's, so that compound turns have something to do;
               where it is not zero, other placements have right angles
    """

    def __init__(self, seed: int, parents: tuple[int, ...], kinds: str, parallel: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        self.parents, self.n = parents, len(parents)
        self.kinds, self.parallel = kinds[: self.n], parallel
        self.types = [TYPES[kind] for kind in kinds[: self.n]]
        self.places = [self._place(rng, parallel) for _ in parents]
        self.parameters = np.array([_body(rng) for _ in parents])
        drives = rng.uniform(0.0, 0.3, self.n).tolist()
        self.drives = [
            drive if joint.about_z else 0.0 for drive, joint in zip(drives, self.types, strict=True)
        ]
        self.gravity = rng.normal(size=3) * 5.0
        self.model, self.joints = self._pinocchio()
        self.data = self.model.createData()

    @property
    def choices(self) -> list[Choices]:
        """Arrangements to try on this tree: four, which are others on other trees; `make test-trees`: all sixteen."""
        first = self.n + sum(map(len, self.kinds.split("R"))) + round(10 * self.parallel)
        return CHOICES if WHOLE else CHOICES[first % 4 :: 4]

    @staticmethod
    def _place(rng: np.random.Generator, parallel: float) -> Placement:
        if rng.random() < parallel:
            return Placement(np.eye(3), rng.uniform(-0.5, 0.5, 3))
        return _tidy(rng) if parallel else Placement(_rotation(rng), rng.uniform(-0.5, 0.5, 3))

    @property
    def frames(self) -> list[Frame]:
        return [
            frame_at(joint, parent, place)
            for joint, parent, place in zip(self.types, self.parents, self.places, strict=True)
        ]

    @property
    def bodies(self) -> list[Body]:
        return [body_from_parameters(row.tolist()) for row in self.parameters]

    def mechanism(self) -> Mechanism:
        """The same robot as a Mechanism, parameters about link frames of their own; the tip on the first leaf."""
        rng = np.random.default_rng(self.n)
        links = [Placement(_rotation(rng), rng.uniform(-0.2, 0.2, 3)) for _ in self.parents]
        joints = tuple(
            Joint(f"joint{i}", f"link{i}", joint, place, link)
            for i, (joint, place, link) in enumerate(zip(self.types, self.places, links, strict=True))
        )
        about_links = [moved(row, link.inverse()) for row, link in zip(self.parameters, links, strict=True)]
        return Mechanism(
            "tree", "urdf", "base", "tip", joints, np.column_stack([about_links, self.drives]),
            np.eye(PARAMETERS_PER_LINK * self.n), self.gravity, Placement(_rotation(rng), rng.uniform(-0.2, 0.2, 3)),
            parents=self.parents, tip_body=next(i for i in range(self.n) if i not in self.parents),
        )  # fmt: skip

    @property
    def up(self) -> tuple[float, float, float]:
        x, y, z = (-self.gravity).tolist()
        return x, y, z

    def _pinocchio(self) -> tuple[pin.Model, list[int]]:
        """Pinocchio's crba wants a branch's joints in a row: another order than ours may be."""
        model, joints = pin.Model(), [0] * self.n
        for i in self._depth_first(BASE):
            joint, parent, place = self.types[i], self.parents[i], self.places[i]
            made = getattr(pin, f"JointModel{joint.pinocchio}")
            about = made(PITCH) if joint is HELICAL else made()
            above = 0 if parent == BASE else joints[parent]
            se3 = pin.SE3(place.rotation.copy(), place.translation.copy())
            joints[i] = model.addJoint(above, about, se3, f"joint{i}")
            body = pin.Inertia.FromDynamicParameters(self.parameters[i].copy())
            model.appendBodyToJoint(joints[i], body, pin.SE3.Identity())
        model.gravity.linear = self.gravity.copy()
        armature = np.zeros(model.nv)
        for joint, drive in zip(joints, self.drives, strict=True):
            own = model.joints[joint]
            armature[own.idx_v : own.idx_v + own.nv] = drive
        model.armature = armature
        return model, joints

    def _depth_first(self, body: int) -> list[int]:
        """Bodies beyond this one, each branch in a row."""
        beyond = [i for i, parent in enumerate(self.parents) if parent == body]
        return [k for i in beyond for k in (i, *self._depth_first(i))]

    @property
    def order(self) -> list[int]:
        """Where our joints' rates are in Pinocchio's vectors."""
        own = [self.model.joints[joint] for joint in self.joints]
        return [joint.idx_v + k for joint in own for k in range(joint.nv)]

    @property
    def order_q(self) -> list[int]:
        """Where our joints' coordinates are in Pinocchio's."""
        own = [self.model.joints[joint] for joint in self.joints]
        return [joint.idx_q + k for joint in own for k in range(joint.nq)]

    @property
    def nv(self) -> int:
        return first_rates(self.frames)[-1]

    def theirs(self, values: np.ndarray) -> np.ndarray:
        """Rates of ours in Pinocchio's order; positions too, where each joint has one coordinate."""
        out = np.zeros(self.model.nv)
        out[self.order] = values
        return out

    def theirs_at(self, q: np.ndarray) -> np.ndarray:
        """Positions of ours in Pinocchio's order."""
        out = np.zeros(self.model.nq)
        out[self.order_q] = q
        return out

    def motion(self, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(count, nq) positions, quaternions of length one, and (count, nv) rates and accelerations."""
        rng = np.random.default_rng(seed)
        q = np.concatenate(
            [joint.normalized(rng.uniform(-2.0, 2.0, (joint.nq, count))) for joint in self.types]
        )
        qd, qdd = rng.uniform(-2.0, 2.0, (2, count, self.nv))
        return q.T, qd, qdd

    def states(self, count: int, vectors: int, seed: int = 0) -> np.ndarray:
        return np.random.default_rng(seed).uniform(-2.0, 2.0, (vectors, count, self.n))

    def each(self, function, *states: np.ndarray) -> np.ndarray:
        """A Pinocchio function of positions and rates, its vector (or its matrix's last axis) in our order."""
        rows = zip(*states, strict=True)
        found = [
            np.array(function(self.model, self.data, self.theirs_at(q), *map(self.theirs, row)))
            for q, *row in rows
        ]
        return np.array(found)[..., self.order]
