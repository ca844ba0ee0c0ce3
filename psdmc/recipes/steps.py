"""One time step of an integrator: the descriptions of inputs and outputs, and the Jacobians of the new state by the old
state. Matrices convert changes of joint coordinates (such as quaternions) to joint rates (such as angular velocities) and
back, for k states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from psdmc.dynamics.coordinates import first_rates
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import StepSlopes, integrated, step_slopes
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.program.signature import Quantity
from psdmc.recipes.on_arrays import columns, matrix
from psdmc.reproducible import times
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import Array

DT = Quantity("dt", (), 0.01, "length of the step, s: one number for all states, or one per state", unit="s")

Q_NEXT = Quantity(
    "q_next",
    ("nq",),
    means="new joint positions, rad or m, with quaternions of unit length",
    unit="1",
    powers=(1,),
)
QD_NEXT = Quantity("qd_next", ("nv",), means="new joint rates, rad/s or m/s", unit="1/s", powers=(1,))
A = Quantity(
    "A",
    ("nx", "nx"),
    means="derivatives of the new state (q_next, qd_next) by the old state (q, qd). The first nv rows are for a "
    "displacement of the joints from q_next, the first nv columns for one from q",
    unit="1",
    powers=(1, -1),
    by_q=True,
)
B = Quantity(
    "B",
    ("nx", "nv"),
    means="derivatives of the new state (q_next, qd_next) by tau, with the rows of A",
    unit="1/J",
    powers=(1, 1),
)

Rows = Sequence[Sequence[Scalar]]


def stepped(values: Sequence[Scalar], rates: Sequence[Scalar], dt: Scalar) -> list[Scalar]:
    """values + dt rates"""
    return [value + dt * rate for value, rate in zip(values, rates, strict=True)]


def turned(frames: Sequence[Frame], q: Array, step: Array) -> Array:
    """Return the joint positions (k, nq) after a motion from q (k, nq) at constant joint rates. `step` (k, nv) are the
    rates multiplied by the duration."""
    return columns(integrated(frames, list(q.T), list(step.T)), len(q))


def step_on_arrays(given: Mapping[str, Array]) -> Array:
    """(k, 1) lengths of the steps."""
    return np.reshape(given[DT.name], (-1, 1))


def semi_implicit(
    by_q: Rows, by_qd: Rows, by_tau: Rows, dt: Scalar, slopes: Sequence[StepSlopes | None]
) -> tuple[list[Any], list[Any]]:
    """Return the Jacobians A and B of a semi-implicit Euler step. A has the derivatives of the new state by the old
    state, B those by the torques.

    by_q, by_qd, by_tau   derivatives (nv, nv) of the accelerations
    slopes                for each joint of several rates, such as a ball joint, the derivatives of the new position by
                          the old position and by the displacement (rates times dt); None for a joint of one rate

    Changes of the state are small motions along the joint rates. They are d qd_next = d qd + dt d qdd and, for joints
    of one rate, d q_next = d q + dt d qd_next.
    """
    rates = [
        [dt * x for x in row] + _plus_one(i, [dt * x for x in own])
        for i, (row, own) in enumerate(zip(by_q, by_qd, strict=True))
    ]
    positions = _turned(_moved(rates, dt, slopes), slopes)
    pushed = [[dt * x for x in row] for row in by_tau]
    return positions + rates, _moved(pushed, dt, slopes) + pushed


def _moved(rows: Rows, dt: Scalar, slopes: Sequence[StepSlopes | None]) -> list[list[Scalar]]:
    """Return the motion of the step's end by rates' rows, times dt."""
    found: list[list[Scalar]] = []
    for own in slopes:
        block = [
            [dt * x for x in row] for row in rows[len(found) :][: 1 if own is None else len(own.by_step)]
        ]
        found += (
            block
            if own is None
            else [[inner_product(w, x) for x in zip(*block, strict=True)] for w in own.by_step]
        )
    return found


def _turned(rows: list[list[Scalar]], slopes: Sequence[StepSlopes | None]) -> list[list[Scalar]]:
    """The rows, and what the start of the step moves its end by."""
    found: list[list[Scalar]] = []
    for own in slopes:
        first = len(found)
        for row in ((1.0,),) if own is None else own.by_start:
            moved = list(rows[len(found)])
            moved[first : first + len(row)] = [x + y for x, y in zip(moved[first:], row, strict=False)]
            found.append(moved)
    return found


def _plus_one(i: int, row: list[Scalar]) -> list[Scalar]:
    return [x + 1.0 if j == i else x for j, x in enumerate(row)]


def semi_implicit_on_arrays(
    by_q: Array, by_qd: Array, by_tau: Array, dt: Array, slopes: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return the Jacobians A (k, 2 nv, 2 nv) and B (k, 2 nv, nv) of a semi-implicit Euler step for k states, in NumPy.
    A semi-implicit Euler step changes the joint rates first, then the positions. A and B are products of the Jacobians
    of these two changes.

    by_q, by_qd, by_tau  derivatives (k, nv, nv) of the joint accelerations by positions, rates and torques
    dt                   (k, 1) lengths of the steps, s
    slopes               two arrays (k, nv, nv): derivatives of the new positions by the old positions, and by the
                         displacements (new joint rates times dt)
    """
    by_start, by_step = slopes
    n, h = by_q.shape[-1], dt[..., None]
    unit, none = np.broadcast_to(np.eye(n), by_q.shape), np.zeros_like(by_q)
    kick = np.block([[unit, none], [h * by_q, unit + h * by_qd]])
    drift = np.block([[by_start, h * by_step], [none, unit]])
    push = np.concatenate([np.zeros_like(by_tau), h * by_tau], axis=-2)
    return times(drift, kick), times(drift, push)


def slopes_on_arrays(frames: Sequence[Frame], step: Array) -> tuple[Array, Array]:
    """Return the derivatives of joint positions after a motion at constant joint rates, for k states.

    The result is two arrays (k, nv, nv). The first has the derivatives by the positions before the motion. The second
    has the derivatives by the displacements `step` (k, nv), which are the joint rates times the duration.
    """
    count, nv = step.shape
    by_start, by_step = (np.broadcast_to(np.eye(nv), (count, nv, nv)).copy() for _ in range(2))
    first = first_rates(frames)
    for i, own in enumerate(step_slopes(frames, list(step.T))):
        part = slice(first[i], first[i + 1])
        if own is not None:
            by_start[:, part, part], by_step[:, part, part] = (matrix(rows, count) for rows in own)
    return by_start, by_step


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateMaps:
    """Conversions between changes of coordinates and joint rates, for a sequence of joints. For k states, q is (k, nq)
    and qd is (k, nv); nq and nv are the numbers of coordinates and of rates."""

    joints: Sequence[JointType]

    def rates(self, q: Array) -> Array:
        """Return the matrices (k, nq, nv) that multiply joint rates qd to give the time derivatives of the coordinates
        q. A matrix depends on q."""
        parts = self._parts(q, None)
        return _diagonal(
            [_columns(partial(kind.coordinate_rates, own), kind.nv, len(q)) for kind, own, _ in parts]
        )

    def bent(self, q: Array, qd: Array) -> Array:
        """Return the derivatives (k, nq, nv) of the time derivative of q by small motions of the joints. The joint
        rates qd are fixed.

        The nv motions are along the directions of the joint rates; a quaternion moves by small rotations.
        """
        parts = self._parts(q, qd)
        return _diagonal(
            [_columns(partial(kind.rates_bent, own, rates), kind.nv, len(q)) for kind, own, rates in parts]
        )

    def tangents(self, q: Array) -> Array:
        """Return the matrices (k, nv, nq) that multiply changes of q to give the joint motions. Quaternions in q may
        have any length; the motion is that of the quaternion normalized to length one."""
        parts = self._parts(q, None)
        return _diagonal([_columns(partial(kind.tangent, own), kind.nq, len(q)) for kind, own, _ in parts])

    def restored(self, q: Array) -> Array:
        """Return q (k, nq) with the nearest valid coordinates. For example, quaternions get length one."""
        return columns([x for joint, own, _ in self._parts(q, None) for x in joint.restored(own)], len(q))

    def _parts(self, q: Array, qd: Array | None) -> Iterator[tuple[JointType, list[Array], list[Array]]]:
        at, rate = 0, 0
        for joint in self.joints:
            rates = [] if qd is None else list(qd.T[rate : rate + joint.nv])
            yield joint, list(q.T[at : at + joint.nq]), rates
            at, rate = at + joint.nq, rate + joint.nv


def _columns(function: Callable[[list[float]], Sequence[Array]], width: int, count: int) -> Array:
    """(k, rows, width): the values of the unit vectors."""
    values = [function([float(i == j) for i in range(width)]) for j in range(width)]
    return matrix(values, count).transpose(0, 2, 1)


def _diagonal(blocks: Sequence[Array]) -> Array:
    rows, width = (sum(block.shape[axis] for block in blocks) for axis in (1, 2))
    whole, row, column = np.zeros((len(blocks[0]), rows, width)), 0, 0
    for block in blocks:
        whole[:, row : row + block.shape[1], column : column + block.shape[2]] = block
        row, column = row + block.shape[1], column + block.shape[2]
    return whole
