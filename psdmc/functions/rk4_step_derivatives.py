"""One step of the classical Runge-Kutta method and its Jacobians."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from psdmc.dynamics.coordinates import leading
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import coordinate_rates, rates_bent, restored, tangent
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import forward_dynamics_derivatives as accelerations
from psdmc.functions import rk4_step
from psdmc.program.regions import (
    Call,
    Column,
    For,
    Reader,
    Region,
    Regions,
    Slice,
    drop_unread,
    run,
    straight,
)
from psdmc.program.signature import Signature
from psdmc.recipes.loops import Block, added, copied, diagonal, filled
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.steps import A, B, CoordinateMaps, step_on_arrays, stepped
from psdmc.reproducible import times
from psdmc.robot.mechanism import Array, NamedFrame

STEP = rk4_step.RECIPE
ACCELERATIONS = accelerations.RECIPE

REACH = (0.5, 0.5, 1.0, 0.0)
"""Share of the step from the start to the next stage; behind the last one there is none."""

WEIGHT = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)

Stage = tuple[Any, Any, Any, Any]
"""At a state: qdd, and its derivatives by q, qd and tau."""


def trace(g: Ingredients) -> Outputs:
    """Compute one step and its Jacobians as straight-line code, without loops. The derivatives of forward dynamics are
    computed four times, once per Runge-Kutta stage."""
    nq, nv = len(g.inputs["q"]), len(g.still)

    def call(_: str, given: list[list[Scalar]]) -> tuple[list[list[Scalar]], list[Scalar]]:
        q, qd, tau = given[0][:nq], given[1][:nv], given[2][:nv]
        found = accelerations.multiplied(replace(g, inputs={**g.inputs, "q": q, "qd": qd, "tau": tau}))
        blocks = [[x for row in found[name] for x in row] for name in ("dqdd_dq", "dqdd_dqd", "dqdd_dtau")]
        return [list(found["qdd"]), *blocks], list(found["pivot"])

    sizes = {"q_next": nq, "qd_next": nv, "A": 4 * nv * nv, "B": 2 * nv * nv}
    found, pivots = run(regions(g.frames), g.inputs, sizes, call)
    return {**found, "pivot": pivots}


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame] = ()) -> Regions:
    """Return the function's body as loops and calls of forward dynamics: it computes the state after dt and its
    derivatives.

    The state is the start plus dt / 6 times the weighted sum of four slopes, with the weights 1, 2, 2, 1. The
    derivatives are summed with the weights of the slopes. Each stage has slopes of q's entries and of qd. Between
    stages, derivatives are along the tangent of q. The arrays are:

    here, there    q and qd of a stage
    by_q, by_v     nv x 3 nv, derivatives of q (along its tangent) and of qd, by q, qd and tau
    rate, turn     nq + nv and nq + nv x 3 nv, slopes of q's entries and of qd, and their derivatives by q, qd and tau
    start          the derivatives of q's entries and of qd at the start
    total, totals  sums of slopes, and of their derivatives
    """
    nq, nv = (sum(getattr(frame.joint, size) for frame in leading(frames)) for size in ("nq", "nv"))
    width, rows = 3 * nv, nq + nv

    def begun(read: Reader) -> dict[str, Column]:
        q, qd = read("q", nq), read("qd", nv)
        own = {"q0": q, "here": q, "v0": qd, "there": qd, "load": read("tau", nv), "step": read("dt", 1)}
        return {name: Column(values) for name, values in own.items()}

    def started(read: Reader) -> dict[str, Column]:
        return {"start_k": Column(coordinate_rates(frames, read("here", nq), read("unit", nv, width)), width)}

    def rated(read: Reader) -> dict[str, Column]:
        return {"rate": Column(coordinate_rates(frames, read("here", nq), read("there", nv)))}

    def turned(read: Reader) -> dict[str, Column]:
        q, qd = read("here", nq), read("there", nv)
        own = coordinate_rates(frames, q, read("by_v_k", nv, width))
        bent = rates_bent(frames, q, qd, read("by_q_k", nv, width))
        return {"turn_k": Column([x + y for x, y in zip(own, bent, strict=True)], width)}

    def chained(read: Reader) -> dict[str, Column]:
        by_q = zip(read("to_q_i", nv), read("by_q_k", nv, width), strict=True)
        by_v = zip(read("to_v_i", nv), read("by_v_k", nv, width), strict=True)
        products = [a * b for a, b in (*by_q, *by_v)]
        return {"entry": Column([sum(products[1:], products[0])])}

    chain = For(
        nv,
        (
            Slice("row", "turn", nq * width, width),
            *(Slice(f"{name}_i", name, 0, nv) for name in ("to_q", "to_v", "to_tau")),
        ),
        (
            For(
                width,
                (Slice("entry", "row"), Slice("by_q_k", "by_q"), Slice("by_v_k", "by_v")),
                (straight(chained),),
            ),
            added(nv, Slice("entry", "row", 2 * nv), Slice("other", "to_tau_i")),
        ),
    )
    stage = (
        Call(
            ACCELERATIONS.name,
            (("here", 0), ("there", 0), ("load", 0)),
            (("rate", nq), ("to_q", 0), ("to_v", 0), ("to_tau", 0)),
            nv,
        ),
        straight(rated),
        For(
            width,
            (Slice("turn_k", "turn"), Slice("by_q_k", "by_q"), Slice("by_v_k", "by_v")),
            (straight(turned),),
        ),
        chain,
        added(rows, Slice("entry", "total"), Slice("other", "rate"), "weight_k"),
        added(rows * width, Slice("entry", "totals"), Slice("other", "turn"), "weight_k"),
        *_moved(frames, nq, nv, "rate", "turn", "reach_k"),
    )
    body = (
        straight(begun),
        filled("by_q", nv * width),
        filled("by_v", nv * width),
        diagonal(nv, Slice("entry", "by_q", 0, width + 1)),
        diagonal(nv, Slice("entry", "by_v", nv, width + 1)),
        filled("start", rows * width),
        For(nv, (Slice("start_k", "start"), Slice("unit", "by_v", nv)), (straight(started),)),
        diagonal(nv, Slice("entry", "start", nq * width + nv, width + 1)),
        filled("total", rows),
        filled("totals", rows * width),
        For(4, (Slice("reach_k", "reach"), Slice("weight_k", "weight")), stage),
        *_moved(frames, nq, nv, "total", "totals"),
        straight(lambda read: {"q_next": Column(read("here", nq)), "qd_next": Column(read("there", nv))}),
        *(
            copied(nv, 2 * nv, Block(name, width), Block("A", 2 * nv).moved(k * nv))
            for k, name in enumerate(("by_q", "by_v"))
        ),
        *(
            copied(nv, nv, Block(name, width).moved(0, 2 * nv), Block("B", nv).moved(k * nv))
            for k, name in enumerate(("by_q", "by_v"))
        ),
    )
    vectors = {"q0": nq, "here": nq, "x": nq, "v0": nv, "there": nv, "load": nv, "step": 1, "share": 1}
    vectors |= dict.fromkeys(("rate", "total"), rows) | dict.fromkeys(("to_q", "to_v", "to_tau"), nv * nv)
    matrices = dict.fromkeys(("by_q", "by_v"), nv * width) | dict.fromkeys(
        ("start", "turn", "totals"), rows * width
    )
    return drop_unread(Regions(vectors | matrices, body, {"reach": REACH, "weight": WEIGHT}))


def _moved(
    frames: Sequence[Frame], nq: int, nv: int, rate: str, turn: str, reach: str | None = None
) -> tuple[Region, ...]:
    """Where slopes lead from the start in a share of the step: a state, and its derivatives."""
    width = 3 * nv

    def moved(read: Reader) -> dict[str, Column]:
        step = read("step", 1)[0]
        share = step * read(reach, 1)[0] if reach else step
        own = read(rate, nq + nv)
        x = stepped(read("q0", nq), own[:nq], share)
        there, here = stepped(read("v0", nv), own[nq:], share), restored(frames, x)
        return {
            name: Column(values)
            for name, values in {"x": x, "here": here, "there": there, "share": [share]}.items()
        }

    def along(read: Reader) -> dict[str, Column]:
        way = stepped(read("start_k", nq, width), read("turn_k", nq, width), read("share", 1)[0])
        return {"by_q_k": Column(tangent(frames, read("x", nq), way), width)}

    def pushed(read: Reader) -> dict[str, Column]:
        return {"entry": Column(stepped(read("own", 1), read("other", 1), read("share", 1)[0]))}

    first = nq * width
    return (
        straight(moved),
        For(
            width,
            (Slice("by_q_k", "by_q"), Slice("start_k", "start"), Slice("turn_k", turn)),
            (straight(along),),
        ),
        For(
            nv * width,
            (Slice("entry", "by_v"), Slice("own", "start", first), Slice("other", turn, first)),
            (straight(pushed),),
        ),
    )


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    def at(q: Array, qd: Array) -> Stage:
        qdd = robot.accelerations(q, qd, given["tau"])
        there = {"q": q, "qd": qd, "qdd": qdd, "tau": given["tau"]}
        found = ACCELERATIONS.reference(robot, there)
        return qdd, found["dqdd_dq"], found["dqdd_dqd"], found["dqdd_dtau"]

    return _on_arrays(given, CoordinateMaps([frame.joint for frame in leading(robot.frames)]), at)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return the step and its Jacobians from Pinocchio's accelerations and their derivatives at the four stages, for
    tests. Pinocchio has no Runge-Kutta step."""
    maps = CoordinateMaps(robot.joint_types)
    return _on_arrays(given, maps, lambda q, qd: robot.forward_dynamics_derivatives(q, qd, given["tau"]))


def _on_arrays(given: Given, maps: CoordinateMaps, at: Callable[[Array, Array], Stage]) -> Arrays:
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
        summary="Compute the state after one step of the classical fourth-order Runge-Kutta method. Also compute the "
        "derivatives of this state by q, qd and tau.",
        factorises=STEP.signature.factorises,
        spoilt=STEP.signature.spoilt,
        calls=(ACCELERATIONS.name,),
    ),
    "Jacobians of a step of fourth-order Runge-Kutta",
    trace,
    reference,
    "aba, computeABADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
    straight=0,
)
