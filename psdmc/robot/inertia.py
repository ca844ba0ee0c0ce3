"""Standard inertial parameters of one link (mass, first moments, inertia) about the link's frame, and the conditions
that they fulfil for a real body."""

from __future__ import annotations

import numpy as np

from psdmc.robot.mechanism import Array

INERTIA_NAMES = ("xx", "xy", "yy", "xz", "yz", "zz")
"""Order of the six inertia components within the standard parameters."""

LENGTH_ORDER = (0, 1, 1, 1, 2, 2, 2, 2, 2, 2)
"""Exponent of the metre in the unit of each of a body's standard parameters: kg, kg m, kg m^2."""

PRODUCT_NOISE = 1e-15
"""Relative to a link's largest first moment or inertia: smaller entries are rounding of changes of frames."""

PHYSICAL_TOLERANCE = 1e-6
"""Relative violation of a triangle inequality that is accepted, as files round inertias."""


def standard_parameters(mass: float, com: Array, inertia_com: Array) -> Array:
    """Return the standard parameters (10,) m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link frame.

    mass  kg, com (3,) m in the frame, inertia_com (6,) kg m^2 about the centre of mass (INERTIA_NAMES).
    An entry is NaN if it depends on a NaN; zero times an unknown number is zero.
    """
    moment = [_times(mass, r) for r in com]
    _, y, z = com
    xx, yy, zz = (_times(h, r) for h, r in zip(moment, com, strict=True))
    xy, xz, yz = _times(moment[0], y), _times(moment[0], z), _times(moment[1], z)
    shift = np.array([yy + zz, -xy, xx + zz, -xz, -yz, xx + yy])
    return np.concatenate([[mass], moment, np.asarray(inertia_com) + shift])


def about_com(parameters: Array) -> tuple[float, Array, Array]:
    """Return mass (not zero), centre (3,) and inertia about it (6,) from standard parameters."""
    mass = float(parameters[0])
    com = parameters[1:4] / mass if mass else np.zeros(3)
    shift = standard_parameters(mass, com, np.zeros(6))[4:]
    return mass, com, parameters[4:10] - shift


def without_noise(parameters: Array) -> Array:
    """Return the ten standard parameters of a link with entries set to zero that are only rounding errors."""
    clean = np.array(parameters, dtype=float)
    for group in (slice(1, 4), slice(4, 10)):
        size = np.max(np.abs(clean[group]))
        clean[group][np.abs(clean[group]) < PRODUCT_NOISE * size] = 0.0
    return clean + 0.0


def inertia_matrix(six: Array) -> Array:
    """Return the inertia matrix (3, 3) from six components Ixx, Ixy and so on (order of INERTIA_NAMES)."""
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def six_of(matrix: Array) -> Array:
    """Return the components Ixx, Ixy ... (INERTIA_NAMES) of a symmetric matrix (3, 3), of its upper triangle."""
    return matrix[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]


def physical_fault(mass: float, inertia_com: Array) -> str | None:
    """Return a text that says why no real body has this mass (kg) and this inertia (6,) about the centre of mass; None
    if a real body can have them. Unknown values are accepted.

    A real body has a positive mass (or all values are zero), and the principal moments fulfil the triangle inequality.
    This is equivalent to a positive semidefinite pseudo-inertia (Wensing, Kim, Slotine 2018).
    """
    if np.isnan(mass) or np.isnan(inertia_com).any():
        return None
    if mass == 0.0:
        return "inertia without mass" if np.any(inertia_com) else None
    moments = np.linalg.eigvalsh(inertia_matrix(inertia_com))
    small, middle, large = moments
    slack = PHYSICAL_TOLERANCE * max(abs(small), abs(large))
    if small < -slack:
        return f"negative principal moment of inertia {small:.3g} kg m^2"
    if small + middle < large - slack:
        # What is this small beside the largest moment is LAPACK's rounding: its digits differ between processors.
        a, b, c = np.where(np.abs(moments) <= slack, 0.0, moments)
        return f"principal moments break the triangle inequality ({a:.3g} + {b:.3g} < {c:.3g} kg m^2)"
    return None


def _times(a: float, b: float) -> float:
    return 0.0 if a == 0.0 or b == 0.0 else float(a * b)
