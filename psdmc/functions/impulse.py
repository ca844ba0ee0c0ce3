"""Impacts: joint rates and contact impulses after contacts touch the world (Featherstone 2008, section 11.7)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from psdmc.dynamics import closed_loops, constraints
from psdmc.dynamics.arrow import Arrow, Trunk, any_limbs, eliminated_with_forces
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inner_product
from psdmc.functions import contact_jacobian, loop_jacobian
from psdmc.program.operations import Op
from psdmc.program.signature import PIVOTS, QD, Q, Quantity, Signature
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
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX
from psdmc.robot.mechanism import Array

BEFORE = replace(QD, name="qd_before", means="joint rates before the impact, rad/s or m/s")
AFTER = replace(QD, name="qd_after", means="joint rates after the impact, rad/s or m/s")
RESTITUTION = Quantity(
    "restitution",
    largest=1.0,
    least=0.0,
    means="coefficient of restitution, 0 to 1. If mu = 0, the velocity of active contacts after the impact is "
    "-restitution times that before",
    unit="1",
    default=0.0,
    allowed=(0.0, 1.0),
)
IMPULSES = Quantity(
    "impulses",
    ("constraint_rows",),
    means="impulses that the world exerts on the contacts, along the axes of the base frame; zero for contacts "
    "that are not active. A contact point has a linear impulse (N s). A contact surface has a linear and then an "
    "angular impulse (N m s) about the contact's origin",
    unit="J s",
    powers=(-1,),
)

OF_LOOPS = (
    "Then follow the impulses (N s, N m s) that keep closed loops closed, if the robot has any. A closed loop keeps two "
    "frames together, and has one entry for each direction of relative motion that it blocks. The entries are along and "
    "about the axes of the loop's first frame"
)

TOUCHING = replace(CONTACTS, failure=f"restitution is not from 0 to 1\n{CONTACTS.failure}")


def trace(g: Ingredients) -> Outputs:
    if any_limbs(g.frames):
        trunk = Trunk(g.frames, g.inputs["q"], g.base_axes)
        rows = constraints.contact_jacobian(g.frames, g.named, trunk.q, g.root)
        mass = mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices)
        change, impulses, pivots, _ = of_limbs(g, mass, rows)
        after = [rate + each for rate, each in zip(g.inputs[BEFORE.name], change, strict=True)]
        return {"qd_after": after, "impulses": trunk.rows_back(impulses), PIVOTS: pivots}
    found, signs, factors, _ = solved_after(g)
    return {"qd_after": found.motion, "impulses": found.forces, PIVOTS: [*factors.pivots, *signs]}


def of_limbs(
    g: Ingredients, mass: Rows, rows: Rows
) -> tuple[list[Scalar], list[Scalar], list[Scalar], Arrow]:
    """Return the change of the rates, the impulses, the pivots and signs, and the elimination limb by limb. Given are the
    mass matrix and the contact Jacobian."""
    (restitution,) = g.inputs[RESTITUTION.name]
    mask, count = Held.of(g), len(g.still)
    on, shift, one = mask.rows
    arrow, margins = eliminated_with_forces(g.frames, mass, rows, on, shift, one)
    before = g.inputs[BEFORE.name]
    wanted = [
        -each * (1.0 + restitution) * inner_product(row, before) for each, row in zip(on, rows, strict=True)
    ]
    found = arrow.solved([*g.still, *wanted])
    signs = [_within(restitution, sign) for sign in mask.signs(margins)]
    return found[:count], [-value for value in found[count:]], [*arrow.pivots[:count], *signs], arrow


def solved_after(g: Ingredients) -> Solved:
    """Return what `solved` returns, with the rates after the impact in the place of their change. If restitution is not
    from 0 to 1, the sign of each contact is -1."""
    (restitution,) = g.inputs[RESTITUTION.name]
    found, signs, factors, rows = solved(g)
    after = [rate + change for rate, change in zip(g.inputs[BEFORE.name], found.motion, strict=True)]
    return found._replace(motion=after), [_within(restitution, sign) for sign in signs], factors, rows


def solved(g: Ingredients) -> Solved:
    """Return the change of the rates and the impulses with a sign for each contact, the factors of the mass matrix, and
    the contact Jacobian."""
    q, before = g.inputs["q"], g.inputs[BEFORE.name]
    (restitution,) = g.inputs[RESTITUTION.name]
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, q, g.choices))
    rows = constraints.contact_jacobian(g.frames, g.named, q, g.root)
    wanted = [-(1.0 + restitution) * inner_product(row, before) for row in rows]
    if g.loops:
        own = closed_loops.loop_jacobian(g.frames, g.loops, q, g.root)
        wanted += [-inner_product(row, before) for row in own]
        rows += own
    return *Held.of(g).solved(factors, rows, g.still, wanted), factors, rows


def _within(restitution: Any, sign: Any) -> Any:
    """The sign, -1 unless restitution is from 0 to 1."""
    return Op.SELECT(restitution, 0.0, -1.0, Op.SELECT(1.0, restitution, -1.0, sign))


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    before, loops = given[BEFORE.name], robot.chain.loops
    restitution = np.reshape(given[RESTITUTION.name], (-1, 1))
    rows = sum(robot.chain.rows_of_contacts)

    def wanted(jacobian: Array) -> Array:
        rebound = 1.0 + restitution * (np.arange(jacobian.shape[1]) < rows)  # loops do not rebound
        return np.asarray(-rebound * along(jacobian, before))

    change, impulses, pivots = held_on_arrays(robot, given, wanted, loops)
    pivots[:, robot.nv :] = _within(restitution, pivots[:, robot.nv :])
    return {"qd_after": before + change, "impulses": impulses, PIVOTS: pivots}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    before, restitution = given[BEFORE.name], np.reshape(given[RESTITUTION.name], (-1, 1))
    jacobian = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    wanted = -(1.0 + restitution) * along(jacobian, before)
    if robot.loops:
        own = loop_jacobian.RECIPE.pinocchio(robot, given)["J"]
        jacobian, wanted = joined(jacobian, own), joined(wanted, -along(own, before))
    change, impulses = dense_solution(robot, given, jacobian, np.zeros_like(before), wanted)
    return {"qd_after": before + change, "impulses": impulses}


RECIPE = Recipe(
    Signature(
        "impulse",
        350,
        "joint rates and contact impulses of an impact: M (qd_after - qd_before) = J^T impulses, where "
        "J qd_after + restitution J qd_before + mu impulses = 0 for each active contact, and impulses = 0 for each other "
        "one; active is 0 or 1 for each contact, mu is not negative",
        (Q, BEFORE, ACTIVE, RESTITUTION, MU),
        (AFTER, replace(IMPULSES, means=f"first the {IMPULSES.means}. {OF_LOOPS}")),
        theta=True,
        summary="Compute qd_after, the joint rates after an impact, and the contact impulses. The impulses stop "
        "the active contacts or reverse their velocity.",
        factorises=(MASS_MATRIX, TOUCHING),
    ),
    "impulses of an impact",
    trace,
    reference,
    "crba, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
    matters=("fold_double_angle",),
    in_limbs=True,
    closes=True,
)
