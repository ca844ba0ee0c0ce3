"""Impacts and their derivatives by joint positions and by the joint rates before the impact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics import constraints
from psdmc.dynamics.arrow import any_limbs, pushed_slopes_of_limbs
from psdmc.dynamics.constraints import Constraints, changed, contact_slopes, response
from psdmc.dynamics.coordinates import flat
from psdmc.dynamics.derivatives import Derivatives, inverse_dynamics_derivatives
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.scalar import ZERO, Scalar
from psdmc.dynamics.solve import inverse, less, negative
from psdmc.functions import (
    contact_jacobian,
    frame_velocity_derivatives,
    gravity_derivatives,
    impulse,
    mass_matrix_inverse,
)
from psdmc.functions import inverse_dynamics_derivatives as torque_derivatives
from psdmc.functions.constrained_forward_dynamics_derivatives import loop_slopes_by_pinocchio
from psdmc.functions.impulse import AFTER, BEFORE, RESTITUTION
from psdmc.program.regions import Call, Column, Reader, Regions, Slice, straight
from psdmc.program.signature import PIVOTS, Q, Signature, derivative_of
from psdmc.recipes.contact_derivatives import (
    MINUS,
    Changes,
    Counts,
    changed_by_pinocchio,
    changed_on_arrays,
    constraints_of,
    geometry,
    responses,
    scaled,
    slopes_on_arrays,
    thin_blocks,
    thin_outputs,
)
from psdmc.recipes.contacts import Held, joined
from psdmc.recipes.loops import Block, Product, added, filled, one_more
from psdmc.recipes.on_arrays import matrix
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.robot.mechanism import Array, Loop, NamedFrame

WITHOUT = impulse.RECIPE
IMPULSES = WITHOUT.signature.outputs[1]
TORQUES, GRAVITY, INVERSE = (
    each.RECIPE.signature for each in (torque_derivatives, gravity_derivatives, mass_matrix_inverse)
)
BLOCKS = tuple(derivative_of(output, by) for output in (AFTER, IMPULSES) for by in (Q, BEFORE))
NAMES = tuple(block.name for block in BLOCKS)


def trace(g: Ingredients) -> Outputs:
    """Solve for the change of the rates and the impulses. The derivatives solve the same equations, as those of
    constrained forward dynamics do, without gravity and at rest."""
    if any_limbs(g.frames):
        return _in_limbs(g)
    found, _, factors, jacobian = impulse.solved(g)
    q, before = g.inputs["q"], g.inputs[BEFORE.name]
    (restitution,) = g.inputs[RESTITUTION.name]
    slopes = _torque_derivatives(g, found.motion)
    of = Constraints(g.frames, g.named, g.loops, g.root)
    turn = of.pushes(q, found.forces)
    seen = [x + (1.0 + restitution) * rate for x, rate in zip(found.motion, before, strict=True)]
    closed = [x + rate for x, rate in zip(found.motion, before, strict=True)] if g.loops else None
    by_q, _ = of.slopes(q, g.still, seen, closed)
    own = response(inverse(factors), jacobian, Held.of(g).compliance(found.factors))
    rates_q, impulses_q = changed(own, less(turn, slopes.by_q), negative(by_q))
    nothing = [[0.0] * len(before) for _ in before]
    rates_v, impulses_v = changed(own, nothing, _reversed(of, jacobian, restitution))
    for i, row in enumerate(rates_v):
        row[i] = row[i] + 1.0
    blocks = dict(zip(NAMES, (rates_q, rates_v, impulses_q, impulses_v), strict=True))
    return {**impulse.trace(g), **blocks}


def _reversed(
    of: Constraints, jacobian: Sequence[Sequence[Scalar]], restitution: Scalar
) -> list[list[Scalar]]:
    """Derivatives of the prescribed change of the contacts' velocities by the rates before; loops do not rebound."""
    first = of.contact_rows
    return [
        *([-(1.0 + restitution) * x for x in row] for row in jacobian[:first]),
        *negative(jacobian[first:]),
    ]


def _in_limbs(g: Ingredients) -> Outputs:
    """Compute the derivatives by thin factors, limb by limb (constrained_forward_dynamics_derivatives)."""
    q, before, nv = g.inputs["q"], g.inputs[BEFORE.name], len(g.still)
    (restitution,) = g.inputs[RESTITUTION.name]
    jacobian = constraints.contact_jacobian(g.frames, g.named, q, g.root)
    mass = _torque_derivatives(g, g.still).by_qdd
    change, impulses, pivots, arrow = impulse.of_limbs(g, mass, jacobian)
    turn = pushed_slopes_of_limbs(g.frames, g.named, q, impulses, g.root)
    seen = [x + (1.0 + restitution) * rate for x, rate in zip(change, before, strict=True)]
    by_q, _ = contact_slopes(g.frames, g.named, q, g.still, seen, g.root)
    on = Held.of(g).rows[0]
    loads = less(_torque_derivatives(g, change).by_q, turn)
    rates = [restitution * each for each in on]
    found = {
        "q": arrow.thin([*loads, *scaled(on, by_q)], range(nv)),
        BEFORE.name: arrow.thin([*negative(mass), *scaled(rates, jacobian)], range(nv)),
    }
    after = [rate + x for rate, x in zip(before, change, strict=True)]
    return {
        "qd_after": after,
        "impulses": impulses,
        **thin_outputs(arrow, nv, found, "qd_after", "impulses"),
        PIVOTS: pivots,
    }


def _torque_derivatives(g: Ingredients, qdd: Sequence[Scalar]) -> Derivatives:
    return inverse_dynamics_derivatives(
        g.frames, g.bodies, g.drives, g.inputs["q"], g.still, qdd, ZERO, g.choices
    )


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame], loops: Sequence[Loop] = ()) -> Regions:
    """Return the function's body as loops and four calls. Besides those of `Counts.arrays`, the arrays are:

    change    change of the rates
    by_q      derivatives by q of the torques at these accelerations and at rest, less those of gravity
    Minv      inverse of the mass matrix
    wanted_B  derivatives by B of the prescribed change of the contacts' velocities
    """
    of = Constraints(frames, named, loops)
    counts = Counts.of(of)
    nv, rows = counts.nv, counts.rows
    kept: dict[str, list[tuple[int, ...]]] = {}

    def placed(read: Reader) -> dict[str, Column]:
        jacobian, stored = geometry(of, read, "impulses", kept)
        q, before, after = read("q", counts.nq), read(BEFORE.name, nv), read(AFTER.name, nv)
        (restitution,) = read(RESTITUTION.name, 1)
        seen = [x + restitution * rate for x, rate in zip(after, before, strict=True)]
        by_q, _ = of.slopes(q, [0.0] * nv, seen, after)
        more: dict[str, list[Scalar]] = {
            "change": [x - rate for x, rate in zip(after, before, strict=True)],
            "wanted_q": [-x for x in flat(by_q)],
            "wanted_v": flat(_reversed(of, jacobian, restitution)),
        }
        return stored | {name: Column(values) for name, values in more.items()}

    first = straight(placed)
    rates_q, rates_v, impulses_q, impulses_v = NAMES
    signature = WITHOUT.signature
    given, found = (tuple((each.name, 0) for each in part) for part in (signature.inputs, signature.outputs))
    entries = Slice("entry", "turn")
    body = (
        Call(signature.name, given, found, nv + counts.constraints),
        first,
        Call(
            TORQUES.name, (("q", 0), ("still", 0), ("change", 0)), (("by_q", 0), ("unused", 0), ("mass", 0))
        ),
        added(nv * nv, entries, Slice("other", "by_q"), "minus"),
        Call(GRAVITY.name, (("q", 0),), (("unused", 0), ("by_q", 0))),
        added(nv * nv, entries, Slice("other", "by_q")),
        Call(INVERSE.name, (("q", 0),), (("Minv", 0),), nv, again=True),
        Product(Block("Minv", nv), Block("turn", nv), Block(rates_q, nv), nv, nv).loop(range(nv)),
        filled(rates_v, nv * nv),
        *responses(
            of,
            "Minv",
            kept,
            (Changes("wanted_q", rates_q, impulses_q), Changes("wanted_v", rates_v, impulses_v)),
        ),
        one_more(nv, Slice("entry", rates_v, 0, nv + 1)),
    )
    arrays = {"change": nv, "wanted_q": rows * nv, "wanted_v": rows * nv}
    arrays |= dict.fromkeys(("by_q", "unused", "mass", "Minv"), nv * nv)
    return Regions(counts.arrays | arrays, body, MINUS | {"still": (0.0,) * nv})


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = WITHOUT.reference(robot, given)
    q, before, after = given["q"], given[BEFORE.name], found["qd_after"]
    restitution, still = np.reshape(given[RESTITUTION.name], (-1, 1)), np.zeros_like(before)
    slopes = (
        robot.torque_derivatives(q, still, after - before)[0] - robot.torque_derivatives(q, still, still)[0]
    )
    turn, by_q, _ = slopes_on_arrays(
        robot, q, still, after + restitution * before, found["impulses"], of_loops=after
    )
    jacobian = matrix(constraints_of(robot).jacobian(list(q.T)), len(q))
    rebound = restitution * (np.arange(jacobian.shape[1]) < sum(robot.chain.rows_of_contacts))
    wanted = (-by_q, -(1.0 + rebound[..., None]) * jacobian)
    motions, forces, _ = changed_on_arrays(robot, given, (turn - slopes, np.zeros_like(slopes)), wanted)
    return found | _named(motions, forces)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    found = WITHOUT.pinocchio(robot, given)
    q, before, after = given["q"], given[BEFORE.name], found["qd_after"]
    restitution, still = np.reshape(given[RESTITUTION.name], (-1, 1)), np.zeros_like(before)
    slopes, _, _ = robot.weightless.inverse_dynamics_derivatives(q, still, after - before)
    turn = robot.pushed_slopes(q, found["impulses"])
    seen = {"q": q, "qd": after + restitution * before}
    (by_q, *_) = (
        robot.of_contacts(block)
        for block in frame_velocity_derivatives.RECIPE.pinocchio(robot, seen).values()
    )
    jacobian = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    by_rates = -(1.0 + restitution[..., None]) * jacobian
    if robot.loops:
        held = {"q": q, "qd": still, "qdd": after}
        loops = loop_slopes_by_pinocchio(robot, held, found["impulses"][:, jacobian.shape[1] :], 0.0)
        turn = turn + loops.pushes
        by_q, by_rates = joined(by_q, loops.by_q), joined(by_rates, -loops.jacobian)
        jacobian = joined(jacobian, loops.jacobian)
    loads, wanted = (turn - slopes, np.zeros_like(slopes)), (-by_q, by_rates)
    return found | _named(*changed_by_pinocchio(robot, given, loads, wanted, jacobian))


def _named(motions: Sequence[Array], forces: Sequence[Array]) -> Arrays:
    by_q, by_rates = motions
    unit = np.eye(by_rates.shape[-1])
    return dict(zip(NAMES, (by_q, unit + by_rates, *forces), strict=True))


RECIPE = Recipe(
    Signature(
        "impulse_derivatives",
        352,
        "qd_after and impulses of an impact, and their derivatives by q and qd_before; row i: derivatives of qd_after[i] or "
        "impulses[i]",
        WITHOUT.signature.inputs,
        (*WITHOUT.signature.outputs, *BLOCKS),
        theta=True,
        summary="Compute qd_after, the joint rates after an impact, and the contact impulses. Also compute the "
        "derivatives of both by q and qd_before.",
        factorises=WITHOUT.signature.factorises,
        calls=(WITHOUT.name, TORQUES.name, GRAVITY.name, INVERSE.name),
        thin=thin_blocks("qd_after", "impulses", ("q", BEFORE.name)),
    ),
    "derivatives of impulses of an impact",
    trace,
    reference,
    "computeRNEADerivatives, getFrameVelocityDerivatives, crba",
    pinocchio,
    shares="inverse_dynamics",
    matters=("fold_double_angle",),
    regions=regions,
    in_limbs=True,
    closes=True,
)
