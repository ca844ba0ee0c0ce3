"""A link's parameters in pseudo-inertia form: names, units, costs, and conversions from and to standard parameters.
This form has the integrals of xx, yy and zz over the mass in place of moments of inertia."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.parameters import joint_frame_map
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.spatial import Body
from psdmc.reproducible import times
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Array, Placement

PSEUDO_NAMES = ("m", "hx", "hy", "hz", "xx", "yy", "zz", "xy", "xz", "yz", "Im")
"""A link's parameters in pseudo-inertia form, in the order of carriers."""

LENGTH_ORDER = (0, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2)
"""Exponent of the metre in the unit of each parameter. The drive inertia of a sliding joint is kg and is treated apart."""

WEIGHTS = {
    "m": 6.0,
    "hx": 10.0,
    "hy": 10.1,
    "hz": 10.2,
    "xx": 4.0,
    "yy": 4.1,
    "zz": 4.2,
    "xy": 6.0,
    "xz": 6.1,
    "yz": 6.2,
    "Im": 1.0,
}
"""Operations that a parameter adds to Newton-Euler, roughly. Weights of the search's start."""


def pseudo_map() -> Array:
    """Return the (11, 11) matrix that converts a link's standard parameters to pseudo-inertia form, about an unchanged
    frame. In this form, the integrals of xx, yy and zz over the mass replace the moments of inertia."""
    matrix = np.zeros((11, 11))
    matrix[:4, :4] = np.eye(4)
    for row, inertia in enumerate((4, 6, 9), start=4):
        matrix[row, [4, 6, 9]] = 0.5
        matrix[row, inertia] -= 1.0
    for row, off_diagonal in ((7, 5), (8, 7), (9, 8)):
        matrix[row, off_diagonal] = -1.0
    matrix[10, 10] = 1.0
    return matrix


def link_map(place: Placement) -> Array:
    """Return the (11, 11) matrix that converts a link's standard parameters about the link frame to pseudo-inertia form
    about the joint frame. This form has integrals of xx, yy, zz in place of moments of inertia."""
    matrix = np.zeros((11, 11))
    matrix[:BODY_PARAMETERS, :BODY_PARAMETERS] = joint_frame_map(place)
    matrix[10, 10] = 1.0
    return np.asarray(times(pseudo_map(), matrix))


def bodies_from_carriers(
    n: int, carriers: Sequence[int], values: Sequence[Scalar], unit: float
) -> tuple[tuple[Body, ...], tuple[Scalar, ...]]:
    """Return the bodies and drive inertias of n links if the carriers (nonzero link parameters) have these values and
    all other parameters are zero.

    unit  m, the unit of all lengths in the result
    """
    rows: list[list[Scalar]] = [[0.0] * PARAMETERS_PER_LINK for _ in range(n)]
    powers = (2, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0)
    for carrier, value in zip(carriers, values, strict=True):
        link, name = divmod(carrier, PARAMETERS_PER_LINK)
        rows[link][name] = value * unit ** powers[name] if unit != 1.0 else value
    bodies = tuple(
        Body(row[0], (row[1], row[2], row[3]), (row[4], row[5], row[6], row[7], row[8], row[9]))
        for row in rows
    )
    return bodies, tuple(row[10] for row in rows)
