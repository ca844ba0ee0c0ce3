"""One step of semi-implicit Euler and its Jacobians."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from psdmc.dynamics.coordinates import first_rates, leading
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import integrated, step_slopes
from psdmc.dynamics.solve import inner_product
from psdmc.functions import forward_dynamics_derivatives, semi_implicit_euler
from psdmc.program.regions import Call, Column, For, Reader, Region, Regions, Slice, straight
from psdmc.program.signature import Signature
from psdmc.recipes.loops import Block, added, copied, one_more
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.steps import (
    DT,
    A,
    B,
    semi_implicit,
    semi_implicit_on_arrays,
    slopes_on_arrays,
    step_on_arrays,
    stepped,
)
from psdmc.robot.mechanism import Array, NamedFrame

STEP = semi_implicit_euler.RECIPE
ACCELERATIONS = forward_dynamics_derivatives.RECIPE


def trace(g: Ingredients) -> Outputs:
    (dt,) = g.inputs[DT.name]
    found = forward_dynamics_derivatives.multiplied(g)
    rates = stepped(g.inputs["qd"], found["qdd"], dt)
    blocks = (found["dqdd_dq"], found["dqdd_dqd"], found["dqdd_dtau"])
    by_state, by_torque = semi_implicit(*blocks, dt, step_slopes(g.frames, rates, dt))
    return {
        "q_next": integrated(g.frames, g.inputs["q"], [dt * rate for rate in rates]),
        "qd_next": rates,
        "A": by_state,
        "B": by_torque,
        "pivot": found["pivot"],
    }


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame] = ()) -> Regions:
    """Return the function's body as a call of forward dynamics' derivatives and loops. The internal arrays have the call's
    results (by_q, by_qd and by_tau: derivatives of the accelerations), and those of `state_and_jacobians`."""
    nv = first_rates(frames)[-1]
    names = ("by_q", "by_qd", "by_tau")
    found = (("qdd", 0), *((name, 0) for name in names))
    call = Call(ACCELERATIONS.name, (("q", 0), ("qd", 0), ("tau", 0)), found, nv)
    arrays, body = state_and_jacobians(frames, (*names,), (("B", nv),))
    return Regions({"qdd": nv, "step": 1, **dict.fromkeys(names, nv * nv), **arrays}, (call, *body))


def state_and_jacobians(
    frames: Sequence[Frame], blocks: Sequence[str], others: Sequence[tuple[str, int]]
) -> tuple[dict[str, int], tuple[Region, ...]]:
    """Return the arrays and the regions that compute the new state, A, and derivatives by other quantities.

    blocks  arrays of the derivatives of the accelerations, by q, by qd and by the other quantities
    others  name of the output of each other quantity, such as B, and its number of columns

    The arrays are:

    start_J, way_J       of joint J of n rates, n x n: derivatives of the new position by the old one, and by the new
                         rates

    The caller has the array qdd of accelerations, and the array step, which gets dt.
    """
    first = first_rates(frames)
    nv = first[-1]
    wide = {i: frame.joint.nv for i, frame in enumerate(leading(frames)) if frame.joint.nv > 1}

    def stepped_state(read: Reader) -> dict[str, Column]:
        (dt,) = read(DT.name, 1)
        rates = stepped(read("qd", nv), read("qdd", nv), dt)
        nq = sum(frame.joint.nq for frame in leading(frames))
        q_next = integrated(frames, read("q", nq), [dt * rate for rate in rates])
        found = {"q_next": q_next, "qd_next": rates, "step": [dt]}
        for i, own in enumerate(step_slopes(frames, rates, dt)):
            if own is not None:
                found[f"start_{i}"] = [x for row in own.by_start for x in row]
                found[f"way_{i}"] = [dt * x for row in own.by_step for x in row]
        return {name: Column(values) for name, values in found.items()}

    places = [
        ("A", 0, nv, 2 * nv),
        ("A", nv, nv, 2 * nv),
        *((name, 0, width, width) for name, width in others),
    ]
    arrays = {f"{name}_{i}": n * n for i, n in wide.items() for name in ("start", "way")}
    return arrays, (
        straight(stepped_state),
        *(
            copied(nv, columns, Block(block, columns), Block(into, width).moved(nv, column), "step")
            for block, (into, column, columns, width) in zip(blocks, places, strict=True)
        ),
        one_more(nv, Slice("entry", "A", nv * 2 * nv + nv, 2 * nv + 1)),
        *_positions(first, wide, nv, (("A", 2 * nv), *others)),
    )


def _positions(
    first: Sequence[int], wide: Mapping[int, int], nv: int, matrices: Sequence[tuple[str, int]]
) -> Iterator[For]:
    """Rows of the new positions: what rates' rows move them by, and one by the old position. Neighbouring joints of one
    rate share a loop. `wide` has the number of rates of the other joints, `matrices` the number of columns of each."""
    starts, ends = [0, *(first[i + 1] for i in wide)], [*(first[i] for i in wide), nv]
    for start, end in zip(starts, ends, strict=True):
        if end > start:
            for name, width in matrices:
                rates, rows = (Block(name, width).moved(row) for row in (nv + start, start))
                yield copied(end - start, width, rates, rows, "step")
            yield one_more(end - start, Slice("entry", "A", start * 2 * nv + start, 2 * nv + 1))
    for i, n in wide.items():
        for name, width in matrices:
            yield _turned(i, n, first[i], name, width, nv)
        block = Slice("target", "A", first[i] * 2 * nv + first[i], 2 * nv), Slice("row", f"start_{i}", 0, n)
        yield For(n, block, (added(n, Slice("entry", "target"), Slice("other", "row")),))


def _turned(i: int, n: int, first: int, matrix: str, width: int, nv: int) -> For:
    """Columns of the new position of a joint of several rates."""

    def turned(read: Reader) -> dict[str, Column]:
        way, rates = read(f"way_{i}", n * n), read("rate", n, width)
        return {"entry": Column([inner_product(way[k * n : k * n + n], rates) for k in range(n)], width)}

    columns = Slice("entry", matrix, first * width), Slice("rate", matrix, (nv + first) * width)
    return For(width, columns, (straight(turned),))


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = STEP.reference(robot, given)
    slopes = slopes_on_arrays(robot.frames, step_on_arrays(given) * found["qd_next"])
    return found | _jacobians(ACCELERATIONS.reference(robot, given), given, slopes)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    found = STEP.pinocchio(robot, given)
    slopes = robot.integrated_slopes(given["q"], step_on_arrays(given) * found["qd_next"])
    return found | _jacobians(ACCELERATIONS.pinocchio(robot, given), given, slopes)


def _jacobians(found: Arrays, given: Given, slopes: tuple[Array, Array]) -> Arrays:
    by_q, by_qd, by_tau = (found[name] for name in ("dqdd_dq", "dqdd_dqd", "dqdd_dtau"))
    by_state, by_torque = semi_implicit_on_arrays(by_q, by_qd, by_tau, step_on_arrays(given), slopes)
    return {"A": by_state, "B": by_torque}


RECIPE = Recipe(
    Signature(
        "semi_implicit_euler_derivatives",
        202,
        "the state after dt seconds, and its derivatives A by (q, qd) and B by tau; rows: q_next, then qd_next",
        STEP.signature.inputs,
        (*STEP.signature.outputs, A, B),
        theta=True,
        summary="Compute the state after one step of semi-implicit Euler. Also compute the derivatives of this state "
        "by q, qd and tau.",
        factorises=STEP.signature.factorises,
        spoilt=STEP.signature.spoilt,
        calls=(ACCELERATIONS.name,),
    ),
    "Jacobians of a step of semi-implicit Euler",
    trace,
    reference,
    "aba, computeABADerivatives, dIntegrate",
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
)
