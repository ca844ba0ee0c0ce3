"""One step of the classical Runge-Kutta method of fourth order of a robot with contacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from psdmc.dynamics.constraints import Constraints, contact_jacobian
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import coordinate_rates, restored
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.functions import constrained_forward_dynamics
from psdmc.functions import contact_jacobian as jacobian
from psdmc.functions.constrained_forward_dynamics import ERROR
from psdmc.functions.constrained_semi_implicit_euler import RECIPE as EULER
from psdmc.functions.rk4_step import State, runge_kutta_step, step_of_arrays, total_of
from psdmc.functions.rk4_step_derivatives import REACH, WEIGHT
from psdmc.program.regions import Call, Column, For, Reader, Regions, Slice, straight
from psdmc.program.signature import PIVOTS, Signature
from psdmc.recipes.contact_derivatives import Counts
from psdmc.recipes.directions import along
from psdmc.recipes.loops import added, filled
from psdmc.recipes.on_arrays import columns
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.steps import DT, stepped
from psdmc.robot.mechanism import Array, Loop, NamedFrame

ACCELERATIONS = constrained_forward_dynamics.RECIPE

At = Callable[[Given], Arrays]
"""Of the state at a stage: the accelerations, the contact forces and the velocities J qd of the contacts."""


def trace(g: Ingredients) -> Outputs:
    """Between the stages, the displacements `error` change as the contacts move: they are entries of the state."""
    nv, forces, pivots = len(g.still), [], []

    def rates(q: Sequence[Scalar], v: Sequence[Scalar]) -> State:
        qd = list(v[:nv])
        there = replace(g, inputs={**g.inputs, "q": list(q), "qd": qd, ERROR.name: list(v[nv:])})
        found = ACCELERATIONS.trace(there)
        forces.append(found["forces"])
        pivots.append(found[PIVOTS])
        moved = [inner_product(row, qd) for row in contact_jacobian(g.frames, g.named, q, g.root)]
        return coordinate_rates(g.frames, q, qd), [*found["qdd"], *moved]

    start = g.inputs["q"], [*g.inputs["qd"], *g.inputs[ERROR.name]]
    q_next, v_next = runge_kutta_step(start, rates, lambda q: restored(g.frames, q), g.inputs[DT.name][0])
    mean = [(1.0 / 6.0) * x for x in total_of(forces)]
    return {"q_next": q_next, "qd_next": v_next[:nv], "forces": mean, PIVOTS: pivots}


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame], loops: Sequence[Loop] = ()) -> Regions:
    """Return the function's body: a loop over four stages, each with a call of forward dynamics with contacts. The arrays
    are:

    here, there  q, and then qd and the contacts' displacements, of a stage
    rate         their slopes (those of q, qd and the displacements), then the contact forces
    total        weighted sum of the stages' rates
    """
    counts = Counts.of(Constraints(frames, named, loops))
    nq, nv, rows, errors = counts.nq, counts.nv, counts.rows, counts.contact_rows
    size = nq + nv + errors + rows

    def begun(read: Reader) -> dict[str, Column]:
        there = [*read("qd", nv), *read(ERROR.name, errors)]
        return {"here": Column(read("q", nq)), "there": Column(there)}

    def rated(read: Reader) -> dict[str, Column]:
        q, qd = read("here", nq), read("there", nv)
        moved = [inner_product(row, qd) for row in contact_jacobian(frames, named, q)]
        return {"rate": Column([*coordinate_rates(frames, q, qd)]), "moved": Column(moved)}

    def reached(rate: str, reach: str | None, read: Reader) -> dict[str, Column]:
        (step,) = read(DT.name, 1)
        share = step * read(reach, 1)[0] if reach else step
        own = read(rate, nq + nv + errors)
        there = stepped([*read("qd", nv), *read(ERROR.name, errors)], own[nq:], share)
        here = restored(frames, stepped(read("q", nq), own[:nq], share))
        return {"here": Column(here), "there": Column(there)}

    def ended(read: Reader) -> dict[str, Column]:
        names = {"q_next": read("here", nq), "qd_next": read("there", nv)}
        names["forces"] = read("total", rows, 1, size - rows)
        return {name: Column(values) for name, values in names.items()}

    places = {"q": ("here", 0), "qd": ("there", 0), ERROR.name: ("there", nv)}
    given = tuple(places.get(each.name, (each.name, 0)) for each in ACCELERATIONS.signature.inputs)
    stage = (
        Call(ACCELERATIONS.name, given, (("rate", nq), ("rate", size - rows)), nv + counts.constraints),
        straight(rated),
        added(size, Slice("entry", "total"), Slice("other", "rate"), "weight_k"),
        straight(lambda read: reached("rate", "reach_k", read)),
    )
    slices = (
        Slice("reach_k", "reach"),
        Slice("weight_k", "weight"),
        Slice("moved", "rate", nq + nv, 0),
    )
    body = (
        straight(begun),
        filled("total", size),
        For(4, slices, stage),
        straight(lambda read: reached("total", None, read)),
        straight(ended),
    )
    arrays = {"here": nq, "there": nv + errors, "rate": size, "total": size}
    return Regions(arrays, body, {"reach": REACH, "weight": WEIGHT})


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    def at(there: Given) -> Arrays:
        qdd = robot.accelerations(there["q"], there["qd"], there["tau"])
        rows = jacobian.RECIPE.reference(robot, there)["J"]
        return ACCELERATIONS.reference(robot, {**there, "qdd": qdd}) | {"moved": along(rows, there["qd"])}

    def moved(q: Array, qd: Array) -> Array:
        return columns(coordinate_rates(robot.frames, list(q.T), list(qd.T)), len(q))

    return _on_arrays(given, at, moved, lambda q: columns(restored(robot.frames, list(q.T)), len(q)))


def pinocchio(robot: Reference, given: Given) -> Arrays:
    def at(there: Given) -> Arrays:
        rows = jacobian.RECIPE.pinocchio(robot, there)["J"]
        return ACCELERATIONS.pinocchio(robot, there) | {"moved": along(rows, there["qd"])}

    return _on_arrays(given, at, robot.coordinate_rates, robot.restored)


def _on_arrays(
    given: Given,
    at: At,
    moved: Callable[[Array, Array], Array],
    unit: Callable[[Array], Array],
) -> Arrays:
    nv, stages = given["qd"].shape[-1], []

    def rates(q: Array, v: Array) -> tuple[Array, Array]:
        stages.append(at({**given, "q": q, "qd": v[:, :nv], ERROR.name: v[:, nv:]}))
        found = stages[-1]
        return moved(q, v[:, :nv]), np.concatenate([found["qdd"], found["moved"]], axis=1)

    start = {**given, "qd": np.concatenate([given["qd"], given[ERROR.name]], axis=1)}
    found = step_of_arrays(start, rates, unit)
    mean = sum(weight * own["forces"] for weight, own in zip(WEIGHT, stages, strict=True))
    found |= {"qd_next": found["qd_next"][:, :nv], "forces": np.asarray(mean)}
    if PIVOTS in stages[0]:
        found[PIVOTS] = np.concatenate([own[PIVOTS] for own in stages], axis=1)
    return found


Q_NEXT, QD_NEXT, FORCES = EULER.signature.outputs

RECIPE = Recipe(
    Signature(
        "constrained_rk4_step",
        510,
        "the state after dt seconds at constant tau with contacts, by the classical Runge-Kutta method of fourth order; "
        "forces are the mean of the four stages; between the stages, error moves with the contacts",
        EULER.signature.inputs,
        (
            Q_NEXT,
            QD_NEXT,
            replace(FORCES, means=f"means over the step: {FORCES.means}"),
        ),
        theta=True,
        summary="Compute the state of a robot with contacts after one classical fourth-order Runge-Kutta step with "
        "constant torques. Also compute the mean contact forces.",
        factorises=ACCELERATIONS.signature.factorises,
        stages=4,
        calls=(ACCELERATIONS.name,),
    ),
    "step of fourth-order Runge-Kutta with contacts",
    trace,
    reference,
    ACCELERATIONS.against,
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
    closes=True,
)
