"""One step of semi-implicit Euler of a robot with contacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from psdmc.dynamics.constraints import Constraints
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.manifold import integrated
from psdmc.functions import constrained_forward_dynamics
from psdmc.program.regions import Call, Column, Reader, Regions, straight
from psdmc.program.signature import PIVOTS, Signature
from psdmc.recipes.contact_derivatives import Counts
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.steps import DT, Q_NEXT, QD_NEXT, step_on_arrays, stepped, turned
from psdmc.robot.mechanism import Array, Loop, NamedFrame

ACCELERATIONS = constrained_forward_dynamics.RECIPE
Q, QD, TAU, *HELD = ACCELERATIONS.signature.inputs
_, FORCES = ACCELERATIONS.signature.outputs


def trace(g: Ingredients) -> Outputs:
    (dt,) = g.inputs[DT.name]
    found = ACCELERATIONS.trace(g)
    rates = stepped(g.inputs["qd"], found["qdd"], dt)
    q_next = integrated(g.frames, g.inputs["q"], [dt * rate for rate in rates])
    return {"q_next": q_next, "qd_next": rates, "forces": found["forces"], PIVOTS: found[PIVOTS]}


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame], loops: Sequence[Loop] = ()) -> Regions:
    """Return the function's body: a call of forward dynamics with contacts, and the step. The internal arrays have the
    results of the call."""
    counts = Counts.of(Constraints(frames, named, loops))

    def moved(read: Reader) -> dict[str, Column]:
        (dt,) = read(DT.name, 1)
        rates = stepped(read("qd", counts.nv), read("qdd", counts.nv), dt)
        q_next = integrated(frames, read("q", counts.nq), [dt * rate for rate in rates])
        found = {"q_next": q_next, "qd_next": rates, "forces": read("pushed", counts.rows)}
        return {name: Column(values) for name, values in found.items()}

    given = tuple((each.name, 0) for each in ACCELERATIONS.signature.inputs)
    call = Call(ACCELERATIONS.name, given, (("qdd", 0), ("pushed", 0)), counts.nv + counts.constraints)
    return Regions({"qdd": counts.nv, "pushed": counts.rows}, (call, straight(moved)))


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = ACCELERATIONS.reference(robot, given)
    own = _next(given, found, lambda q, way: turned(robot.frames, q, way))
    return own | {PIVOTS: found[PIVOTS]}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return _next(given, ACCELERATIONS.pinocchio(robot, given), robot.integrated)


def _next(given: Given, found: Arrays, moved: Callable[[Array, Array], Array]) -> Arrays:
    dt = step_on_arrays(given)
    rates = given["qd"] + dt * found["qdd"]
    return {"q_next": moved(given["q"], dt * rates), "qd_next": rates, "forces": found["forces"]}


RECIPE = Recipe(
    Signature(
        "constrained_semi_implicit_euler",
        500,
        "the state after dt seconds with contacts: qd_next = qd + dt qdd, q_next = q + dt qd_next, with qdd and forces of "
        "constrained_forward_dynamics at (q, qd)",
        (Q, QD, TAU, DT, *HELD),
        (Q_NEXT, QD_NEXT, FORCES),
        theta=True,
        summary="Compute the state of a robot with contacts after one step of semi-implicit Euler. Also compute the "
        "contact forces of the step.",
        factorises=ACCELERATIONS.signature.factorises,
        calls=(ACCELERATIONS.name,),
    ),
    "step of semi-implicit Euler with contacts",
    trace,
    reference,
    ACCELERATIONS.against,
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
    closes=True,
)
