"""Forward dynamics with contacts: accelerations and contact forces from torques, for every set of active contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from psdmc.dynamics import closed_loops, constraints
from psdmc.dynamics.arrow import Arrow, Trunk, any_limbs, eliminated_with_forces
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inner_product
from psdmc.functions import contact_drift, contact_jacobian, loop_drift, loop_error, loop_jacobian
from psdmc.program.signature import PIVOTS, QD, QDD, TAU, Q, Quantity, Signature
from psdmc.recipes.contacts import (
    ACTIVE,
    CONTACTS,
    MU,
    Held,
    Rows,
    Solved,
    dense_solution,
    held_on_arrays,
    joined,
)
from psdmc.recipes.directions import along
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, torques
from psdmc.robot.mechanism import Array

KP = Quantity(
    "kp",
    largest=100.0,
    least=0.0,
    means="position gain, 1/s^2, with which contacts return to where they should be (Baumgarte's stabilisation)",
    unit="1/s^2",
    default=0.0,
)
KD = Quantity(
    "kd",
    largest=20.0,
    least=0.0,
    means="velocity gain, 1/s, which damps the motion of the contacts (Baumgarte's stabilisation)",
    unit="1/s",
    default=0.0,
)
ERROR = Quantity(
    "error",
    ("contact_rows",),
    largest=0.01,
    means="displacement of each contact from where it should be, in m and rad along the axes of the base frame",
    unit="1",
    powers=(1,),
    default=0.0,
)
FORCES = Quantity(
    "forces",
    ("constraint_rows",),
    means="forces and moments that the world exerts on the contacts, along the axes of the base frame; zero for "
    "contacts that are not active. A contact point has a force (N). A contact surface has a force, then a moment "
    "(N m) about the contact's origin",
    unit="J",
    powers=(-1,),
)
OF_LOOPS = (
    "Then follow the forces (N) and moments (N m) that keep closed loops closed, if the robot has any. A closed loop "
    "keeps two frames together, and has one entry for each direction of relative motion that it blocks. The entries are "
    "along and about the axes of the loop's first frame"
)


def trace(g: Ingredients) -> Outputs:
    if any_limbs(g.frames):
        return _in_limbs(g)
    found, signs, factors, _ = solved(g)
    return {"qdd": found.motion, "forces": found.forces, PIVOTS: [*factors.pivots, *signs]}


def _in_limbs(g: Ingredients) -> Outputs:
    """Eliminate limb by limb. Signs are negative also where this loses digits."""
    q, trunk = g.inputs["q"], Trunk(g.frames, g.inputs["q"], g.base_axes)
    rows = constraints.contact_jacobian(g.frames, g.named, trunk.q, g.root)
    mass = mass_matrix(g.frames, g.bodies, g.drives, q, g.choices)
    mask, arrow, margins, wanted = of_limbs(g, mass, rows, trunk)
    bias = torques(g, g.inputs["qd"], g.still, g.base_acceleration)
    load = [given - h for given, h in zip(g.inputs["tau"], bias, strict=True)]
    found = arrow.solved([*load, *wanted])
    return {
        "qdd": found[: len(load)],
        "forces": trunk.rows_back([-value for value in found[len(load) :]]),
        PIVOTS: [*arrow.pivots[: len(load)], *mask.signs(margins)],
    }


def of_limbs(
    g: Ingredients, mass: Rows, rows: Rows, trunk: Trunk | None
) -> tuple[Held, Arrow, list[Scalar], list[Scalar]]:
    """Eliminate the mass matrix and the contact Jacobian limb by limb. Return the active contacts, the elimination, a
    number per row of the Jacobian that is positive if the elimination keeps its digits, and the wanted accelerations.

    trunk  the axes along which the Jacobian is; None: those of the base
    """
    qd, error = g.inputs["qd"], g.inputs[ERROR.name]
    (kp,), (kd,) = (g.inputs[each.name] for each in (KP, KD))
    mask = Held.of(g)
    on, shift, one = mask.rows
    arrow, margins = eliminated_with_forces(g.frames, mass, rows, on, shift, one)
    q, errors = (g.inputs["q"], error) if trunk is None else (trunk.q, trunk.rows_along(error))
    drifts = constraints.contact_drift(g.frames, g.named, q, qd, g.root)
    wanted = [
        -each * (own + kd * inner_product(row, qd) + kp * off)
        for each, own, row, off in zip(on, drifts, rows, errors, strict=True)
    ]
    return mask, arrow, margins, wanted


def solved(g: Ingredients) -> Solved:
    """Return the solution with a sign for each contact, the factors of the mass matrix, and the contact Jacobian."""
    q, qd, tau = (g.inputs[name] for name in ("q", "qd", "tau"))
    (kp,), (kd,) = (g.inputs[each.name] for each in (KP, KD))
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, q, g.choices))
    bias = torques(g, qd, g.still, g.base_acceleration)
    rows = constraints.contact_jacobian(g.frames, g.named, q, g.root)
    drifts = constraints.contact_drift(g.frames, g.named, q, qd, g.root)
    errors = list(g.inputs[ERROR.name])
    if g.loops:
        rows += closed_loops.loop_jacobian(g.frames, g.loops, q, g.root)
        drifts += closed_loops.loop_drift(g.frames, g.loops, q, qd, g.root)
        errors += closed_loops.loop_error(g.frames, g.loops, q, g.root)
    wanted = [
        -(own + kd * inner_product(row, qd) + kp * error)
        for own, row, error in zip(drifts, rows, errors, strict=True)
    ]
    load = [given - h for given, h in zip(tau, bias, strict=True)]
    mask = Held.of(g)
    return *mask.solved(factors, rows, load, wanted), factors, rows


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    """Return accelerations, contact forces and pivots for tests, from the given state and the accelerations without
    contacts.

    These accelerations are given, and the torques were computed from them, so they are exact. The change that the
    contacts cause is added.
    """
    free, loops = given["qdd"], robot.chain.loops

    def wanted(jacobian: Array) -> Array:
        own, errors = contact_drift.RECIPE.reference(robot, given)["drift"], given[ERROR.name]
        if loops:
            own = joined(own, loop_drift.RECIPE.reference(robot, given)["drift"])
            errors = joined(errors, loop_error.RECIPE.reference(robot, given)["error"])
        return -_stabilised(given, errors, own, along(jacobian, given["qd"])) - along(jacobian, free)

    change, forces, pivots = held_on_arrays(robot, given, wanted, loops)
    return {"qdd": free + change, "forces": forces, PIVOTS: pivots}


def _stabilised(given: Given, errors: Array, own: Array, velocity: Array) -> Array:
    kp, kd = (np.reshape(given[each.name], (-1, 1)) for each in (KP, KD))
    return np.asarray(own + kd * velocity + kp * errors)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    q, qd = given["q"], given["qd"]
    jacobian = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    own = contact_drift.RECIPE.pinocchio(robot, given)["drift"]
    errors = given[ERROR.name]
    if robot.loops:
        jacobian = joined(jacobian, loop_jacobian.RECIPE.pinocchio(robot, given)["J"])
        own = joined(own, loop_drift.RECIPE.pinocchio(robot, given)["drift"])
        errors = joined(errors, loop_error.RECIPE.pinocchio(robot, given)["error"])
    wanted = -_stabilised(given, errors, own, along(jacobian, qd))
    load = given["tau"] - robot.nonlinear_effects(q, qd)
    qdd, forces = dense_solution(robot, given, jacobian, load, wanted)
    return {"qdd": qdd, "forces": forces}


RECIPE = Recipe(
    Signature(
        "constrained_forward_dynamics",
        340,
        "joint accelerations and contact forces that torques cause: M qdd + h = tau + J^T forces, where "
        "J qdd + dJ/dt qd + kd J qd + kp error + mu forces = 0 for each active contact, and forces = 0 for each other one; "
        "active is 0 or 1 for each contact, mu is not negative",
        (Q, QD, TAU, ACTIVE, MU, KP, KD, ERROR),
        (QDD, replace(FORCES, means=f"first the {FORCES.means}. {OF_LOOPS}")),
        theta=True,
        summary="Compute the joint accelerations and the contact forces that torques cause. By default, active "
        "contacts do not accelerate. If you give kp, kd or mu, active contacts have the acceleration -kp * error - "
        "kd * J qd - mu * forces. J is the Jacobian of the contacts (`contact_jacobian`).",
        factorises=(MASS_MATRIX, CONTACTS),
    ),
    "constrained forward dynamics",
    trace,
    reference,
    "crba, nonLinearEffects, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
    closes=True,
    in_limbs=True,
)
