"""One step of the classical Runge-Kutta method and its Jacobians."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.dynamics.scalar import Scalar
from psdmc.functions import forward_dynamics_derivatives, rk4_step
from psdmc.program.signature import Signature
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.recipes.steps import DT, A, B, step_on_arrays
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

STEP = rk4_step.RECIPE
ACCELERATIONS = forward_dynamics_derivatives.RECIPE

Rows = list[list[Scalar]]
Stage = tuple[Any, Any, Any, Any]
"""At a state: qdd, and its derivatives by q, qd and tau."""


def trace(g: Ingredients) -> Outputs:
    """The arithmetic in one line; in C it is a loop over four calls of forward dynamics' derivatives."""
    (dt,), pivots = g.inputs[DT.name], []

    def at(q: Sequence[Scalar], qd: Sequence[Scalar]) -> Stage:
        found = forward_dynamics_derivatives.multiplied(
            replace(g, inputs={**g.inputs, "q": list(q), "qd": list(qd)})
        )
        pivots.append(found["pivot"])
        return found["qdd"], found["dqdd_dq"], found["dqdd_dqd"], found["dqdd_dtau"]

    n = len(g.still)
    q, qd = g.inputs["q"], g.inputs["qd"]
    state, slopes = _stepped([*q, *qd], _start(n), dt, n, at)
    return {
        "q_next": state[:n],
        "qd_next": state[n:],
        "A": [row[: 2 * n] for row in slopes],
        "B": [row[2 * n :] for row in slopes],
        "pivot": pivots,
    }


def _start(n: int) -> Rows:
    """(2 n, 3 n) derivatives of q and qd by q, qd and tau."""
    return [[1.0 if i == j else 0.0 for j in range(3 * n)] for i in range(2 * n)]


def _stepped(
    start: list[Scalar], unit: Rows, dt: Scalar, n: int, at: Callable[[Any, Any], Stage]
) -> tuple[list[Scalar], Rows]:
    """The state after dt and its derivatives: both are the start and a sixth of the stages' slopes, 1, 2, 2, 1 times."""
    state, by = start, unit
    rates: list[list[Scalar]] = []
    turns: list[Rows] = []
    for part in (0.5 * dt, 0.5 * dt, dt, None):
        qdd, by_q, by_qd, by_tau = at(state[:n], state[n:])
        rates.append([*state[n:], *qdd])
        turns.append([*by[n:], *_chained(by_q, by_qd, by_tau, by, n)])
        if part is not None:
            state = [x + part * rate for x, rate in zip(start, rates[-1], strict=True)]
            by = [_added(row, part, turn) for row, turn in zip(unit, turns[-1], strict=True)]
    sixth = (1.0 / 6.0) * dt
    last = [x + sixth * rate for x, rate in zip(start, _weighted(rates), strict=True)]
    weighted = [_weighted(rows) for rows in zip(*turns, strict=True)]
    return last, [_added(row, sixth, turn) for row, turn in zip(unit, weighted, strict=True)]


def _chained(by_q: Rows, by_qd: Rows, by_tau: Rows, by: Rows, n: int) -> Rows:
    """Derivatives of the accelerations by what the state's derivatives are by."""
    found = []
    for row_q, row_qd, row_tau in zip(by_q, by_qd, by_tau, strict=True):
        row: list[Scalar] = [*[0.0] * (2 * n), *row_tau]
        for factor, own in zip([*row_q, *row_qd], by, strict=True):
            row = _added(row, factor, own)
        found.append(row)
    return found


def _added(row: Sequence[Scalar], factor: Scalar, other: Sequence[Scalar]) -> list[Scalar]:
    return [x + factor * y for x, y in zip(row, other, strict=True)]


def _weighted(slopes: Sequence[Sequence[Scalar]]) -> list[Scalar]:
    return [(a + d) + 2.0 * (b + c) for a, b, c, d in zip(*slopes, strict=True)]


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    def at(q: Array, qd: Array) -> Stage:
        qdd = robot.accelerations(q, qd, given["tau"])
        there = {"q": q, "qd": qd, "qdd": qdd, "tau": given["tau"]}
        found = ACCELERATIONS.reference(robot, there)
        return qdd, found["dqdd_dq"], found["dqdd_dqd"], found["dqdd_dtau"]

    return _on_arrays(given, at)


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    return _on_arrays(given, lambda q, qd: robot.forward_dynamics_derivatives(q, qd, given["tau"]))


def _on_arrays(given: Mapping[str, Array], at: Callable[[Array, Array], Stage]) -> Arrays:
    """The same step on (k, n) arrays: the stages as one matrix each, of the derivatives of (q, qd)' by (q, qd, tau)."""
    dt, n = step_on_arrays(given), given["q"].shape[-1]
    start = np.concatenate([given["q"], given["qd"]], axis=-1)
    unit = np.broadcast_to(np.eye(2 * n, 3 * n), (len(start), 2 * n, 3 * n))
    push = np.broadcast_to(np.eye(3 * n)[2 * n :], (len(start), n, 3 * n))
    rate, turn = np.zeros_like(start), np.zeros_like(unit)
    state_after, unit_after = start.copy(), unit.copy()
    for reach, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
        state, by = start + reach * dt * rate, unit + reach * dt[..., None] * turn
        qdd, by_q, by_qd, by_tau = at(state[:, :n], state[:, n:])
        rate = np.concatenate([state[:, n:], qdd], axis=-1)
        turn = np.concatenate(
            [by[:, n:], np.concatenate([by_q, by_qd], axis=-1) @ by + by_tau @ push], axis=-2
        )
        state_after += weight / 6 * dt * rate
        unit_after += weight / 6 * dt[..., None] * turn
    return {
        "q_next": state_after[:, :n],
        "qd_next": state_after[:, n:],
        "A": unit_after[..., : 2 * n],
        "B": unit_after[..., 2 * n :],
    }


RECIPE = Recipe(
    Signature(
        "rk4_step_derivatives",
        212,
        "the state after dt seconds by the Runge-Kutta method of fourth order, and its derivatives A by (q, qd) and B by "
        "tau; rows: q_next, then qd_next",
        STEP.signature.inputs,
        (*STEP.signature.outputs, A, B),
        theta=True,
        positive=STEP.signature.positive,
        calls=ACCELERATIONS.name,
    ),
    "Jacobians of a step of fourth-order Runge-Kutta",
    trace,
    reference,
    "aba, computeABADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    of_axes=True,
)
