"""Computes contact forces of a robot. A contact is a named frame whose acceleration the world prescribes, such as a
foot.

Sources: Featherstone 2008, chapters 8 and 11; Carpentier, Budhiraja and Mansard 2021.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.kinematics import AT_BASE
from psdmc.dynamics.named_frames import Root, frame_drifts, frame_jacobians
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import (
    Factors,
    factorize,
    half_products,
    half_solved,
    inner_product,
    rest_solved,
    solve,
)
from psdmc.robot.mechanism import NamedFrame

Rows = Sequence[Sequence[Scalar]]


def contact_jacobian(
    frames: Sequence[Frame], named: Sequence[NamedFrame], q: Sequence[Scalar], root: Root = AT_BASE
) -> list[list[Scalar]]:
    """Compute the Jacobian's rows of all contacts, nv entries each, along the base's axes.

    The first three rows of a contact are the linear velocity of its origin. A surface contact has three more rows, its
    angular velocity.
    """
    found = zip(named, frame_jacobians(frames, named, q, root), strict=True)
    return [row for each, rows in found for row in rows[: each.rows]]


def contact_drift(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[Scalar]:
    """Compute the accelerations of all contacts at constant joint rates, dJ/dt qd, row by row."""
    found = zip(named, frame_drifts(frames, named, q, qd, root), strict=True)
    return [value for each, drift in found for value in drift[: each.rows]]


class Constrained(NamedTuple):
    """The accelerations and contact forces that solve M x = load + J^T f for a robot with contacts.

    motion   x, nv entries
    forces   f, one entry per row of the contact Jacobian J
    matrix   matrix A of the linear equations for f, both triangles
    factors  factors of A
    """

    motion: list[Scalar]
    forces: list[Scalar]
    matrix: Rows
    factors: Factors


def constrained(
    factors: Factors,
    jacobian: Rows,
    load: Sequence[Scalar],
    wanted: Sequence[Scalar],
    active: Sequence[Scalar],
    shift: Sequence[Scalar],
    one: Sequence[Scalar],
) -> Constrained:
    """Solve M x = load + J^T f for the motion x and the contact forces f of a robot with mass matrix M.

    J is the Jacobian of the contacts. Active rows satisfy J x + shift f = wanted. In the other rows, f is zero.

    factors  factors of M
    load     (nv) right side without contacts
    wanted   for each row of J, the prescribed value, such as an acceleration
    active   for each row of J, 1 if the contact acts, else 0
    shift    for each row, a compliance, added to the diagonal of the equations for f if the row is active
    one      for each row, the diagonal entry if the row is not active; it has the value 1 in the unit of the diagonal

    The matrix of the equations for f is J M^-1 J^T + shift in active rows, and a unit matrix in the others. Every
    choice of active rows executes the same operations.
    """
    halves = [half_solved(factors, row) for row in jacobian]
    free = half_solved(factors, load)
    scaled = [value * inverse for value, inverse in zip(free, factors.inverses, strict=True)]
    seen = half_products(factors, halves)
    matrix = [
        [
            active[i] * (entry + shift[i]) + (1.0 - active[i]) * one[i]
            if i == j
            else (active[i] if active[i] is active[j] else active[i] * active[j]) * entry
            for j, entry in enumerate(row)
        ]
        for i, row in enumerate(seen)
    ]
    own = factorize(matrix)
    lacking = [
        on * (end - inner_product(half, scaled)) for on, end, half in zip(active, wanted, halves, strict=True)
    ]
    forces = solve(own, lacking)
    pushed = list(free)
    for force, half in zip(forces, halves, strict=True):
        pushed = [value + force * share for value, share in zip(pushed, half, strict=True)]
    return Constrained(rest_solved(factors, pushed), forces, matrix, own)
