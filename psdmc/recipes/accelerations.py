"""Records forward dynamics (accelerations from torques) as code, for all generated functions that need it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psdmc.dynamics.arrow import Arrow, eliminated
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.forward_dynamics import forward_dynamics
from psdmc.dynamics.newton_euler import NO_WRENCHES, Wrench
from psdmc.dynamics.scalar import Scalar
from psdmc.program.factorisation import Structure, SymmetricMatrix
from psdmc.recipes.recipe import Ingredients
from psdmc.recipes.torques import less_friction, torques

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


def accelerations(
    g: Ingredients, tau: Sequence[Scalar], external: Mapping[int, Wrench] = NO_WRENCHES
) -> tuple[list[Scalar], Arrow]:
    """Return n accelerations M^-1 (tau - h), and the factors of M. The bias h contains external wrenches on the links.

    M is factorized before h is computed. The divisions of the factorization must wait for each other, and the processor
    computes h meanwhile.
    """
    factors = eliminated(g.frames, mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices))
    bias = torques(g, g.inputs["qd"], g.still, g.base_acceleration, external=external)
    return factors.solved([given - h for given, h in zip(tau, bias, strict=True)]), factors


def accelerations_and_pivots(
    g: Ingredients, tau: Sequence[Scalar], external: Mapping[int, Wrench] = NO_WRENCHES
) -> tuple[Sequence[Scalar], Sequence[Scalar]]:
    """Return the nv joint accelerations M^-1 (tau - h), and the nv pivots (divisors in the factorization) of the mass
    matrix M. Here h is the torque at zero acceleration.

    `choices` selects the algorithm: factorization of M, or articulated bodies.
    """
    if not g.choices.articulated:
        found, factors = accelerations(g, tau, external)
        return found, factors.pivots
    q, qd = g.inputs["q"], g.inputs["qd"]
    moving = less_friction(g, tau)
    return forward_dynamics(
        g.frames, g.bodies, g.drives, q, qd, moving, g.base_acceleration, g.choices, external
    )
