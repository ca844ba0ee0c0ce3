"""Inverse dynamics with contacts: joint torques and contact forces of a motion, where no motor acts on a floating base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from psdmc.dynamics.constraints import Constraints
from psdmc.dynamics.frames import Frame, has_floating_base
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.functions import contact_jacobian, loop_jacobian
from psdmc.functions.constrained_forward_dynamics import FORCES, OF_LOOPS
from psdmc.program.operations import Op
from psdmc.program.signature import PIVOTS, QD, QDD, TAU, Q, Signature, Structure, SymmetricMatrix
from psdmc.recipes import contacts as held
from psdmc.recipes.closed_loops import passive_rates
from psdmc.recipes.contacts import ACTIVE, Held, held_rows, joined
from psdmc.recipes.on_arrays import columns
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.singular_matrices import least_squares
from psdmc.recipes.torques_and_accelerations import torques

BASE_ROWS = 6
"""Rows of tau that belong to a floating base: three forces, then three moments about its origin."""

LINEAR = 3

ROUNDED = 1e-12
"""Entries of Pinocchio's Jacobians below this are rounding; if all are, least squares would find a rank."""

MU = replace(
    held.MU,
    means="regularisation, 0 or more (not a friction coefficient): the weight of |forces|^2 in the sum that psdmc "
    "minimises, with forces in N and moments in N m",
    unit="1",
)

MASK = SymmetricMatrix(
    "the set of active contacts",
    Structure.BLOCKS,
    ("contacts",),
    number="the number, from 0, of the first contact whose active is neither 0 nor 1, or of the first contact if mu is "
    "negative",
    failure="an entry of active is neither 0 nor 1\nmu is negative",
    error="contact {contacts!r}: active or mu is not allowed",
    hint="give active 0 or 1 for each contact, and mu = 0 or more",
)

Rows = Sequence[Sequence[Scalar]]

Equation = tuple[list[Scalar], Scalar]
"""Of forces: a row of J^T without unit, and a torque in N."""


def trace(g: Ingredients) -> Outputs:
    without = torques(g, g.inputs["qd"], g.inputs["qdd"], g.base_acceleration)
    rows = Constraints(g.frames, g.named, g.loops, g.root).jacobian(g.inputs["q"])
    return _values(g.frames, without, rows, Held.of(g))


def _values(frames: Sequence[Frame], without: Sequence[Scalar], jacobian: Rows, mask: Held) -> Outputs:
    forces = _forces(frames, without, jacobian, mask)
    turned = zip(*jacobian, strict=True)
    tau = [own - inner_product(column, forces) for own, column in zip(without, turned, strict=True)]
    # NaN is no mu: all comparisons with it are false.
    allowed = islice(mask.allowed(), len(mask.active))
    signs = [Op.SELECT(-1.0, mask.mu, sign, -1.0) for sign in allowed]
    return {TAU.name: tau, FORCES.name: forces, PIVOTS: signs}


def _forces(frames: Sequence[Frame], without: Sequence[Scalar], jacobian: Rows, mask: Held) -> list[Scalar]:
    """Return the forces f that minimise |tau - J^T f|^2 + mu |f|^2, with the base's rows of tau and of J^T.

    If the robot has passive joints, the loops' forces make the torques of these joints zero, and f are the contacts'
    forces. A moment is treated as the force that has this moment at a distance of 1 m, so all terms are forces in newtons.
    """
    metre, per_metre = mask.si(1.0, "m"), mask.si(1.0, "1/m")
    active, angular = mask.rows[0], [axis >= LINEAR for own in mask.axes for axis in own]
    passive, slides = passive_rates(frames, mask.loops)

    def equation(j: int) -> Equation:
        column = [on * own[j] for on, own in zip(active, jacobian, strict=True)]
        if not slides[j]:
            row = [x if turns else x * per_metre for turns, x in zip(angular, column, strict=True)]
            return row, without[j] * per_metre
        # A moment has no force on the base. It has one on a sliding joint that others follow.
        factor = 0.0 if j < LINEAR and has_base else metre
        return [x * factor if turns else x for turns, x in zip(angular, column, strict=True)], without[j]

    has_base = has_floating_base(frames)
    of_base = [equation(j) for j in range(BASE_ROWS)] if has_base else []
    if passive:
        cut = len(active) - sum(len(loop.rows) for loop in mask.loops)
        found = _with_passive(of_base, [equation(j) for j in passive], cut, mask.mu)
    else:
        found = _solution(of_base, mask.mu) if of_base else [0.0] * len(jacobian)
    return [x * metre if turns else x for turns, x in zip(angular, found, strict=True)]


def _solution(equations: Sequence[Equation], mu: Scalar) -> list[Scalar]:
    rows, right = zip(*equations, strict=True)
    return least_squares(rows, right, mu)


def _with_passive(
    of_base: Sequence[Equation], of_passive: Sequence[Equation], cut: int, mu: Scalar
) -> list[Scalar]:
    """Return the forces of the contacts, `cut` entries, and of the loops. The loops' forces g solve the equations of the
    passive joints, P_c f + P_g g = p, for the contacts' forces f of the equations of the base, B_c f + B_g g = b."""

    def of_loops(right: Sequence[Scalar]) -> list[Scalar]:
        return _solution([(row[cut:], x) for (row, _), x in zip(of_passive, right, strict=True)], 0.0)

    alone = of_loops([x for _, x in of_passive])
    if not of_base:
        return [*([0.0] * cut), *alone]
    per_force = [of_loops([row[k] for row, _ in of_passive]) for k in range(cut)]
    left = [
        (
            [x - inner_product(row[cut:], taken) for x, taken in zip(row[:cut], per_force, strict=True)],
            right - inner_product(row[cut:], alone),
        )
        for row, right in of_base
    ]
    found = _solution(left, mu)
    rest = [right - inner_product(row[:cut], found) for row, right in of_passive]
    return [*found, *of_loops(rest)]


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, qd, qdd = (given[name] for name in ("q", "qd", "qdd"))
    without = list(robot.torques(q, qd, qdd, robot.base_acceleration).T)
    loops = robot.chain.loops
    rows = Constraints(robot.frames, robot.chain.frames, loops).jacobian(list(q.T))
    found = _values(robot.frames, without, rows, Held.on_arrays(robot, given, loops))
    return {name: columns(values, len(q)) for name, values in found.items()}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Solve least squares by NumPy. The loops' forces are eliminated by the null space of the passive joints' equations."""
    tau = robot.inverse_dynamics(given["q"], given["qd"], given["qdd"])
    jacobian = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    if robot.loops:
        jacobian = joined(jacobian, loop_jacobian.RECIPE.pinocchio(robot, given)["J"])
    masks = held_rows(robot, given)
    forces, contacts = np.zeros(masks.shape), sum(rows for _, rows in robot.contacts)
    floats = robot.model.joints[1].shortname() == "JointModelFreeFlyer"
    base, passive = list(range(BASE_ROWS if floats else 0)), list(robot.passive)
    for k, (own, on, mu) in enumerate(zip(jacobian, masks, np.reshape(given[MU.name], -1), strict=True)):
        start, free = np.zeros(len(on)), np.eye(len(on))[:, on]
        if passive:
            of_loops = own[contacts:, passive].T
            start[contacts:] = np.linalg.solve(of_loops, tau[k, passive])
            free = np.eye(len(on))[:, :contacts][:, on[:contacts]]
            free[contacts:] = -np.linalg.solve(of_loops, own[:contacts][on[:contacts]][:, passive].T)
        rows, count = own[:, base].T, free.shape[1]
        rows = np.where(np.abs(rows) > ROUNDED, rows, 0.0)  # loops within the robot have no force on its base
        whole = np.vstack([rows @ free, np.sqrt(mu) * np.eye(count)])
        right = np.append(tau[k, base] - rows @ start, np.zeros(count))
        forces[k] = start + free @ np.linalg.lstsq(whole, right, rcond=1e-8)[0]
    return {"tau": tau - np.einsum("krv,kr->kv", jacobian, forces), "forces": forces}


RECIPE = Recipe(
    Signature(
        "contact_inverse_dynamics",
        348,
        "joint torques and contact forces of a motion: tau = M qdd + h - J^T forces. No motor acts on a floating base: "
        "the forces minimise |b|^2 + mu |forces|^2, where b are the first six entries of tau; if several forces do, they "
        "have the smallest norm. They are zero for contacts that are not active, and without a floating base. The "
        "forces of closed loops make the torques of passive joints zero. Without passive joints, closed loops count as "
        "contacts. active is 0 or 1 for each contact, mu is not negative",
        (Q, QD, QDD, ACTIVE, MU),
        (
            replace(
                TAU,
                means=f"{TAU.means}. If the robot has a floating base, tau[:6] is the force and moment that the base still "
                "needs in addition to the contact forces. It is zero within rounding if mu = 0 and the active contacts can "
                "exert all that the motion needs",
            ),
            replace(FORCES, means=f"first the {FORCES.means}. {OF_LOOPS}"),
        ),
        theta=True,
        summary="Compute the contact forces of a motion, and the joint torques tau = M qdd + h - J^T forces. M is "
        "the mass matrix, h the sum of the Coriolis, centrifugal and gravity torques, and J the Jacobian of the "
        "contacts. No motor acts on a floating base, so tau[:6], its part of tau, should be zero. psdmc chooses the "
        "forces that minimise |tau[:6]|^2 + mu |forces|^2. If several forces give this minimum, psdmc returns "
        "those with the smallest norm. Without a floating base, the contact forces are zero. The forces of closed "
        "loops make the torques of passive joints zero.",
        factorises=(MASK,),
    ),
    "inverse dynamics with contacts",
    trace,
    reference,
    "rnea, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
    closes=True,
)
