"""Contacts, that is, named frames whose accelerations the world prescribes, and the contact forces that result
(Featherstone 2008, chapters 8 and 11; Carpentier, Budhiraja and Mansard 2021)."""

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
    """The solution of M x = load + J^T f for a robot with contacts.

    motion   x (nv)
    forces   f, one per row of J
    matrix   A, the matrix of the equations for f, both triangles
    factors  of A
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
    """Solve M x = load + J^T f for x and f, with J x + shift f = wanted in active rows, and f = 0 in the others.

    factors  of M
    active   for each row, 0 or 1
    shift    for each row, added to the diagonal if the row is active
    one      for each row, the diagonal entry in its unit if the row is not active

    The matrix A is J M^-1 J^T + shift in active rows and the unit matrix in the others. Every choice of active rows
    executes the same operations.
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
