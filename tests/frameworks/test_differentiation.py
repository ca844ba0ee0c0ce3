"""Rules by which array frameworks differentiate functions, on NumPy arrays, against Pinocchio's slopes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from differentiated import RULED, WEIGHED, Array, differentiated, near, pulled
from slow_cases import slow_but_for
from unoptimised import without_optimisation

import psdmc
from psdmc.frameworks.coordinates import Coordinates
from psdmc.frameworks.differentiation import ArgumentError, require_rule
from psdmc.functions import SIGNATURES
from psdmc.toolchain.call import CompiledRobot

EXACT, SOLVED = 1e-10, 1e-8
"""Of each output's largest entry; SOLVED where the mass matrix is inverted."""

INVERTING = {
    "forward_dynamics",
    "forward_dynamics_with_wrenches",
    "constrained_forward_dynamics",
    "impulse",
    "mass_matrix_inverse",
    "semi_implicit_euler",
    "constrained_semi_implicit_euler",
    "rk4_step",
}
COUNT = 4
BY_THETA = ("inverse_dynamics", "forward_dynamics", "mass_matrix", "kinetic_energy")
BY_THETA += ("inverse_dynamics_with_wrenches", "forward_dynamics_with_wrenches")
BY_THETA += ("constrained_forward_dynamics", "impulse")
QUICK = [("hopper", name) for name in RULED if name != "rk4_step"]


class OnNumpy:
    """NumPy as rules see it."""

    arrays: Any = np

    def __init__(
        self, robot: CompiledRobot[Any], theta_b: Array | None = None, gravity: Array | None = None
    ) -> None:
        self.robot, self.theta_b, self.gravity = robot, theta_b, gravity

    def under(self, gravity: Array) -> OnNumpy:
        return OnNumpy(self.robot, self.theta_b, gravity)

    def call(self, function: str, *inputs: Array) -> tuple[Array, ...]:
        signature = SIGNATURES[function]
        gravity = self.gravity if signature.depends_on_gravity else None
        found = self.robot.call(signature, inputs, self.theta_b if signature.theta else None, None, gravity)
        return (found,) if len(signature.outputs) == 1 else tuple(found)


def compiled(name: str) -> OnNumpy:
    own = differentiated(name)
    return OnNumpy(psdmc.compile(own.model), own.model.theta_b)


@pytest.mark.parametrize(
    ("robot", "name"), slow_but_for(QUICK, [(r, f) for r in ("scara", "hopper") for f in RULED], spread=True)
)
def test_slopes_are_pinocchios_and_gradients_their_transpose(robot: str, name: str) -> None:
    own, function, rule = differentiated(robot), SIGNATURES[name], require_rule(name)
    inputs, ways = own.drawn(function, COUNT)
    with without_optimisation():
        along = rule.along(on := compiled(robot), tuple(inputs), tuple(ways), None)
        weights = tuple(np.random.default_rng(1).normal(size=each.shape) for each in along)
        back, _ = rule.back(on, tuple(inputs), weights, False)

    for found, expected in zip(along, own.slopes(function, inputs, ways), strict=True):
        assert near(found, expected, SOLVED if name in INVERTING else EXACT)
    forward = by_state(zip(along, weights, strict=True))
    assert near(
        by_state((g, way) for g, way in zip(back, ways, strict=True) if g is not None), forward, 1e-12
    )


def by_state(pairs: Any) -> Array:
    """The sum of products of entries, state by state."""
    return sum((a * b).reshape(COUNT, -1).sum(1) for a, b in pairs)


@pytest.mark.parametrize("name", BY_THETA)
def test_slopes_by_theta_b(name: str) -> None:
    """Of the function itself, by central differences, along a random direction."""
    own, function, rule = differentiated("hopper"), SIGNATURES[name], require_rule(name)
    inputs, ways = own.drawn(function, COUNT)
    theta, still = np.asarray(own.model.theta_b), tuple(0.0 * way for way in ways)
    way = theta * np.random.default_rng(2).uniform(-1.0, 1.0, theta.shape)
    with without_optimisation():
        on = compiled("hopper")
        along = rule.along(on, tuple(inputs), still, way)
        weights = tuple(np.random.default_rng(1).normal(size=each.shape) for each in along)
        _, gradient = rule.back(on, tuple(inputs), weights, True)
        ahead, behind = (
            OnNumpy(on.robot, theta + sign * 1e-5 * way).call(name, *inputs) for sign in (1.0, -1.0)
        )

    for found, values in zip(along, zip(ahead, behind, strict=True), strict=True):
        assert near(found, (values[0] - values[1]) / 2e-5, 1e-7)
    assert near(gradient @ way, by_state(zip(along, weights, strict=True)), 1e-12)


PULL, WAY = np.array([1.0, -3.0, -8.0]), np.array([4.0, 2.0, -3.0])
"""A gravity, and a direction in which it changes, m/s^2."""


@pytest.mark.parametrize("name", slow_but_for([n for n in WEIGHED if "step" not in n], WEIGHED))
def test_slopes_by_gravity(name: str) -> None:
    """Against the difference of Pinocchio's results under two gravities, which are linear in gravity. By the other inputs,
    against the slopes under the gravity given."""
    own, function, rule = differentiated("hopper"), SIGNATURES[name], require_rule(name, gravity=True)
    inputs, ways = own.drawn(function, COUNT)
    share = 1e-3 if "euler" in name else 1.0  # orientations after a step are not linear
    weighed, ahead, behind = (
        replace(own, pinocchio=pulled("hopper", PULL + k * share * WAY)) for k in (0.0, 1.0, -1.0)
    )
    expected = weighed.slopes(function, inputs, ways)
    is_constant = "gravity" in rule.constant
    assert is_constant == ("rk4" in name)
    for k, output in enumerate(function.outputs if not is_constant else ()):
        there, back = (each.values(function, inputs)[output.name] for each in (ahead, behind))
        moved = own.between(back, there) if output.axes == ("nq",) else there - back
        expected[k] = expected[k] + moved / (2.0 * share)
    each_way = np.tile(WAY, (COUNT, 1))
    with without_optimisation():
        on = OnNumpy(psdmc.compile(own.model, gravity_input=True), own.model.theta_b)
        along = rule.along(on, (*inputs, PULL), (*ways, each_way), None)
        weights = tuple(np.random.default_rng(1).normal(size=each.shape) for each in along)
        gradients, _ = rule.back(on, (*inputs, PULL), weights, False)

    for found, slope in zip(along, expected, strict=True):
        assert near(found, slope, SOLVED if name in INVERTING else EXACT)
    forward = by_state(zip(along, weights, strict=True))
    pairs = zip(gradients, (*ways, each_way), strict=True)
    assert near(by_state((g, way) for g, way in pairs if g is not None), forward, 1e-12)


def test_maps_between_entries_of_q_and_the_tangent() -> None:
    """Against Pinocchio's integrate, and each map against its transpose."""
    own = differentiated("hopper")
    on = Coordinates.of(own.model.mechanism, np)
    rng = np.random.default_rng(4)
    raw, moved, weights = rng.normal(size=(3, COUNT, own.sizes.nq))
    v, gradient = rng.normal(size=(2, COUNT, own.sizes.nv))
    q = own.pinocchio.restored(raw)

    assert near(on.normalized(raw), q, 1e-14)
    assert near(on.rates(q, v), own.pinocchio.coordinate_rates(q, v), 1e-10)
    assert near(on.tangent(q, on.rates(q, v)), v, 1e-13)
    along = np.zeros_like(raw)
    along[:, 3:7] = raw[:, 3:7]
    assert np.abs(on.tangent(raw, along)).max() < 1e-13  # a quaternion's length moves nothing
    assert near(
        (on.gradient(raw, gradient) * moved).sum(-1), (on.tangent(raw, moved) * gradient).sum(-1), 1e-12
    )
    assert near((on.pulled_back(q, weights) * v).sum(-1), (on.rates(q, v) * weights).sum(-1), 1e-12)
    assert near(on.integrated(q, v), own.pinocchio.integrated(q, v), 1e-12)
    assert near(on.difference(q, q[::-1]), own.between(q, q[::-1]), 1e-12)


def test_what_cannot_be_differentiated_is_named() -> None:
    with pytest.raises(ArgumentError, match=r"^regressor has no derivatives") as caught:
        require_rule("regressor")
    assert "inverse_dynamics" in caught.value.hint
