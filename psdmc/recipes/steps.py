"""One step of an integrator: its quantities, and its Jacobians from the derivatives of accelerations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import integrated
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Quantity
from psdmc.recipes.on_arrays import columns
from psdmc.robot.mechanism import Array

DT = Quantity("dt", (), 0.01)
"""Length of the step, s."""

Q_NEXT, QD_NEXT = Quantity("q_next", ("nq",)), Quantity("qd_next", ("nv",))
A, B = Quantity("A", ("nx", "nx")), Quantity("B", ("nx", "nv"))
"""Derivatives of (q_next, qd_next) by (q, qd) and by tau."""

Rows = Sequence[Sequence[Scalar]]


def stepped(values: Sequence[Scalar], rates: Sequence[Scalar], dt: Scalar) -> list[Scalar]:
    """values + dt rates"""
    return [value + dt * rate for value, rate in zip(values, rates, strict=True)]


def turned(frames: Sequence[Frame], q: Array, way: Array) -> Array:
    """(k, nq) positions where constant rates lead from q (k, nq); `way` (k, nv) are these times seconds."""
    return columns(integrated(frames, list(q.T), list(way.T)), len(q))


def step_on_arrays(given: Mapping[str, Array]) -> Array:
    """(k, 1) lengths of the steps."""
    return np.reshape(given[DT.name], (-1, 1))


def semi_implicit(by_q: Rows, by_qd: Rows, by_tau: Rows, dt: Scalar) -> tuple[list[Any], list[Any]]:
    """A and B of semi-implicit Euler from the derivatives of accelerations, n x n each.

    d qd_next = d qd + dt d qdd and d q_next = d q + dt d qd_next.
    """
    rates = [
        [dt * x for x in row] + _plus_one(i, [dt * x for x in own])
        for i, (row, own) in enumerate(zip(by_q, by_qd, strict=True))
    ]
    positions = [_plus_one(i, [dt * x for x in row]) for i, row in enumerate(rates)]
    pushed = [[dt * x for x in row] for row in by_tau]
    return positions + rates, [[dt * x for x in row] for row in pushed] + pushed


def _plus_one(i: int, row: list[Scalar]) -> list[Scalar]:
    return [x + 1.0 if j == i else x for j, x in enumerate(row)]


def semi_implicit_on_arrays(by_q: Array, by_qd: Array, by_tau: Array, dt: Array) -> tuple[Array, Array]:
    """(k, 2 n, 2 n) and (k, 2 n, n): `semi_implicit` on arrays, as matrices of the two half steps."""
    n, h = by_q.shape[-1], dt[..., None]
    unit, none = np.broadcast_to(np.eye(n), by_q.shape), np.zeros_like(by_q)
    kick = np.block([[unit, none], [h * by_q, unit + h * by_qd]])
    drift = np.block([[unit, h * unit], [none, unit]])
    push = np.concatenate([none, h * by_tau], axis=-2)
    return drift @ kick, drift @ push
