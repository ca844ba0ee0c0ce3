"""Conversion of standard parameters (mass, first moment and inertia of links) from the link frames of the robot file to
the joint frames. The algorithms use joint frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.spatial import Body, body_from_parameters
from psdmc.reproducible import times
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Array, Mechanism, Placement

_INERTIA_ENTRIES = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Places of Ixx, Ixy, Iyy, Ixz, Iyz, Izz in the matrix, in the order of x."""


def second_moments(inertia: Array) -> Array:
    """Compute the integral of r r^T over the mass of a body, (3, 3, ...), from the inertia matrix I about the same
    origin: tr(I) / 2 - I."""
    moments: Array = _on_diagonal(0.5 * np.trace(inertia)) - inertia
    return moments


def inertia_of(second: Array) -> Array:
    """Compute the inertia matrix, (3, 3, ...), from the integral S of r r^T over the mass of a body: tr(S) - S."""
    matrix: Array = _on_diagonal(np.trace(second)) - second
    return matrix


def _on_diagonal(value: Array) -> Array:
    """(3, 3, ...)"""
    return np.multiply.outer(np.eye(3), value)


def inertia_matrix(x: Array) -> Array:
    """Return the inertia matrix, (3, 3, ...), kg m^2, from the standard parameters of one link, (10 or 11, ...)."""
    matrix = np.zeros((3, 3, *np.shape(x)[1:]), np.asarray(x).dtype)
    for (row, column), value in zip(_INERTIA_ENTRIES, x[4:BODY_PARAMETERS], strict=True):
        matrix[row, column] = matrix[column, row] = value
    return matrix


def standard_parameters(mass: float, moment: Array, inertia: Array) -> Array:
    """Return the (10,) standard parameters of a body: mass, first moment, and inertia matrix as six numbers.

    moment, inertia  about the origin of one frame, along the frame's axes
    """
    return np.array([mass, *moment, *(inertia[entry] for entry in _INERTIA_ENTRIES)])


def moved(x: Array, frame: Placement) -> Array:
    """Convert ten standard parameters of a body from one frame to another. `frame` is the placement of the old frame in
    the new one."""
    return _moved(x, frame.rotation, frame.translation)


def _moved(x: Array, r: Array, p: Array) -> Array:
    """(10, ...)"""
    moment = times(r, x[1:4])
    crossed = _transposed(np.multiply.outer(p, moment))
    turned = _turned(r, _transposed(_turned(r, second_moments(inertia_matrix(x)))))
    second = _transposed(turned) + crossed + _transposed(crossed) + np.multiply.outer(np.outer(p, p), x[0])
    return standard_parameters(x[0], moment + np.multiply.outer(p, x[0]), inertia_of(second))


def _transposed(matrix: Array) -> Array:
    """(3, 3, ...)"""
    return np.swapaxes(matrix, 0, 1)


def _turned(r: Array, matrix: Array) -> Array:
    """r @ matrix for a matrix (3, 3, ...)."""
    product: Array = times(r, matrix.reshape(3, -1)).reshape(matrix.shape)
    return product


def joint_frame_map(link_frame: Placement) -> Array:
    """Return the (10, 10) matrix that converts a link's ten standard parameters from the link frame to the joint
    frame."""
    return moving_map(link_frame.rotation, link_frame.translation)


def moving_map(rotation: NDArray[Any], translation: NDArray[Any]) -> NDArray[Any]:
    """Return the (10, 10) matrix that converts ten standard parameters from one frame to another.

    rotation, translation  placement of the old frame in the new one; the matrix has the floating-point precision of
                           these arrays
    """
    return _moved(np.eye(BODY_PARAMETERS, dtype=rotation.dtype), rotation, translation)


def bodies_of(chain: Mechanism, x: Array) -> tuple[Body, ...]:
    """Return the mass parameters of all n links about the joint frames, from standard parameters about the link frames.

    x  (n, 11) or (11 n,)  standard parameters in SI units, none of them NaN
    """
    return bodies_about([joint.link_frame for joint in chain.joints], x)


def bodies_about(link_frames: Sequence[Placement], x: Array) -> tuple[Body, ...]:
    """Return the mass parameters of all n links about other frames, from standard parameters about the link frames.

    link_frames  n placements of the link frames in these other frames
    x            (n, 11) or (11 n,)  standard parameters, SI units
    """
    rows = np.asarray(x, dtype=np.float64).reshape(len(link_frames), PARAMETERS_PER_LINK)
    return tuple(
        body_from_parameters(times(joint_frame_map(place), row[:BODY_PARAMETERS]).tolist())
        for place, row in zip(link_frames, rows, strict=True)
    )


def drive_inertia_of(x: Array) -> list[float]:
    """Return the n drive inertias (kg m^2; kg for sliding joints) from standard parameters, (n, 11) or (11 n,)."""
    drives: list[float] = np.asarray(x).reshape(-1, PARAMETERS_PER_LINK)[:, BODY_PARAMETERS].tolist()
    return drives
