"""Forward dynamics, recorded on symbols for all functions that need it."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.arrow import Arrow, eliminated
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.forward_dynamics import forward_dynamics
from psdmc.dynamics.scalar import Scalar
from psdmc.program.factorisation import Structure, SymmetricMatrix
from psdmc.recipes.recipe import Ingredients
from psdmc.recipes.torques import torques

MASS_MATRIX = SymmetricMatrix(
    "the mass matrix",
    Structure.LIMBS,
    ("nv",),
    number="the number of the joint, from 0, at which the mass matrix is not positive definite",
    failure="the mass matrix is not positive definite in a state",
    unit="J s^2",
    powers=(-2,),
)
"""M(q), which functions solve or invert."""


def accelerations(g: Ingredients, tau: Sequence[Scalar]) -> tuple[list[Scalar], Arrow]:
    """Return n accelerations M^-1 (tau - h), and the factors of M.

    The mass matrix is factorized before the bias h is computed. Its divisions depend on each other, and the processor
    can compute the recursion for h meanwhile.
    """
    factors = eliminated(g.frames, mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices))
    bias = torques(g, g.inputs["qd"], g.still, g.base_acceleration)
    return factors.solved([given - h for given, h in zip(tau, bias, strict=True)]), factors


def accelerations_and_pivots(
    g: Ingredients, tau: Sequence[Scalar]
) -> tuple[Sequence[Scalar], Sequence[Scalar]]:
    """Return nv accelerations M^-1 (tau - h) and the nv pivots of M, by a factorized mass matrix or by articulated
    bodies, as `choices` says."""
    if not g.choices.articulated:
        found, factors = accelerations(g, tau)
        return found, factors.pivots
    q, qd = g.inputs["q"], g.inputs["qd"]
    return forward_dynamics(g.frames, g.bodies, g.drives, q, qd, tau, g.base_acceleration, g.choices)
