"""The entries of matrices that can differ from zero, found from the robot's tree and joint axes alone.

The algorithms run on scalars that hold no number, but only whether a value can differ from zero. An entry whose result
is the number zero is zero at every state, for all masses and inertias.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.body import Body, body_from_parameters
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.parameters import joint_frame_map
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.scalar import Scalar
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK, Array, Mechanism

Places = tuple[tuple[int, int], ...]
"""(row, column) of entries, row by row."""


class Something:
    """A scalar that may differ from zero."""

    __slots__ = ()
    __array_ufunc__ = None

    def __add__(self, other: Scalar) -> Something:
        return self

    __radd__ = __sub__ = __rsub__ = __add__

    def __mul__(self, other: Scalar) -> Something | float:
        return self if other is SOMETHING or other != 0.0 else 0.0

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Something:
        return self

    def __rtruediv__(self, other: Scalar) -> Something | float:
        return self.__mul__(other)

    def __neg__(self) -> Something:
        return self

    def sincos(self) -> tuple[Something, Something]:
        return self, self

    def root(self) -> Something:
        return self


SOMETHING = Something()


def mass_matrix_places(chain: Mechanism, lift: Array) -> Places:
    """Return the places (row, column) in the mass matrix's lower triangle, with diagonal, whose entries can differ from
    zero.

    lift  (11 n, l)  matrix from base parameters to standard parameters about the link frames
    """
    needed = lift.any(axis=1).reshape(-1, PARAMETERS_PER_LINK)
    bodies = tuple(_body(chain, i, row[:BODY_PARAMETERS]) for i, row in enumerate(needed))
    drives = _unknown(needed[:, DRIVE])
    rows = mass_matrix(frames_of(chain), bodies, drives, [SOMETHING] * chain.nq)
    return tuple((i, j) for i, row in enumerate(rows) for j in range(i + 1) if _differs(row[j]))


def regressor_places(chain: Mechanism, lift: Array) -> Places:
    """Return the places (row, column) in the regressor of the base parameters, (nv, l), whose entries can differ from
    zero.

    lift  (11 n, l)  matrix from base parameters to standard parameters about the link frames
    """
    needed = frozenset(np.flatnonzero(lift.any(axis=1)).tolist())
    placed = [joint.link_frame for joint in chain.joints]
    q, rates = [SOMETHING] * chain.nq, [SOMETHING] * chain.nv
    rows = regressor(frames_of(chain), placed, needed, q, rates, rates, base_acceleration(chain))
    return tuple(_in_base_parameters(rows, lift))


def _in_base_parameters(rows: tuple[dict[int, Scalar], ...], lift: Array) -> Iterator[tuple[int, int]]:
    parts = [frozenset(np.flatnonzero(column).tolist()) for column in lift.T]
    for i, row in enumerate(rows):
        seen = frozenset(k for k, value in row.items() if _differs(value))
        yield from ((i, j) for j, part in enumerate(parts) if part & seen)


def _body(chain: Mechanism, i: int, needed: NDArray[np.bool_]) -> Body:
    """Return the body of a link about its joint frame, if some of its standard parameters are not zero."""
    moved = np.abs(joint_frame_map(chain.joints[i].link_frame)) @ needed
    return body_from_parameters(_unknown(moved))


def _differs(value: Scalar) -> bool:
    return value is SOMETHING or value != 0.0


def _unknown(values: NDArray[Any]) -> list[Scalar]:
    return [SOMETHING if value else 0.0 for value in values.tolist()]
