"""The entries of matrices that can differ from zero, found from the robot's tree and joint axes alone.

The algorithms run on scalars that hold no number, but only whether a value can differ from zero. An entry whose result
is the number zero is zero at every state, for all masses and inertias.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.derivatives import inverse_dynamics_derivatives
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.parameters import joint_frame_map
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.second_derivatives import SecondDerivatives, inverse_dynamics_second_derivatives
from psdmc.dynamics.solve import factorize, inverse, plus, product
from psdmc.dynamics.spatial import Body, body_from_parameters
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
    bodies, drives = _bodies_and_drives(chain, lift)
    return _lower_triangle(mass_matrix(frames_of(chain), bodies, drives, [SOMETHING] * chain.nq))


def torque_hessian_places(chain: Mechanism, lift: Array) -> Places:
    """Return the places in the lower triangle of the weighted torques' second derivatives by (q, qd, qdd); `lift` as in
    `mass_matrix_places`."""
    bodies, _ = _bodies_and_drives(chain, lift)
    q, rates = [SOMETHING] * chain.nq, [SOMETHING] * chain.nv
    found = inverse_dynamics_second_derivatives(
        frames_of(chain), bodies, q, rates, rates, rates, base_acceleration(chain)
    )
    return _lower_triangle(found.hessian)


def acceleration_hessian_places(chain: Mechanism, lift: Array) -> Places:
    """Return the places in the lower triangle of the weighted accelerations' second derivatives by (q, qd, tau); `lift` as
    in `mass_matrix_places`."""
    bodies, drives = _bodies_and_drives(chain, lift)
    frames, up, nv = frames_of(chain), base_acceleration(chain), chain.nv
    q, rates = [SOMETHING] * chain.nq, [SOMETHING] * nv
    first = inverse_dynamics_derivatives(frames, bodies, drives, q, rates, rates, up)
    second = inverse_dynamics_second_derivatives(frames, bodies, q, rates, rates, rates, up)
    by_tau = product(second.by_q_qdd, inverse(factorize(first.by_qdd)))
    by_q, by_qd = product(by_tau, first.by_q), product(by_tau, first.by_qd)
    found = SecondDerivatives(
        plus(second.by_q_q, plus(by_q, list(zip(*by_q, strict=True)))),
        plus(second.by_q_qd, by_qd),
        second.by_qd_qd,
        by_tau,
    )
    return _lower_triangle(found.hessian)


def regressor_places(chain: Mechanism, lift: Array) -> Places:
    """Return the places (row, column) in the regressor of the base parameters, (nv, l), whose entries can differ from
    zero.

    lift  (11 n, l)  matrix from base parameters to standard parameters about the link frames
    """
    needed = frozenset(np.flatnonzero(lift.any(axis=1)).tolist())
    placed = [joint.link_frame for joint in chain.joints]
    q, rates = [SOMETHING] * chain.nq, [SOMETHING] * chain.nv
    rows = regressor(frames_of(chain), placed, needed, q, rates, rates, base_acceleration(chain))
    parts = [frozenset(np.flatnonzero(column).tolist()) for column in lift.T]
    seen = [frozenset(k for k, value in row.items() if _differs(value)) for row in rows]
    return tuple((i, j) for i, own in enumerate(seen) for j, part in enumerate(parts) if part & own)


def _lower_triangle(rows: Sequence[Sequence[Scalar]]) -> Places:
    return tuple((i, j) for i, row in enumerate(rows) for j in range(i + 1) if _differs(row[j]))


def _bodies_and_drives(chain: Mechanism, lift: Array) -> tuple[tuple[Body, ...], list[Scalar]]:
    """Return what some base parameter has a part in."""
    needed = lift.any(axis=1).reshape(-1, PARAMETERS_PER_LINK)
    bodies = tuple(_body(chain, i, row[:BODY_PARAMETERS]) for i, row in enumerate(needed))
    return bodies, _unknown(needed[:, DRIVE])


def _body(chain: Mechanism, i: int, needed: NDArray[np.bool_]) -> Body:
    """Return the body of a link about its joint frame, if some of its standard parameters are not zero."""
    moved = np.abs(joint_frame_map(chain.joints[i].link_frame)) @ needed
    return body_from_parameters(_unknown(moved))


def _differs(value: Scalar) -> bool:
    return value is SOMETHING or value != 0.0


def _unknown(values: NDArray[Any]) -> list[Scalar]:
    return [SOMETHING if value else 0.0 for value in values.tolist()]
