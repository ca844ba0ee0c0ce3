"""Forward dynamics with external wrenches and its derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psdmc.dynamics.coordinates import first_rates, flat, leading
from psdmc.dynamics.derivatives import inverse_dynamics_derivatives
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.kinematics import local_jacobians
from psdmc.dynamics.scalar import ZERO
from psdmc.dynamics.solve import inner_product, negative
from psdmc.dynamics.spatial import Body
from psdmc.functions import (
    forward_dynamics_derivatives,
    forward_dynamics_with_wrenches,
    inverse_dynamics_with_wrenches_derivatives,
)
from psdmc.program.regions import Call, Column, For, Reader, Regions, straight
from psdmc.program.signature import QDD, Signature, derivative_of
from psdmc.recipes.loops import Block, Product, nonzero
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.wrenches import (
    WRENCHES,
    acceleration_derivatives,
    jacobians_transposed,
    loads,
    on_joint_frames,
    wrenches_on_links,
)
from psdmc.reproducible import inverse, times
from psdmc.robot.mechanism import NamedFrame

ACCELERATIONS = forward_dynamics_with_wrenches.RECIPE
TORQUES = inverse_dynamics_with_wrenches_derivatives.RECIPE
WITHOUT = forward_dynamics_derivatives.RECIPE.signature
MASSLESS = Body(0.0, ZERO, (0.0,) * 6)

BLOCKS = tuple(derivative_of(QDD, quantity) for quantity in ACCELERATIONS.signature.inputs)


def trace(g: Ingredients) -> Outputs:
    """Trace as `forward_dynamics_derivatives` does, with d tau_id under the wrenches. The derivative of the accelerations
    by the wrenches is M^-1 J^T."""
    jacobians = jacobians_transposed(g)
    tau = [own + load for own, load in zip(g.inputs["tau"], loads(g, jacobians), strict=True)]
    found = forward_dynamics_derivatives.traced(g, tau, wrenches_on_links(g))
    columns = [[[rows[k] for rows in frame] for k in range(6)] for frame in zip(*jacobians, strict=True)]
    by_wrenches = [
        [[inner_product(row, column) for column in frame] for frame in columns] for row in found["dqdd_dtau"]
    ]
    return {**found, "dqdd_dwrenches": by_wrenches}


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame]) -> Regions:
    """Return the function's body as a call of forward dynamics' derivatives and loops. Wrenches w at the named frames act
    as the torques J^T w, which are constant in the called derivatives. Their derivatives by q add to the result.

    The arrays are:

    load  tau + J^T w
    turn  nv x nv, d (J^T w) / d q
    push  nv x 6 per named frame, J^T
    """
    nv = first_rates(frames)[-1]
    width = 6 * len(named)
    kept: dict[str, list[tuple[int, ...]]] = {}

    def loaded(read: Reader) -> dict[str, Column]:
        q, wrenches = read("q", sum(frame.joint.nq for frame in leading(frames))), read(WRENCHES.name, width)
        jacobians = local_jacobians(frames, named, q)
        push = [[row[k] for each in jacobians for row in each] for k in range(nv)]
        still, none = [0.0] * nv, [0.0] * len(frames)
        massless = inverse_dynamics_derivatives(
            frames,
            [MASSLESS] * len(frames),
            none,
            q,
            still,
            still,
            ZERO,
            external=on_joint_frames(named, wrenches),
        )
        turn = negative(massless.by_q)
        for name, matrix in (("turn", turn), ("push", push)):
            kept[name] = nonzero(list(zip(*matrix, strict=True)))
        load = [tau + inner_product(row, wrenches) for tau, row in zip(read("tau", nv), push, strict=True)]
        return {"load": Column(load), "turn": Column(flat(turn)), "push": Column(flat(push))}

    first = straight(loaded)
    call = Call(
        WITHOUT.name,
        (("q", 0), ("qd", 0), ("load", 0)),
        tuple((output.name, 0) for output in WITHOUT.outputs),
        nv,
    )
    by_q, *_, by_wrenches = (block.name for block in BLOCKS)

    def product(name: str, columns: int, output: str, added: bool) -> Iterator[For]:
        """M^-1, which is symmetric, times a matrix, column by column."""
        factors = Block(name, columns).turned(), Block("dqdd_dtau", nv), Block(output, columns).turned()
        return Product(*factors, columns, nv, added).by_rows(kept[name])

    return Regions(
        {"load": nv, "turn": nv * nv, "push": nv * width},
        (
            first,
            call,
            *product("turn", nv, by_q, added=True),
            *product("push", width, by_wrenches, added=False),
        ),
    )


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    accelerations = ACCELERATIONS.reference(robot, given)
    by_q, by_qd, by_qdd, by_wrenches = TORQUES.reference(robot, {**given, **accelerations}).values()
    by_tau = inverse(by_qdd)
    last = -times(by_tau, by_wrenches.reshape(*by_tau.shape[:2], -1)).reshape(by_wrenches.shape)
    blocks = (-times(by_tau, by_q), -times(by_tau, by_qd), by_tau, last)
    return accelerations | {output.name: block for output, block in zip(BLOCKS, blocks, strict=True)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    found = acceleration_derivatives(robot, given)
    return {output.name: block for output, block in zip((QDD, *BLOCKS), found, strict=True)}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_with_wrenches_derivatives",
        432,
        "qdd under external wrenches, d qdd / d q, d qdd / d qd, d qdd / d tau = M(q)^-1 and d qdd / d wrenches = M(q)^-1 "
        "J^T, J along the named frames' own axes; row i: derivatives of qdd[i]",
        ACCELERATIONS.signature.inputs,
        (QDD, *BLOCKS),
        theta=True,
        summary="Compute the accelerations qdd that torques cause under external wrenches. Also compute the "
        "derivatives of qdd by q, qd, tau and wrenches.",
        factorises=ACCELERATIONS.signature.factorises,
        products=WITHOUT.products,
        calls=(WITHOUT.name,),
    ),
    "derivatives of forward dynamics with wrenches",
    trace,
    reference,
    "computeABADerivatives with fext",
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
)
