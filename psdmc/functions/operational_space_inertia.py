"""The operational-space inertia of the named frames (Khatib 1987)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from psdmc import reproducible
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.kinematics import frame_jacobians
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import Factors, factorize, projected
from psdmc.program.operations import Op
from psdmc.program.signature import PIVOTS, Q, Quantity, Signature, Structure, SymmetricMatrix
from psdmc.recipes import contacts
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference
from psdmc.recipes.singular_matrices import inverse_and_sign
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX
from psdmc.robot.mechanism import Array

MU = replace(contacts.MU, default=None)

SEEN_BY_FRAMES = SymmetricMatrix(
    "J M^-1 J^T + mu I",
    Structure.BLOCKS,
    ("frames",),
    number="the number, from 0, of the named frame at which J M^-1 J^T + mu I is not positive definite",
    failure="mu is negative\nJ M^-1 J^T + mu I of a frame is not positive definite, for example because mu = 0 and the "
    "frame cannot move in all six directions",
    error="frame {frames!r}: J M^-1 J^T + mu I is not positive definite at mu = {mu:g}",
    hint="give mu > 0, such as 1e-3, or a pose in which the frame can move in all six directions",
)

Rows = Sequence[Sequence[Scalar]]


def trace(g: Ingredients) -> Outputs:
    (mu,), q = g.inputs[MU.name], g.inputs["q"]
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, q, g.choices))
    shift = [mu] * 3 + [mu * g.si(1.0, "1/m^2")] * 3
    found, signs = zip(
        *(
            _inverse_and_sign(_regularised(factors, rows, shift), mu)
            for rows in frame_jacobians(g.frames, g.named, q, g.root)
        ),
        strict=True,
    )
    return {"Lambda": list(found), PIVOTS: [*factors.pivots, *signs]}


def _regularised(factors: Factors, jacobian: Rows, shift: Sequence[Scalar]) -> Rows:
    """J M^-1 J^T + mu I, whose diagonal is shifted by these."""
    rows = projected(factors, jacobian)
    return [
        [entry + shift[i] if i == j else entry for j, entry in enumerate(row)] for i, row in enumerate(rows)
    ]


def _inverse_and_sign(rows: Rows, mu: Scalar) -> tuple[Rows, Scalar]:
    """As `inverse_and_sign`; -1 also if mu is negative."""
    found, sign = inverse_and_sign(rows)
    return found, Op.SELECT(mu, 0.0, -1.0, sign)


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    """Compute the operational-space inertia matrices Lambda of the frames, for tests. Also return the pivots and signs
    that must be positive, or Lambda does not exist."""
    q, mu = list(given["q"].T), np.reshape(given[MU.name], -1)
    mass = np.moveaxis(robot.mass_matrix(given["q"]), 0, -1)
    factors = factorize([list(row) for row in mass])
    jacobians = frame_jacobians(robot.frames, robot.chain.frames, q)
    matrices = [_regularised(factors, rows, [mu] * 6) for rows in jacobians]
    with np.errstate(all="ignore"):
        signs = [_inverse_and_sign(rows, mu)[1] for rows in matrices]
        found = reproducible.inverse(entries(matrices, len(mu)))
    return {
        "Lambda": (found + np.swapaxes(found, -1, -2)) / 2,
        PIVOTS: entries([*factors.pivots, *signs], len(mu)),
    }


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def inertias(model: Any, data: Any, q: Array, mu: Array) -> Array:
        mass = np.triu(pin.crba(model, data, q))
        mass += np.triu(mass, 1).T
        aligned = pin.LOCAL_WORLD_ALIGNED
        rows = [pin.computeFrameJacobian(model, data, q, frame, aligned) for frame in robot.frame_ids]
        jacobians = np.reshape(rows, (-1, 6, model.nv))
        seen = jacobians @ np.linalg.solve(mass, np.swapaxes(jacobians, -1, -2))
        return np.asarray(np.linalg.inv(seen + mu * np.eye(6)), np.float64)

    return {"Lambda": robot.each(inertias, given["q"], np.reshape(given[MU.name], (-1, 1)))}


RECIPE = Recipe(
    Signature(
        "operational_space_inertia",
        230,
        "inverse (J M(q)^-1 J^T + mu I)^-1 for every named frame, both triangles; J as in frame_jacobian: linear, then "
        "angular velocity per unit joint rate, base frame; mu is not negative",
        (Q, MU),
        (
            Quantity(
                "Lambda",
                ("frames", "6", "6"),
                means="symmetric matrix of each frame, along the axes of the base frame: three linear rows and "
                "columns (kg), then three angular ones (kg m^2). An entry with a linear row and an angular column "
                "is in kg m",
                unit="kg m^2",
                powers=(0, -1, -1),
            ),
        ),
        theta=True,
        summary="Compute the operational-space inertia (J M^-1 J^T + mu I)^-1 of each named frame. J is the "
        "Jacobian of the frame (`frame_jacobian`), M the mass matrix, and I the identity matrix.",
        factorises=(MASS_MATRIX, SEEN_BY_FRAMES),
    ),
    "operational-space inertia",
    trace,
    reference,
    "crba, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
    matters=("fold_double_angle",),
)
