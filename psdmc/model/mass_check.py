"""Whether the mass matrix is positive definite wherever the joints may stand: without that, no forward dynamics.

A measured or published theta_b need not belong to any distribution of mass. Then some accelerations carry negative
kinetic energy, and a controller that divides by the mass matrix pushes the wrong way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.model import recursive
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.chain import Joint

Array = NDArray[np.float64]

POSES = 2000
"""Poses tried, each joint drawn evenly within its limits."""
SEED = 88_061
ROUNDING = 64 * float(np.finfo(float).eps)
"""Share of a matrix's largest eigenvalue below which its smallest one is rounding, and counts as zero."""


@dataclass(frozen=True, slots=True, eq=False)
class MassCheck:
    """The mass matrix over `poses` poses within the joint limits.

    failing   in how many it is not positive definite
    smallest  eigenvalue of them all, kg m^2 (kg where only sliding joints take part)
    pose      (n,) where that is, rad or m
    joint     name of the joint that its eigenvector moves most
    """

    poses: int
    failing: int
    smallest: float
    pose: Array
    joint: str

    @property
    def passed(self) -> bool:
        return self.failing == 0

    @property
    def reason(self) -> str:
        """What is wrong, or that nothing is, in words."""
        pose = ", ".join(f"{value:.3g}" for value in self.pose)
        found = f"smallest eigenvalue {self.smallest:.3g} at q = [{pose}], mostly joint {self.joint!r}"
        if self.passed:
            return f"the mass matrix is positive definite in {self.poses:,} of {self.poses:,} poses; {found}"
        return (
            f"the mass matrix is not positive definite in {self.failing:,} of {self.poses:,} poses within the joint "
            f"limits; {found}"
        )


def check_mass_matrix(model: DynamicsModel) -> MassCheck | None:
    """M(q) in POSES seeded poses within the joint limits; None while the base parameters are unknown."""
    if model.theta_b is None:
        return None
    low, high = (np.array(bound) for bound in zip(*map(_range, model.chain.joints), strict=True))
    poses = np.random.default_rng(SEED).uniform(low, high, size=(POSES, model.n))
    values, vectors = np.linalg.eigh(recursive.mass_matrix(model.chain, model.standard_parameters(), poses))
    failing = ~(values[:, 0] > ROUNDING * np.abs(values).max(axis=1))
    worst = int(np.argmin(values[:, 0]))
    joint = model.joint_names[int(np.argmax(np.abs(vectors[worst, :, 0])))]
    return MassCheck(POSES, int(failing.sum()), float(values[worst, 0]), poses[worst], joint)


def _range(joint: Joint) -> tuple[float, float]:
    free = joint.type.free_range
    low, high = joint.limits.lower, joint.limits.upper
    return (low if np.isfinite(low) else -free, high if np.isfinite(high) else free)
