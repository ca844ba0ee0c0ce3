"""The check of traces for unlike quantities: psdmc's own functions pass, and mistakes are told with their line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from random_chains import random_chain
from robots_at_hand import subject
from slow_cases import slow_but_for
from wide_robots import SMALL, wide_robot

from psdmc.derivation.derive import derive_model
from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.kinematics import placed_frames
from psdmc.dynamics.scalar import dot
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.lower.dimension_check import HINT, check_dimensions
from psdmc.lower.kernels import lower
from psdmc.lower.search import ALL_CHOICES, Search
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.operations import Op
from psdmc.program.signature import QD, TAU, Q, Quantity, Signature
from psdmc.program.slopes import gradients
from psdmc.recipes.recipe import Ingredients, Outputs, Recipe
from psdmc.recipes.torques_and_accelerations import torques
from psdmc.robot.coordinates import Coordinate

FUNCTIONS = [name for name, recipe in RECIPES.items() if not recipe.packs]
ROBOTS = ("two_link", "scara", "mimic joints", *SMALL)


def model_of(name: str) -> DynamicsModel:
    if name in SMALL:
        return wide_robot(name).model
    if name == "mimic joints":  # of a turn a slide, of a slide a turn
        chain = random_chain(3, "RPPR")
        own = (Coordinate(0), Coordinate(0, 0.3, 0.1), Coordinate(2), Coordinate(2, -0.7, 0.2))
        return derive_model(replace(chain, coordinates=own))
    return subject(name).model


def check(recipe: Recipe, robot: str, choices: Choices = PLAIN) -> None:
    model = model_of(robot)
    search = Search(model.mechanism, model.representative, model.theta_b)
    feet = search.geometry.feet
    check_dimensions(recipe, search.geometry.reframed(feet[0]), search.robot, choices)


@pytest.mark.parametrize("robot", slow_but_for(["scara", "mimic joints", "small"], list(ROBOTS)))
def test_every_function_adds_like_quantities_only(robot):
    for name in FUNCTIONS:
        if RECIPES[name].lack_of_loops(model_of(robot).mechanism) is None:
            check(RECIPES[name], robot)


@pytest.mark.parametrize("choices", [*ALL_CHOICES, Choices(articulated=True)])
def test_so_do_all_arrangements_of_recursions(choices):
    for name in ("inverse_dynamics", "forward_dynamics", "mass_matrix", "inverse_dynamics_derivatives"):
        check(RECIPES[name], "scara", choices)


def function(trace, output: Quantity, *inputs: Quantity) -> Recipe:
    return Recipe(
        Signature("own", 9999, "", inputs or (Q,), (output,), theta=True), "", trace, None, "", None
    )  # type: ignore[arg-type]


def tip(g: Ingredients):
    ((point, _),) = placed_frames(g.frames, g.named, g.inputs["q"], g.root)
    return point


def distance(g: Ingredients) -> Outputs:
    return {"x": dot(tip(g), tip(g)).root()}


def summed(g: Ingredients) -> Outputs:
    return {"x": dot(tip(g), tip(g)) + 0.3}


def hidden_in_torques(g: Ingredients) -> Outputs:
    return {"x": torques(g, g.inputs["q"], g.still, g.base_acceleration)[0]}


def least(g: Ingredients) -> Outputs:
    return {"x": Op.MIN(tip(g)[0], g.inputs["qd"][0])}


def chosen(g: Ingredients) -> Outputs:
    return {"x": Op.SELECT(tip(g)[0], 0.2, tip(g)[1], tip(g)[0])}


def grown(g: Ingredients) -> Outputs:
    return {"x": Op.EXP(tip(g)[0])}


def sloped(g: Ingredients) -> Outputs:
    """A gradient by qd of torques, to which positions are added."""
    tau = torques(g, g.inputs["qd"], g.still, g.base_acceleration)
    (by_qd,) = gradients(tau, [1.0] * len(tau), [g.inputs["qd"]])
    return {"x": by_qd[0] + g.inputs["q"][0]}


def source_line(trace) -> int:
    """The line that a trace returns in."""
    return max(line for _, _, line in trace.__code__.co_lines() if line)


LENGTH = Quantity("x", unit="m")


@pytest.mark.parametrize(
    ("trace", "message"),
    [
        (summed, 'own: sum of m^2 and a number ({}: return {{"x": dot(tip(g), tip(g)) + 0.3}})'),
        (hidden_in_torques, "own: difference of m/s^2 and m ({}: "),
        (least, "own: minimum of 1/s and m ({}: "),
        (chosen, "own: choice of m and a number ({}: "),
        (grown, "own: exp of m ({}: "),
        (sloped, "own: sum of a number and kg m^2/s ({}: "),
    ],
)
def test_unlike_quantities_are_told_with_function_and_line(trace, message):
    with pytest.raises(InputError) as error:
        check(function(trace, LENGTH, Q, QD), "two_link")
    assert error.value.message.startswith(message.format(f"{Path(__file__).name}, line {source_line(trace)}"))
    assert error.value.hint == HINT


def test_constants_have_units_where_they_are_given_one():
    def nearer(g: Ingredients) -> Outputs:
        return {"x": Op.MAX(g.si(0.3, "m"), distance(g)["x"]) - g.si(0.0, "N")}

    check(function(nearer, LENGTH), "two_link")
    with pytest.raises(InputError, match=r"own: x\[0\] is m, its unit in the signature kg m\^2/s\^2"):
        check(function(nearer, Quantity("x", unit="J")), "two_link")


def test_entries_of_joints_that_slide_and_turn_have_each_their_unit():
    """SCARA's third joint slides: its rate is m/s, and its torque a force."""

    def power(g: Ingredients) -> Outputs:
        return {"x": sum(a * b for a, b in zip(g.inputs["tau"], g.inputs["qd"], strict=True))}

    def total(g: Ingredients) -> Outputs:
        return {"x": sum(g.inputs["qd"])}

    check(function(power, Quantity("x", unit="W"), QD, TAU), "scara")
    with pytest.raises(InputError, match=r"own: sum of 1/s and m/s|own: sum of m/s and 1/s"):
        check(function(total, Quantity("x", unit="1/s"), QD), "scara")
    check(function(total, Quantity("x", unit="1/s"), QD), "two_link")


def test_a_quantity_without_unit_is_refused():
    with pytest.raises(InputError, match="own: x has no unit") as error:
        check(function(distance, Quantity("x")), "two_link")
    assert error.value.hint == "give it one in the signature: Quantity('x', ..., unit='m')"


def test_functions_are_checked_before_they_are_lowered(monkeypatch):
    monkeypatch.setitem(RECIPES, "own", function(summed, LENGTH))
    with pytest.raises(InputError, match="own: sum of"):
        lower(subject("two_link").model, functions=("own",))
