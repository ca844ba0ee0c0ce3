"""Functions written without a thought of units, on robots whose traces have a unit of length of their own, against
Pinocchio. SCARA slides, and has metres."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from robots_at_hand import subject

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.kinematics import frame_jacobians, jacobian, link_wrenches, placed_frames
from psdmc.dynamics.momentum_and_energy import kinetic_energy, potential_energy
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.scalar import ZERO, Scalar, dot
from psdmc.dynamics.solve import factorize, solve
from psdmc.functions import RECIPES
from psdmc.functions.inverse_dynamics_with_wrenches import WRENCHES
from psdmc.lower.kernels import lower
from psdmc.lower.search import Search
from psdmc.program.cost import SINGLE
from psdmc.program.interpret import interpret
from psdmc.program.signature import QD, QDD, Q, Quantity, Signature, Sizes
from psdmc.program.slopes import gradients, slopes
from psdmc.recipes.recipe import Ingredients, Outputs, Recipe
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, torques, traced_rows

STIFFNESS = 300.0
"""N/m, of a spring between the base and the tip."""


def mobility(g: Ingredients) -> Outputs:
    """J M^-1 J^T of the tip's linear velocity: acceleration of the tip per unit force on it."""
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices))
    rows = frame_jacobians(g.frames, g.named, g.inputs["q"], g.root)[0][:3]
    columns = [solve(factors, row) for row in rows]
    return {
        "W": [[sum(a * b for a, b in zip(row, column, strict=True)) for column in columns] for row in rows],
        "pivot": factors.pivots,
    }


def pinocchios_mobility(model, data, tip, q, qd=None, qdd=None):
    rows = pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
    return rows @ np.linalg.solve(pin.crba(model, data, q), rows.T)


def held_energy(g: Ingredients) -> Outputs:
    """Energy of gravity and of the spring."""
    ((point, _),) = placed_frames(g.frames, g.named, g.inputs["q"], g.root)
    fallen = potential_energy(g.frames, g.bodies, g.inputs["q"], g.base_acceleration)
    return {"V": fallen + 0.5 * g.si(STIFFNESS, "N/m") * dot(point, point)}


def pinocchios_held_energy(model, data, tip, q, qd=None, qdd=None):
    pin.framesForwardKinematics(model, data, q)
    point = np.array(data.oMf[tip].translation)
    fallen = pin.computePotentialEnergy(model, data, q)
    return (
        fallen - pin.computePotentialEnergy(model, data, pin.neutral(model)) + STIFFNESS / 2 * point @ point
    )


def distance(g: Ingredients) -> Outputs:
    """Squared distance of the tip from the base."""
    ((point, _),) = placed_frames(g.frames, g.named, g.inputs["q"], g.root)
    return {"d": dot(point, point)}


def pinocchios_distance(model, data, tip, q, qd=None, qdd=None):
    pin.framesForwardKinematics(model, data, q)
    return np.sum(np.square(data.oMf[tip].translation))


def links_energy(g: Ingredients) -> Outputs:
    """Kinetic energy of the links' own bodies."""
    still = [0.0] * len(g.frames)
    return {"T": kinetic_energy(g.frames, g.link_bodies(), still, g.inputs["q"], g.inputs["qd"])}


def pinocchios_links_energy(model, data, tip, q, qd=None, qdd=None):
    links = pin.Model(model)
    links.armature = np.zeros(model.nv)
    return pin.computeKineticEnergy(links, links.createData(), q, qd)


def tip_force(g: Ingredients) -> Outputs:
    """Squared length of the tip's Jacobian times the torques."""
    rows = jacobian(g.frames, g.tip_body, g.tip, g.inputs["q"])[:3]
    tau = inverse_dynamics(
        g.frames,
        g.bodies,
        g.drives,
        g.inputs["q"],
        g.inputs["qd"],
        g.inputs["qdd"],
        g.base_acceleration,
        g.choices,
    )
    moved = [sum(a * b for a, b in zip(row, tau, strict=True)) for row in rows]
    return {"f": sum(x * x for x in moved)}


def pinocchios_tip_force(model, data, tip, q, qd=None, qdd=None):
    moved = pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL)[:3] @ pin.rnea(model, data, q, qd, qdd)
    return moved @ moved


def held(g: Ingredients) -> tuple[Scalar, ...]:
    """Torques at rest under a wrench at the tip."""
    wrenches = [g.inputs["wrenches"]]
    return torques(g, g.still, g.still, ZERO, external=link_wrenches(g.named, wrenches))


def by_wrench(g: Ingredients) -> Outputs:
    """Derivatives of the torques' sum by the wrench, in reverse mode."""
    tau = held(g)
    ((*found,),) = gradients(tau, [1.0] * len(tau), [g.inputs["wrenches"]])
    return {"d": found}


def pinocchios_by_wrench(model, data, tip, q, wrench):
    return -pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL).sum(axis=1)


def along_wrench(g: Ingredients) -> Outputs:
    """The derivative of the torques' sum along the wrench, in forward mode."""
    wrench = g.inputs["wrenches"]
    return {"d": sum(slopes(held(g), wrench, wrench))}


def pinocchios_along_wrench(model, data, tip, q, wrench):
    return pinocchios_by_wrench(model, data, tip, q, wrench) @ wrench


def regressed(g: Ingredients) -> Outputs:
    """Torques per base parameter."""
    return {"Y": traced_rows(g, g.inputs["qdd"])}


def pinocchios_regressed(model, data, tip, q, qd=None, qdd=None):
    return pin.rnea(model, data, q, qd, qdd)


CASES: list[
    tuple[Callable[[Ingredients], Outputs], tuple[Quantity, ...], Quantity, Callable[..., object]]
] = [
    (mobility, (Q,), Quantity("W", ("3", "3"), unit="1/kg"), pinocchios_mobility),
    (held_energy, (Q,), Quantity("V", unit="J"), pinocchios_held_energy),
    (distance, (Q,), Quantity("d", unit="m^2"), pinocchios_distance),
    (links_energy, (Q, QD), Quantity("T", unit="J"), pinocchios_links_energy),
    (regressed, (Q, QD, QDD), Quantity("Y", ("nv", "l"), unit="J", powers=(-1, -1)), pinocchios_regressed),
]
TURNING = [
    (tip_force, (Q, QD, QDD), Quantity("f", unit="kg^2 m^6/s^4"), pinocchios_tip_force),
    (by_wrench, (Q, WRENCHES), Quantity("d", ("6",), unit="1", powers=(1,)), pinocchios_by_wrench),
    (along_wrench, (Q, WRENCHES), Quantity("d", unit="J"), pinocchios_along_wrench),
]
"""Sums over joints that all turn: torques and forces are unlike."""


def sizes_of(model) -> Sizes:
    return Sizes.of_chain(model.nq, model.l)


def recipe(trace, inputs, output) -> Recipe:
    """A recipe as a file of psdmc/functions has one, without comparisons."""
    matrices = (MASS_MATRIX,) if trace is mobility else ()
    signature = Signature(trace.__name__, 9999, "", inputs, (output,), theta=True, factorises=matrices)
    return Recipe(signature, "", trace, None, "", None, shares="inverse_dynamics")  # type: ignore[arg-type]


@pytest.mark.parametrize("theta", [False, True])
@pytest.mark.parametrize(
    ("robot", "case"),
    [(robot, case) for robot in ("kr6", "scara") for case in CASES] + [("kr6", case) for case in TURNING],
)
def test_a_function_is_pinocchios_in_si(robot, case, theta, monkeypatch):
    trace, inputs, output, oracle = case
    own, name = recipe(trace, inputs, output), trace.__name__
    monkeypatch.setitem(RECIPES, name, own)
    model, reference, rng = subject(robot).model, subject(robot).pinocchio, np.random.default_rng(5)
    states = {each.name: rng.uniform(-2, 2, (20, sizes_of(model).size(each))) for each in inputs}
    known = {"theta_b": model.theta_b}

    kernel = lower(model, "factored", (name,))[name + "_theta" * theta]
    sizes = own.signature.sizes(sizes_of(model))
    found = interpret(kernel.single, states | known, sizes)[output.name].reshape(
        20, *sizes_of(model).shape(output.axes)
    )
    found = found @ model.theta_b if "l" in output.axes else found

    tip = reference.frame_ids[0]
    expected = reference.each(lambda model, data, *each: oracle(model, data, tip, *each), *states.values())
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


def test_lengths_of_kr6_are_in_a_unit_of_its_own():
    model = subject("kr6").model
    search = Search(model.mechanism, model.representative, model.theta_b)
    assert search.best(RECIPES["inverse_dynamics"], SINGLE).unit != 1.0
