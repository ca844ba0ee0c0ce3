"""Functions that somebody writes without a thought of units: their traces' lengths are in a unit that lowering chooses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from robots_at_hand import subject

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.energy import potential_energy
from psdmc.dynamics.named_frames import frame_jacobians, placed_frames
from psdmc.dynamics.scalar import dot
from psdmc.dynamics.solve import factorize, solve
from psdmc.functions import RECIPES
from psdmc.lower.kernels import lower
from psdmc.program.interpret import interpret
from psdmc.program.signature import Q, Quantity, Signature, Sizes
from psdmc.recipes.accelerations import PIVOTS
from psdmc.recipes.recipe import Ingredients, Outputs, Recipe

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


def held_energy(g: Ingredients) -> Outputs:
    """Energy of gravity and of the spring."""
    ((point, _),) = placed_frames(g.frames, g.named, g.inputs["q"], g.root)
    return {
        "V": potential_energy(g.frames, g.bodies, g.inputs["q"], g.base_acceleration)
        + 0.5 * g.si(STIFFNESS, "N/m") * dot(point, point)
    }


def recipe(trace, output: Quantity, **more) -> Recipe:
    """A recipe as a file of psdmc/functions has one, without comparisons."""
    signature = Signature(trace.__name__, 9999, "", (Q,), (output,), theta=True, **more)
    return Recipe(signature, trace.__name__, trace, None, "", None, shares="inverse_dynamics")  # type: ignore[arg-type]


def values(name: str, robot: str, q: np.ndarray) -> np.ndarray:
    model = subject(robot).model
    kernel = lower(model, "factored", (name,), theta_variants=False)[name]
    signature = RECIPES[name].signature
    sizes = signature.sizes(Sizes.of_chain(model.nq, model.l))
    return interpret(kernel.single, {"q": q}, sizes)[signature.outputs[0].name]


@pytest.mark.parametrize("robot", ["kr6", "scara"])
def test_mobility_of_a_tip_is_pinocchios(robot, monkeypatch):
    own = recipe(mobility, Quantity("W", ("3", "3"), unit="1/kg"), positive=PIVOTS)
    monkeypatch.setitem(RECIPES, "mobility", own)
    reference, q = (
        subject(robot).pinocchio,
        np.random.default_rng(5).uniform(-2, 2, (20, subject(robot).model.nq)),
    )

    def expected(model, data, q):
        jacobian = pin.computeFrameJacobian(model, data, q, reference.frame_ids[0], pin.LOCAL_WORLD_ALIGNED)[
            :3
        ]
        return jacobian @ np.linalg.solve(pin.crba(model, data, q), jacobian.T)

    np.testing.assert_allclose(
        values("mobility", robot, q).reshape(-1, 3, 3), reference.each(expected, q), rtol=1e-9
    )


@pytest.mark.parametrize("robot", ["kr6", "scara"])
def test_energies_of_gravity_and_a_spring_add_up_to_pinocchios(robot, monkeypatch):
    monkeypatch.setitem(RECIPES, "held_energy", recipe(held_energy, Quantity("V", unit="J")))
    reference, q = (
        subject(robot).pinocchio,
        np.random.default_rng(5).uniform(-2, 2, (20, subject(robot).model.nq)),
    )

    def expected(model, data, q):
        pin.framesForwardKinematics(model, data, q)
        point = np.array(data.oMf[reference.frame_ids[0]].translation)
        fallen = pin.computePotentialEnergy(model, data, q)
        return (
            fallen
            - pin.computePotentialEnergy(model, data, pin.neutral(model))
            + STIFFNESS / 2 * point @ point
        )

    np.testing.assert_allclose(values("held_energy", robot, q)[:, 0], reference.each(expected, q), rtol=1e-9)
