"""The contact-space inertia: forces per unit acceleration of the active contacts and of closed loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.constraints import Constraints, of_active
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import Factors, factorize, projected
from psdmc.functions import delassus
from psdmc.program.signature import PIVOTS, Q, Quantity, Signature
from psdmc.recipes.contacts import ACTIVE, CONSTRAINT_WORDS, CONTACTS, MU, Held, held_rows
from psdmc.recipes.on_arrays import entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX


def trace(g: Ingredients) -> Outputs:
    q = g.inputs["q"]
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, q, g.choices))
    rows = Constraints(g.frames, g.named, g.loops, g.root).jacobian(q)
    return _values(factors, rows, Held.of(g))


def _values(factors: Factors, jacobian: Sequence[Sequence[Scalar]], mask: Held) -> Outputs:
    matrix = of_active(projected(factors, jacobian), *mask.rows)
    own = factorize(matrix)
    found = mask.compliance(own)
    signs = mask.independent(matrix, own, [row[k] for k, row in enumerate(found)])
    return {"Lambda": found, PIVOTS: [*factors.pivots, *signs]}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, count = list(given["q"].T), len(given["q"])
    mass = np.moveaxis(robot.mass_matrix(given["q"]), 0, -1)
    loops = robot.chain.loops
    rows = Constraints(robot.frames, robot.chain.frames, loops).jacobian(q)
    mask = Held.on_arrays(robot, given, loops)
    with np.errstate(all="ignore"):
        found = _values(factorize([list(row) for row in mass]), rows, mask)
        return {name: entries(value, count) for name, value in found.items()}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    found = delassus.RECIPE.pinocchio(robot, given)["D"]
    masks = held_rows(robot, given)
    for matrix, on, mu in zip(found, masks, np.reshape(given[MU.name], -1), strict=True):
        own = np.ix_(on, on)
        inverse = np.linalg.inv(matrix[own] + mu * np.eye(on.sum()))
        matrix[:] = 0.0
        matrix[own] = inverse
    return {"Lambda": found}


RECIPE = Recipe(
    Signature(
        "contact_space_inertia",
        332,
        "inverse (J M(q)^-1 J^T + mu I)^-1 in the rows and columns of the active contacts, zero in the others; both "
        "triangles; J as in delassus, with closed loops, which are always active; active is 0 or 1 for each "
        "contact, mu is not negative",
        (Q, ACTIVE, MU),
        (
            Quantity(
                "Lambda",
                ("constraint_rows", "constraint_rows"),
                means=f"symmetric matrix {CONSTRAINT_WORDS.format('rows and columns')}",
                unit="J s^2",
                powers=(-1, -1),
            ),
        ),
        theta=True,
        summary="Compute the contact-space inertia (J M^-1 J^T + mu I)^-1 of the active contacts. J is the "
        "Jacobian of these contacts (`contact_jacobian`), M the mass matrix, and I the identity matrix. Rows and "
        "columns of other contacts are zero. Closed loops count as active contacts, and their rows follow.",
        factorises=(MASS_MATRIX, CONTACTS),
    ),
    "contact-space inertia",
    trace,
    reference,
    "crba, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
    matters=("fold_double_angle",),
    closes=True,
)
