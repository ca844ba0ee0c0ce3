"""Forward dynamics with contacts and its derivatives by joint positions, rates and torques."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from psdmc.dynamics.arrow import any_limbs, pushed_slopes_of_limbs
from psdmc.dynamics.constraints import Constraints, changed, contact_slopes, response
from psdmc.dynamics.constraints import contact_jacobian as contact_jacobian_of
from psdmc.dynamics.coordinates import flat
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.solve import inner_product, inverse, less, negative
from psdmc.functions import (
    constrained_forward_dynamics,
    contact_jacobian,
    forward_dynamics_derivatives,
    frame_acceleration_derivatives,
    loop_drift,
    loop_error,
    loop_jacobian,
)
from psdmc.functions.constrained_forward_dynamics import ERROR, KD, KP
from psdmc.program.regions import Call, Column, Reader, Regions, straight
from psdmc.program.signature import PIVOTS, QD, QDD, TAU, Q, Signature, derivative_of
from psdmc.recipes.contact_derivatives import (
    MINUS,
    Changes,
    Counts,
    changed_by_pinocchio,
    changed_on_arrays,
    constraints_of,
    geometry,
    held_inverse,
    pushed_motion,
    responses,
    scaled,
    slopes_on_arrays,
    thin_blocks,
    thin_outputs,
)
from psdmc.recipes.contacts import Held, joined
from psdmc.recipes.directions import along
from psdmc.recipes.loops import Block, copied
from psdmc.recipes.on_arrays import matrix
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import torque_derivatives
from psdmc.robot.mechanism import Array, Loop, NamedFrame

WITHOUT = constrained_forward_dynamics.RECIPE
FREE = forward_dynamics_derivatives.RECIPE.signature
FORCES = WITHOUT.signature.outputs[1]
BLOCKS = tuple(derivative_of(output, by) for output in (QDD, FORCES) for by in (Q, QD, TAU, ERROR))
NAMES = tuple(block.name for block in BLOCKS)


def trace(g: Ingredients) -> Outputs:
    """Solve for accelerations and forces. The derivatives solve the same equations: the load changes by those of J^T f less
    those of inverse dynamics, the prescribed accelerations by minus those of the contacts' accelerations."""
    if any_limbs(g.frames):
        return _in_limbs(g)
    found, signs, factors, jacobian = constrained_forward_dynamics.solved(g)
    q, qd = g.inputs["q"], g.inputs["qd"]
    (kp,), (kd,) = (g.inputs[each.name] for each in (KP, KD))
    slopes = torque_derivatives(g, found.motion)
    of = Constraints(g.frames, g.named, g.loops, g.root)
    turn = of.pushes(q, found.forces)
    damped = [x + kd * rate for x, rate in zip(found.motion, qd, strict=True)]
    by_q, by_qd = of.slopes(q, qd, damped)
    by_q = of.drawn_closed(by_q, q, kp)
    own = response(inverse(factors), jacobian, Held.of(g).compliance(found.factors))
    loads = (less(turn, slopes.by_q), negative(slopes.by_qd))
    wanted = (
        negative(by_q),
        [[-(x + kd * y) for x, y in zip(*rows, strict=True)] for rows in zip(by_qd, jacobian, strict=True)],
    )
    motions, forces = zip(*(changed(own, *each) for each in zip(loads, wanted, strict=True)), strict=True)
    first = of.contact_rows
    by_error = [[-kp * row[i] for row in own.push[:first]] for i in range(len(g.still))]
    motions = (*motions, own.inverse, by_error)
    forces = (
        *forces,
        negative(own.push),
        [[-kp * x for x in row[:first]] for row in own.compliance],
    )
    blocks = dict(zip(NAMES, (*motions, *forces), strict=True))
    return {"qdd": found.motion, "forces": found.forces, **blocks, PIVOTS: [*factors.pivots, *signs]}


def _in_limbs(g: Ingredients) -> Outputs:
    """Compute the derivatives by thin factors, limb by limb (forward_dynamics_derivatives). Minus the contact forces are
    further unknowns of the limbs."""
    q, qd, nv = g.inputs["q"], g.inputs["qd"], len(g.still)
    (kp,), (kd,) = (g.inputs[each.name] for each in (KP, KD))
    at_rest = torque_derivatives(g, g.still)
    rows = contact_jacobian_of(g.frames, g.named, q, g.root)
    mask, arrow, margins, wanted = constrained_forward_dynamics.of_limbs(g, at_rest.by_qdd, rows, None)
    on, count = mask.rows[0], len(rows)
    load = [tau - own for tau, own in zip(g.inputs["tau"], at_rest.gravity, strict=True)]
    by_qd = [*([*row, *[0.0] * count] for row in at_rest.by_qd), *([0.0] * (nv + count) for _ in rows)]
    found = arrow.solved([*load, *wanted], by_qd, [*(0.5 * rate for rate in qd), *[0.0] * count])
    motion, forces = found[:nv], [-value for value in found[nv:]]
    moving = torque_derivatives(g, motion)
    turn = pushed_slopes_of_limbs(g.frames, g.named, q, forces, g.root)
    damped = [x + kd * rate for x, rate in zip(motion, qd, strict=True)]
    slopes = contact_slopes(g.frames, g.named, q, qd, damped, g.root)
    by_rate = [[x + kd * y for x, y in zip(*pair, strict=True)] for pair in zip(slopes[1], rows, strict=True)]
    unit = [[float(i == j) for j in range(nv + count)] for i in range(nv + count)]
    found_by = {
        "q": arrow.thin([*less(moving.by_q, turn), *scaled(on, slopes[0])], range(nv)),
        "qd": arrow.thin([*at_rest.by_qd, *scaled(on, by_rate)], range(nv)),
        "tau": arrow.thin([[-x for x in row[:nv]] for row in unit], range(nv)),
        "error": arrow.thin(
            [row[nv:] for row in scaled([*[1.0] * nv, *(kp * each for each in on)], unit)],
            range(nv, nv + count),
        ),
    }
    return {
        "qdd": motion,
        "forces": forces,
        **thin_outputs(arrow, nv, found_by, "qdd", "forces"),
        PIVOTS: [*arrow.pivots[:nv], *mask.signs(margins)],
    }


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame], loops: Sequence[Loop] = ()) -> Regions:
    """Return the function's body as loops and two calls. The first is of forward dynamics with contacts, the second of
    the derivatives of forward dynamics, at torques that contain the contact forces. Besides those of `Counts.arrays`, the
    arrays are:

    load        tau + J^T f
    same        accelerations, again
    wanted_B    derivatives by B of the prescribed accelerations
    minus_kp    minus kp
    """
    of = Constraints(frames, named, loops)
    counts = Counts.of(of)
    nv, rows, first_rows = counts.nv, counts.rows, counts.contact_rows
    kept: dict[str, list[tuple[int, ...]]] = {}

    def placed(read: Reader) -> dict[str, Column]:
        jacobian, stored = geometry(of, read, "forces", kept)
        q, qd, qdd = read("q", counts.nq), read("qd", nv), read("qdd", nv)
        (kp,), (kd,) = read(KP.name, 1), read(KD.name, 1)
        damped = [x + kd * rate for x, rate in zip(qdd, qd, strict=True)]
        by_q, by_qd = of.slopes(q, qd, damped)
        by_q = of.drawn_closed(by_q, q, kp)
        held = [
            [-(x + kd * y) for x, y in zip(*pair, strict=True)] for pair in zip(by_qd, jacobian, strict=True)
        ]
        push = zip(*jacobian, strict=True)
        forces = read("forces", rows)
        load = [tau + inner_product(own, forces) for tau, own in zip(read("tau", nv), push, strict=True)]
        more = {
            "load": load,
            "wanted_q": [-x for x in flat(by_q)],
            "wanted_qd": flat(held),
            "minus_kp": [-kp],
        }
        return stored | {name: Column(values) for name, values in more.items()}

    first = straight(placed)
    by_q, by_qd, by_tau, by_error, forces_q, forces_qd, forces_tau, forces_error = NAMES
    signature = WITHOUT.signature
    given, found = (tuple((each.name, 0) for each in part) for part in (signature.inputs, signature.outputs))
    push, compliance = Block("push", nv), Block("compliance", rows)
    body = (
        Call(signature.name, given, found, nv + counts.constraints),
        first,
        Call(
            FREE.name,
            (("q", 0), ("qd", 0), ("load", 0)),
            (("same", 0), (by_q, 0), (by_qd, 0), (by_tau, 0)),
            nv,
            again=True,
        ),
        *pushed_motion(nv, by_tau, by_q, kept["turn"]),
        *responses(
            of,
            by_tau,
            kept,
            (Changes("wanted_q", by_q, forces_q), Changes("wanted_qd", by_qd, forces_qd)),
        ),
        *held_inverse(of, by_tau, forces_tau),
        copied(nv, first_rows, push.turned(), Block(by_error, first_rows), "minus_kp"),
        copied(rows, first_rows, compliance, Block(forces_error, first_rows), "minus_kp"),
    )
    arrays = {"load": nv, "same": nv, "wanted_q": rows * nv, "wanted_qd": rows * nv, "minus_kp": 1}
    return Regions(counts.arrays | arrays, body, MINUS)


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = WITHOUT.reference(robot, given)
    kp, kd = (np.reshape(given[each.name], (-1, 1, 1)) for each in (KP, KD))
    q, qd = given["q"], given["qd"]
    slopes = robot.torque_derivatives(q, qd, found["qdd"])
    turn, by_q, by_qd = slopes_on_arrays(
        robot, q, qd, found["qdd"] + kd[..., 0] * qd, found["forces"], kp=kp[:, 0, 0]
    )
    jacobian = matrix(constraints_of(robot).jacobian(list(q.T)), len(q))
    first = sum(robot.chain.rows_of_contacts)
    loads, wanted = (turn - slopes[0], -slopes[1]), (-by_q, -(by_qd + kd * jacobian))
    motions, forces, (fixed, push, compliance) = changed_on_arrays(robot, given, loads, wanted)
    motions += [fixed, kp * np.swapaxes(push, -1, -2)[..., :first]]
    forces += [push, -kp * compliance[..., :first]]
    return found | dict(zip(NAMES, (*motions, *forces), strict=True))


class LoopSlopes(NamedTuple):
    """The Jacobian J of loops, the derivatives of J^T f by q, and those of J qdd + dJ/dt qd + kp error."""

    jacobian: Array
    pushes: Array
    by_q: Array
    by_qd: Array


def loop_slopes_by_pinocchio(robot: Reference, given: Given, forces: Array, kp: Array | float) -> LoopSlopes:
    """Return the derivatives for k states from differences of Pinocchio's placements and accelerations.

    Those by q are central differences of sixth order. Drifts are quadratic in qd, so a step of one is exact.
    """

    def all_at(q: Array) -> Array:
        there = {**given, "q": q}
        jacobian = loop_jacobian.RECIPE.pinocchio(robot, there)["J"]
        pushed = np.einsum("krj,kr->kj", jacobian, forces)
        moved = along(jacobian, given["qdd"]) + loop_drift.RECIPE.pinocchio(robot, there)["drift"]
        error = loop_error.RECIPE.pinocchio(robot, there)["error"]
        return np.concatenate([pushed, moved + kp * error], axis=1)

    q, qd = given["q"], given["qd"]
    ways = np.eye(qd.shape[1])
    by_q, by_qd = [], []
    for way in ways:
        near = [
            weight
            * (all_at(robot.integrated(q, k * STEP * way)) - all_at(robot.integrated(q, -k * STEP * way)))
            for k, weight in enumerate(WEIGHTS, start=1)
        ]
        by_q.append(np.sum(near, axis=0) / STEP)
        ahead, behind = (
            loop_drift.RECIPE.pinocchio(robot, {**given, "qd": qd + sign * way})["drift"] for sign in (1, -1)
        )
        by_qd.append(0.5 * (ahead - behind))
    pushes, moved = np.split(np.stack(by_q, axis=-1), [len(ways)], axis=1)
    jacobian = loop_jacobian.RECIPE.pinocchio(robot, given)["J"]
    return LoopSlopes(jacobian, pushes, moved, np.stack(by_qd, axis=-1))


STEP, WEIGHTS = 3e-3, (3 / 4, -3 / 20, 1 / 60)
"""Step in rad or m of central differences of sixth order, and the weights of one, two and three steps."""


def pinocchio(robot: Reference, given: Given) -> Arrays:
    found = WITHOUT.pinocchio(robot, given)
    kp, kd = (np.reshape(given[each.name], (-1, 1, 1)) for each in (KP, KD))
    q, qd, qdd = given["q"], given["qd"], found["qdd"]
    slopes = robot.inverse_dynamics_derivatives(q, qd, qdd)
    turn = robot.pushed_slopes(q, found["forces"])
    moved = {"q": q, "qd": qd, "qdd": qdd + kd[..., 0] * qd}
    by_q, by_qd, _ = (
        robot.of_contacts(block)
        for block in frame_acceleration_derivatives.RECIPE.pinocchio(robot, moved).values()
    )
    jacobian = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    rows = jacobian.shape[1]
    if robot.loops:
        loops = loop_slopes_by_pinocchio(robot, moved, found["forces"][:, rows:], kp[..., 0])
        turn = turn + loops.pushes
        jacobian, by_q, by_qd = (
            joined(*pair) for pair in ((jacobian, loops.jacobian), (by_q, loops.by_q), (by_qd, loops.by_qd))
        )
    unit = np.broadcast_to(np.eye(qd.shape[1]), slopes[0].shape)
    one = np.broadcast_to(np.eye(jacobian.shape[1], rows), (len(q), jacobian.shape[1], rows))
    loads = (turn - slopes[0], -slopes[1], unit, np.zeros((len(q), qd.shape[1], rows)))
    wanted = (-by_q, -(by_qd + kd * jacobian), np.zeros_like(jacobian), -kp * one)
    motions, forces = changed_by_pinocchio(robot, given, loads, wanted, jacobian)
    return found | dict(zip(NAMES, (*motions, *forces), strict=True))


RECIPE = Recipe(
    Signature(
        "constrained_forward_dynamics_derivatives",
        342,
        "qdd and forces of constrained_forward_dynamics, and their derivatives by q, qd, tau and error; row i: derivatives "
        "of qdd[i] or forces[i]; those by q hold error constant",
        WITHOUT.signature.inputs,
        (QDD, FORCES, *BLOCKS),
        theta=True,
        summary="Compute the accelerations qdd and contact forces that torques cause. Also compute derivatives of "
        "qdd and forces by q, qd, tau and error. The input `error` is the displacement of the contacts. The "
        "derivatives by q hold `error` constant.",
        factorises=WITHOUT.signature.factorises,
        calls=(WITHOUT.name, FREE.name),
        thin=thin_blocks("qdd", "forces", ("q", "qd", "tau", "error")),
    ),
    "derivatives of constrained forward dynamics",
    trace,
    reference,
    "computeRNEADerivatives, getFrameAccelerationDerivatives, crba",
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
    in_limbs=True,
    closes=True,
)
