"""One step of the classical Runge-Kutta method and its Jacobians."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import coordinate_rates, rates_bent, restored, tangent
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.slices import leading
from psdmc.functions import forward_dynamics_derivatives, rk4_step
from psdmc.program.signature import Signature
from psdmc.recipes.coordinate_maps import CoordinateMaps
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.recipes.steps import DT, A, B, step_on_arrays
from psdmc.reproducible import times
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
    q_next, qd_next, slopes = _stepped(g.frames, g.inputs["q"], g.inputs["qd"], dt, at)
    return {
        "q_next": q_next,
        "qd_next": qd_next,
        "A": [row[: 2 * n] for row in slopes],
        "B": [row[2 * n :] for row in slopes],
        "pivot": pivots,
    }


def _start(n: int) -> Rows:
    """(2 n, 3 n) derivatives of q and qd by q, qd and tau."""
    return [[1.0 if i == j else 0.0 for j in range(3 * n)] for i in range(2 * n)]


def _stepped(
    frames: Sequence[Frame],
    q: list[Scalar],
    qd: list[Scalar],
    dt: Scalar,
    at: Callable[[Any, Any], Stage],
) -> tuple[list[Scalar], list[Scalar], Rows]:
    """The state after dt and its derivatives: both are the start and a sixth of the stages' slopes, 1, 2, 2, 1 times.

    Slopes are those of q's coordinates and of their derivatives; these are along the tangent of q between stages.
    """
    nq, n, start = len(q), len(qd), [*q, *qd]
    by = _start(n)
    unit = [*_by_column(lambda way: coordinate_rates(frames, q, way), by[:n]), *by[n:]]
    rates: list[list[Scalar]] = []
    turns: list[Rows] = []

    def moved(part: Scalar, rate: Sequence[Scalar], turn: Rows) -> tuple[list[Scalar], list[Scalar], Rows]:
        state = [x + part * own for x, own in zip(start, rate, strict=True)]
        rows = [_added(row, part, own) for row, own in zip(unit, turn, strict=True)]
        along = _by_column(lambda way: tangent(frames, state[:nq], way), rows[:nq])
        return restored(frames, state[:nq]), state[nq:], [*along, *rows[nq:]]

    here, there = q, qd
    for part in (0.5 * dt, 0.5 * dt, dt, None):
        qdd, by_q, by_qd, by_tau = at(here, there)
        rates.append([*coordinate_rates(frames, here, there), *qdd])
        turns.append([*_coordinates(frames, here, there, by), *_chained(by_q, by_qd, by_tau, by, n)])
        if part is not None:
            here, there, by = moved(part, rates[-1], turns[-1])
    sixth = (1.0 / 6.0) * dt
    return moved(sixth, _weighted(rates), [_weighted(rows) for rows in zip(*turns, strict=True)])


def _coordinates(frames: Sequence[Frame], q: Sequence[Scalar], qd: Sequence[Scalar], by: Rows) -> Rows:
    """Derivatives of the rates of q's coordinates by what the state's derivatives are by."""
    n = len(qd)
    own = _by_column(lambda way: coordinate_rates(frames, q, way), by[n:])
    bent = _by_column(lambda way: rates_bent(frames, q, qd, way), by[:n])
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(own, bent, strict=True)]


def _by_column(function: Callable[[Sequence[Scalar]], Sequence[Scalar]], rows: Rows) -> Rows:
    """The rows whose columns are the function's values of these rows' columns."""
    return [list(row) for row in zip(*(function(column) for column in zip(*rows, strict=True)), strict=True)]


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

    return _on_arrays(given, CoordinateMaps([frame.joint for frame in leading(robot.frames)]), at)


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    """Pinocchio's accelerations and their derivatives along the stages; it has no such step of coordinates."""
    maps = CoordinateMaps(robot.joint_types)
    return _on_arrays(given, maps, lambda q, qd: robot.forward_dynamics_derivatives(q, qd, given["tau"]))


def _on_arrays(
    given: Mapping[str, Array], maps: CoordinateMaps, at: Callable[[Array, Array], Stage]
) -> Arrays:
    """Take the step on (k, nq) and (k, n) arrays. Each stage is one matrix: derivatives of the coordinates' and the
    rates' slopes by (q, qd, tau)."""
    dt, q0, n = step_on_arrays(given), given["q"], given["qd"].shape[-1]
    count, step = len(q0), dt[..., None]
    unit = np.broadcast_to(np.eye(2 * n, 3 * n), (count, 2 * n, 3 * n))
    push = np.broadcast_to(np.eye(3 * n)[2 * n :], (count, n, 3 * n))
    first = times(maps.rates(q0), unit[:, :n])

    def moved(share: float, slopes: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array]:
        way, kick, turn, pushed = slopes
        coordinates = q0 + share * dt * way
        along = times(maps.tangents(coordinates), first + share * step * turn)
        by = np.concatenate([along, unit[:, n:] + share * step * pushed], axis=-2)
        return maps.restored(coordinates), given["qd"] + share * dt * kick, by

    state, total, slopes = (q0, given["qd"], unit), None, None
    for reach, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
        q, qd, by = state if slopes is None else moved(reach, slopes)
        qdd, by_q, by_qd, by_tau = at(q, qd)
        rates, bent = maps.rates(q), maps.bent(q, qd)
        slopes = (
            times(rates, qd[..., None])[..., 0],
            qdd,
            times(rates, by[:, n:]) + times(bent, by[:, :n]),
            times(np.concatenate([by_q, by_qd], axis=-1), by) + times(by_tau, push),
        )
        shares = [weight / 6.0 * x for x in slopes]
        total = shares if total is None else [x + y for x, y in zip(total, shares, strict=True)]
    assert total is not None
    q_next, qd_next, by = moved(1.0, (total[0], total[1], total[2], total[3]))
    return {"q_next": q_next, "qd_next": qd_next, "A": by[..., : 2 * n], "B": by[..., 2 * n :]}


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
)
