"""Inverse dynamics with contacts: joint torques and contact forces of a motion, where no motor acts on a floating base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from psdmc.dynamics import contacts
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.free_root import has_free_root
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.functions import contact_jacobian
from psdmc.functions.constrained_forward_dynamics import FORCES
from psdmc.program.factorisation import Structure, SymmetricMatrix
from psdmc.program.operations import Op
from psdmc.program.signature import PIVOTS, QD, QDD, TAU, Q, Signature
from psdmc.recipes import contacts as held
from psdmc.recipes.contacts import ACTIVE, Held, active_rows
from psdmc.recipes.least_squares import least_squares
from psdmc.recipes.on_arrays import RobotOnArrays, columns
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.recipes.torques import torques
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

BASE_ROWS = 6
"""Rows of tau that belong to a floating base: three forces, then three moments about its origin."""

LINEAR = 3

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
    error="contact {contacts!r}: active is not 0 or 1, or mu = {mu:g} is negative",
    hint="give active 0 or 1 for each contact, and mu = 0 or more",
)

Rows = Sequence[Sequence[Scalar]]


def trace(g: Ingredients) -> Outputs:
    without = torques(g, g.inputs["qd"], g.inputs["qdd"], g.base_acceleration)
    rows = contacts.contact_jacobian(g.frames, g.named, g.inputs["q"], g.root)
    return _values(g.frames, without, rows, Held.of(g))


def _values(frames: Sequence[Frame], without: Sequence[Scalar], jacobian: Rows, mask: Held) -> Outputs:
    forces = _forces(without, jacobian, mask) if has_free_root(frames) else [0.0] * len(jacobian)
    turned = zip(*jacobian, strict=True)
    tau = [own - inner_product(column, forces) for own, column in zip(without, turned, strict=True)]
    # NaN is no mu: all comparisons with it are false.
    signs = [Op.SELECT(-1.0, mask.mu, sign, -1.0) for sign in mask.allowed()]
    return {TAU.name: tau, FORCES.name: forces, PIVOTS: signs}


def _forces(without: Sequence[Scalar], jacobian: Rows, mask: Held) -> list[Scalar]:
    """Return the forces f that minimise |tau - J^T f|^2 + mu |f|^2, with the base's rows of tau and of J^T.

    A moment is treated as the force that has this moment at a distance of 1 m, so all terms are forces in newtons.
    """
    metre, per_metre = mask.si(1.0, "m"), mask.si(1.0, "1/m")
    active, angular = mask.rows[0], [k >= LINEAR for count in mask.counts for k in range(count)]
    rows, right = [], []
    for j in range(BASE_ROWS):
        column = [on * own[j] for on, own in zip(active, jacobian, strict=True)]
        if j < LINEAR:  # a moment at a contact has no force on the base
            rows.append([0.0 if turns else x for turns, x in zip(angular, column, strict=True)])
            right.append(without[j])
        else:
            rows.append([x if turns else x * per_metre for turns, x in zip(angular, column, strict=True)])
            right.append(without[j] * per_metre)
    found = least_squares(rows, right, mask.mu)
    return [x * metre if turns else x for turns, x in zip(angular, found, strict=True)]


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    q, qd, qdd = (given[name] for name in ("q", "qd", "qdd"))
    without = list(robot.torques(q, qd, qdd, robot.base_acceleration).T)
    rows = contacts.contact_jacobian(robot.frames, robot.chain.frames, list(q.T))
    mask = Held.on_arrays(robot, given)
    found = _values(robot.frames, without, rows, mask)
    return {name: columns(values, len(q)) for name, values in found.items()}


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    tau = robot.inverse_dynamics(given["q"], given["qd"], given["qdd"])
    jacobian = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    masks = active_rows(robot, given)
    forces = np.zeros(masks.shape)
    if robot.model.joints[1].shortname() == "JointModelFreeFlyer":
        for k, (own, on, mu) in enumerate(zip(jacobian, masks, np.reshape(given[MU.name], -1), strict=True)):
            base = own[on, :BASE_ROWS].T
            whole = np.vstack([base, np.sqrt(mu) * np.eye(on.sum())])
            right = np.append(tau[k, :BASE_ROWS], np.zeros(on.sum()))
            forces[k, on] = np.linalg.lstsq(whole, right, rcond=1e-8)[0]
    return {"tau": tau - np.einsum("krv,kr->kv", jacobian, forces), "forces": forces}


RECIPE = Recipe(
    Signature(
        "contact_inverse_dynamics",
        348,
        "joint torques and contact forces of a motion: tau = M qdd + h - J^T forces. No motor acts on a floating base: "
        "the forces minimise |b|^2 + mu |forces|^2, where b are the first six entries of tau; if several forces do, they "
        "have the smallest norm. They are zero for contacts that are not active, and without a floating base. active "
        "is 0 or 1 for each contact, mu is not negative",
        (Q, QD, QDD, ACTIVE, MU),
        (
            replace(
                TAU,
                means=f"{TAU.means}. If the robot has a floating base, tau[:6] is the force and moment that the base still "
                "needs in addition to the contact forces. It is zero within rounding if mu = 0 and the active contacts can "
                "exert all that the motion needs",
            ),
            FORCES,
        ),
        theta=True,
        summary="Compute the contact forces of a motion, and the joint torques tau = M qdd + h - J^T forces. M is "
        "the mass matrix, h the sum of the Coriolis, centrifugal and gravity torques, and J the Jacobian of the "
        "contacts. No motor acts on a floating base, so tau[:6], its part of tau, should be zero. psdmc chooses the "
        "forces that minimise |tau[:6]|^2 + mu |forces|^2. If several forces give this minimum, psdmc returns "
        "those with the smallest norm. Without a floating base, the forces are zero.",
        factorises=(MASK,),
    ),
    "inverse dynamics with contacts",
    trace,
    reference,
    "rnea, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
)
