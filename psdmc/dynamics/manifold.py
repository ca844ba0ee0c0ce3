"""Computes the position after motion at constant joint rates, its derivatives, and the constant rates between two positions.

The values can be numbers or symbols. If a joint has several coordinates, such as a quaternion, its nq coordinates q
must satisfy a condition: the length of a quaternion is one. Its rates, fewer in number (nv), are along the axes of the
frame that the joint moves.

The derivatives along tangents say how the end of a step at constant rates depends on the start and on the rates. A joint
moves from the placement T to T exp(x). The twist x is the joint's constant rates times the duration. A small
displacement e along the joint's axes displaces the end, along the axes at the end, by

    Ad(exp(-x)) e = (1 - ad(x) J) e   if the start is displaced by e,
    J e                               if x is changed by e,   J = 1 - ad(x) / 2! + ad(x)^2 / 3! - ...

Ad(T) is the 6 x 6 matrix that transforms twists by a placement T, and ad(x) y is the Lie bracket of two twists. One
formula serves all joint types, because the motions of each joint type are a subgroup of the motions of a free body. It
is written for a linear part v and an angular part w of x. Source: Barfoot, State Estimation for Robotics, 2nd edition,
section 8.1 (left Jacobian; here the right one, of -x)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from psdmc.dynamics.coordinates import leading
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.joint_steps import unit_twists
from psdmc.dynamics.scalar import Matrix, Scalar, Vector, dot, multiply
from psdmc.dynamics.solve import inner_product
from psdmc.dynamics.spatial import combined
from psdmc.robot.joints import JointType


def integrated(frames: Sequence[Frame], q: Sequence[Scalar], step: Sequence[Scalar]) -> list[Scalar]:
    """Return the nq coordinates after one second of motion from q at constant rates `step`, nv of them."""
    return [x for joint, here, own in _joints(frames, q, step) for x in joint.integrated(here, own)]


def difference(frames: Sequence[Frame], q: Sequence[Scalar], other: Sequence[Scalar]) -> list[Scalar]:
    """Return the nv constant rates that lead from q to `other` in one second, along the shortest rotation."""
    return [x for joint, here, there in _coordinates(frames, q, other) for x in joint.difference(here, there)]


def coordinate_rates(frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Scalar]:
    """Return the changes per second of the nq coordinates q, such as quaternions, at nv joint rates `rates`."""
    return [x for joint, here, own in _joints(frames, q, rates) for x in joint.coordinate_rates(here, own)]


def rates_bent(
    frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar], motion: Sequence[Scalar]
) -> list[Scalar]:
    """Return the changes per second (nq) of the result of `coordinate_rates` at constant joint rates, while q moves.

    rates  (nv) the constant joint rates
    motion (nv) joint rates at which q moves
    """
    both = zip(_joints(frames, q, rates), _joints(frames, q, motion), strict=True)
    return [x for (joint, here, own), (_, _, moved) in both for x in joint.rates_bent(here, own, moved)]


def tangent(frames: Sequence[Frame], q: Sequence[Scalar], moved: Sequence[Scalar]) -> list[Scalar]:
    """Return the nv joint rates that correspond to given changes per second of the nq coordinates q.

    Quaternions in q may have any length. Their coordinates are scaled to length one before the rates are computed.

    moved  (nq) changes per second of the coordinates
    """
    return [x for joint, here, own in _coordinates(frames, q, moved) for x in joint.tangent(here, own)]


def restored(frames: Sequence[Frame], q: Sequence[Scalar]) -> list[Scalar]:
    """Return the nearest positions that the joints can have; for example, quaternions get length one."""
    return [x for joint, here, _ in _joints(frames, q, ()) for x in joint.restored(here)]


def pulled_back(frames: Sequence[Frame], q: Sequence[Scalar], gradient: Sequence[Scalar]) -> list[Scalar]:
    """Return the nv derivatives of a quantity by motion at the joint rates, from its nq derivatives by the coordinates
    q."""
    found: list[Scalar] = []
    for joint, here, own in _coordinates(frames, q, gradient):
        for k in range(joint.nv):
            moved = joint.coordinate_rates(here, [1.0 if i == k else 0.0 for i in range(joint.nv)])
            found.append(inner_product(moved, own))
    return found


def _coordinates(
    frames: Sequence[Frame], q: Sequence[Scalar], other: Sequence[Scalar]
) -> Iterator[tuple[JointType, Sequence[Scalar], Sequence[Scalar]]]:
    """Joint by joint what two vectors of nq have of it."""
    used = 0
    for frame in leading(frames):
        part = slice(used, used + frame.joint.nq)
        yield frame.joint, q[part], other[part]
        used = part.stop


def _joints(
    frames: Sequence[Frame], q: Sequence[Scalar], rates: Sequence[Scalar]
) -> Iterator[tuple[JointType, Sequence[Scalar], Sequence[Scalar]]]:
    """Each joint that has coordinates of its own, with these and its rates."""
    at, rate = 0, 0
    for frame in leading(frames):
        joint = frame.joint
        yield joint, q[at : at + joint.nq], rates[rate : rate + joint.nv]
        at, rate = at + joint.nq, rate + joint.nv


Rows = Sequence[Sequence[Scalar]]

HALVINGS = 3
"""Of the angle, before its series are summed."""
TERMS = 12
"""Of the series: of a turn by 25 rad, an eighth of which is pi, what is left out is less than 1e-16 of the sum."""


class StepSlopes(NamedTuple):
    """Derivatives of a joint's position at the end of a step, as two nv x nv matrices. Rows and columns belong to small
    displacements along the joint's nv rates.

    by_start  by the position at the start of the step
    by_step   by the joint's rates times the duration of the step
    """

    by_start: Rows
    by_step: Rows


def step_slopes(
    frames: Sequence[Frame], rates: Sequence[Scalar], seconds: Scalar = 1.0
) -> list[StepSlopes | None]:
    """Return, for each joint, the derivatives of the position after a step at the given nv constant rates for
    `seconds`.

    The entry is None for a joint of one rate, whose derivatives are both one.
    """
    found: list[StepSlopes | None] = []
    used = 0
    for frame in leading(frames):
        nv = frame.joint.nv
        own = rates[used : used + nv]
        found.append(_slopes(frame.joint, [seconds * rate for rate in own]) if nv > 1 else None)
        used += nv
    return found


def _slopes(joint: JointType, step: Sequence[Scalar]) -> StepSlopes:
    v, w = combined(joint, step)
    turns, across, squared, product = _cross_matrix(w), _cross_matrix(v), dot(w, w), dot(v, w)
    b, c, d, e = _coefficients(squared)
    twice = _plus(_outer(w, w), _diagonal(-squared))
    both = _plus(_plus(_outer(v, w), _outer(w, v)), _diagonal(-2.0 * product))
    own = _plus(_diagonal(1.0), _plus(_times(turns, -b), _times(twice, c)))
    mixed = _plus(
        _plus(_times(across, -b), _times(turns, (c - 2.0 * d) * product)),
        _plus(_times(both, c), _times(twice, -2.0 * e * product)),
    )
    turned = _plus(_diagonal(1.0), _times(multiply(turns, own), -1.0))
    shifted = _times(_plus(multiply(turns, mixed), multiply(across, own)), -1.0)
    return StepSlopes(_of_rates(joint, turned, shifted), _of_rates(joint, own, mixed))


def _of_rates(joint: JointType, own: Matrix, mixed: Matrix) -> Rows:
    """The rows and columns of a joint's rates in ((own, mixed), (0, own)), of linear then angular ones."""
    places = unit_twists(joint)

    def entry(row: tuple[int, bool], column: tuple[int, bool]) -> Scalar:
        if row[1] == column[1]:
            return own[row[0]][column[0]]
        return mixed[row[0]][column[0]] if column[1] else 0.0

    return [[entry(row, column) for column in places] for row in places]


def _coefficients(squared: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Compute the coefficients of an angle t from its square:

        b = (1 - cos t) / t^2,  c = (t - sin t) / t^3,  d = (1/2 - b) / t^2,  e = (3 c - b) / (2 t^2).

    The quotients cancel near zero, the series far from it. So d and e are summed at an eighth of the angle, and all are
    doubled three times, by formulas whose terms neither cancel nor divide.
    """
    y = squared * 0.25**HALVINGS
    d = _series(y, [1.0 / math.factorial(2 * k + 4) for k in range(TERMS)])
    e = _series(y, [(k + 1.0) / math.factorial(2 * k + 5) for k in range(TERMS)])
    b = 0.5 - y * d
    c = (b + 2.0 * y * e) * (1.0 / 3.0)
    for _ in range(HALVINGS):
        a = 1.0 - y * c  # sin t / t
        e = 0.0625 * e + 0.03125 * (4.0 * (c - d) - 3.0 * b * c - 2.0 * y * c * c)
        d = 0.125 * c * (1.0 + a)
        c = 0.25 * (c + a * b)
        b = 0.5 * a * a
        y = 4.0 * y
    return b, c, d, e


def _series(y: Scalar, terms: Sequence[float]) -> Scalar:
    """The sum of terms times powers of -y."""
    total: Scalar = terms[-1]
    for term in reversed(terms[:-1]):
        total = term - total * y
    return total


def _cross_matrix(v: Vector) -> Matrix:
    x, y, z = v
    return ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))


def _outer(a: Vector, b: Vector) -> Matrix:
    return tuple((x * b[0], x * b[1], x * b[2]) for x in a)  # type: ignore[return-value]


def _diagonal(x: Scalar) -> Matrix:
    return ((x, 0.0, 0.0), (0.0, x, 0.0), (0.0, 0.0, x))


def _times(rows: Matrix, factor: Scalar) -> Matrix:
    return tuple((x * factor, y * factor, z * factor) for x, y, z in rows)  # type: ignore[return-value]


def _plus(a: Matrix, b: Matrix) -> Matrix:
    rows = zip(a, b, strict=True)
    return tuple(tuple(x + y for x, y in zip(*pair, strict=True)) for pair in rows)  # type: ignore[return-value]
