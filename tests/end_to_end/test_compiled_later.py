"""psdmc.compile without a list of functions: those beyond the default set are compiled when they are first called."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model
from robots_at_hand import subject
from unoptimised import without_optimisation

import psdmc
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.toolchain.call import CompiledRobot


@pytest.fixture(scope="module", autouse=True)
def unoptimised() -> Iterator[None]:
    """Which function is compiled when, not what a compiler makes of it."""
    with without_optimisation():
        yield


@pytest.fixture(scope="module")
def robot() -> CompiledRobot:
    return psdmc.compile(bundled_model("two_link"))


def test_a_function_beyond_the_default_set_is_compiled_when_it_is_called(robot: CompiledRobot) -> None:
    pinocchio = subject("two_link").pinocchio
    q, qd, qdd = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 20, 2))
    given = {"q": q, "qd": qd, "qdd": qdd}
    recipe = RECIPES["inverse_dynamics_derivatives"]

    found = robot.inverse_dynamics_derivatives(q, qd, qdd)

    for name, expected in recipe.pinocchio(pinocchio, given).items():
        assert np.abs(getattr(found, name) - expected).max() < 1e-12 * np.abs(expected).max()


def test_with_parameters_too(robot: CompiledRobot) -> None:
    model = bundled_model("two_link")
    q, qd = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 20, 2))
    again = psdmc.compile(model).kinetic_energy(q, qd, theta_b=2.0 * np.asarray(model.theta_b))
    assert np.allclose(again, 2.0 * robot.kinetic_energy(q, qd), rtol=1e-13)


def test_a_list_of_functions_is_all_there_is() -> None:
    robot = psdmc.compile(bundled_model("two_link"), functions=["gravity"])
    with pytest.raises(InputError, match="kinetic_energy was not compiled"):
        robot.kinetic_energy(np.zeros(2), np.zeros(2))


def test_what_a_model_cannot_have_is_said() -> None:
    """Baked parameters of a model whose own are unknown."""
    known = bundled_model("two_link")
    robot = psdmc.compile(unknown(known))
    with pytest.raises(InputError, match="kinetic_energy wants parameters"):
        robot.kinetic_energy(np.zeros(2), np.zeros(2))
    assert robot.kinetic_energy(np.zeros(2), np.ones(2), theta_b=known.theta_b) > 0.0


def unknown(model: DynamicsModel) -> DynamicsModel:
    return replace(model, theta_b=None)
