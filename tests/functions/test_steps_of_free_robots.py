"""Steps of integrators where q is no vector: against Pinocchio, and what ten seconds of free flight conserve."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from against_pinocchio import WHOLE
from complex_step import slopes_along
from lowered import lowered
from slow_cases import slow_but_for
from unoptimised import without_optimisation
from urdf_text import inertial, joint, link, urdf
from wide_robots import KINDS, is_pinocchios, wide_robot

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot_text
from psdmc.toolchain.call import CompiledRobot

SATELLITE = urdf(
    link("bus", inertial(12, "0.05 0 0.02", "0 0 0", "0.9 0.7 1.1")),
    link("panel", inertial(2, "0 0.6 0", "0 0 0", "0.25 0.02 0.26")),
    link("flap", inertial(1, "0 0.4 0.1", "0 0 0", "0.06 0.01 0.06")),
    link("boom", inertial(1.5, "0.5 0 0", "0 0 0", "0.01 0.14 0.14")),
    joint("wing", "bus", "panel", xyz="0 0.5 0", axis="0 1 0"),
    joint("fold", "panel", "flap", xyz="0 1.2 0", axis="1 0 0"),
    joint("ball", "bus", "boom", kind="floating", xyz="0.5 0 0"),
    name="satellite",
)
"""A body with a panel of two parts, and a loose boom that flies beside it."""

SECONDS = 10.0
COUNT = 8


STEPS = [(function, name) for function in ("semi_implicit_euler", "rk4_step") for name in ("small", "hand")]
QUICK = [("semi_implicit_euler", "small"), ("rk4_step", "hand")]


@pytest.mark.parametrize(("function", "name"), slow_but_for(QUICK, STEPS, spread=True))
def test_a_step_is_pinocchios(function: str, name: str) -> None:
    """Random trees' mass matrices are conditioned badly: relative to the accelerations' largest entry."""
    is_pinocchios(function, name, exact=1e-9, in_c=False)


@pytest.mark.parametrize("name", ["two", "hand", *(["small", "free"] if WHOLE else [])])
def test_the_steps_jacobians_are_pinocchios(name: str) -> None:
    """Chained from computeABADerivatives and dIntegrate. The C is a straight line (two) or calls and loops."""
    is_pinocchios("semi_implicit_euler_derivatives", name, exact=1e-9)


CALLING = ("semi_implicit_euler_derivatives", "forward_dynamics_with_wrenches_derivatives")


@pytest.mark.parametrize("function", CALLING)
def test_what_calls_forward_dynamics_says_that_the_mass_matrix_is_not_positive(function: str) -> None:
    """With the bodies' signs reversed no result is a number, in batches and for one state; with them it is Pinocchio's."""
    own, recipe = wide_robot("hand"), RECIPES[function]
    robot, theta_b = own.compiled(function), np.asarray(own.model.theta_b)
    states = [own.given[quantity.name] for quantity in recipe.signature.inputs]
    found = robot.call(recipe.signature, states, theta_b)
    for name, expected in recipe.pinocchio(own.pinocchio, own.given).items():
        error = np.abs(getattr(found, name) - expected).max() / np.abs(expected).max()
        assert error < 1e-9
    for spoilt in (
        robot.call(recipe.signature, states, -theta_b),
        robot.call(recipe.signature, [array[3] for array in states], -theta_b),
    ):
        assert all(np.isnan(array).all() for array in spoilt)


JACOBIANS = [
    ("semi_implicit_euler", "small"),
    ("semi_implicit_euler", "hand"),
    ("constrained_semi_implicit_euler", "small"),
    ("constrained_semi_implicit_euler", "hand"),
    ("rk4_step", "two"),
    ("rk4_step", "pair"),
]


@pytest.mark.parametrize(("function", "name"), JACOBIANS)
def test_a_steps_jacobians_are_its_slopes_along_the_tangents(function: str, name: str) -> None:
    """By complex steps, which have no error but rounding. What amplifies rounding is a solve with M: on both sides nv eps
    times M's condition number, of each column's largest entry (Higham, Accuracy and Stability, 10.1)."""
    own = wide_robot(name)
    recipe, nv, nq = RECIPES[f"{function}_derivatives"], own.model.nv, own.model.nq
    blocks = [
        name for name in ("A", "B", "B_error") if name in {each.name for each in recipe.signature.outputs}
    ]
    given = {quantity.name: own.given[quantity.name] for quantity in recipe.signature.inputs}
    given["qdd"] = own.arrays.accelerations(given["q"], given["qd"], given["tau"])
    found = recipe.reference(own.arrays, given)
    whole = np.concatenate([found[name] for name in blocks], axis=-1)
    width = whole.shape[-1]

    def rates_of_coordinates(q: np.ndarray) -> np.ndarray:
        units = (np.broadcast_to(unit, (len(q), nv)) for unit in np.eye(nv))
        return np.stack([own.pinocchio.coordinate_rates(q, unit) for unit in units], axis=-1)

    _, by_qd, by_tau, by_error = np.split(np.eye(width), [nv, 2 * nv, 3 * nv])
    by_q = rates_of_coordinates(given["q"]) @ np.eye(nv, width)
    ways = {"q": by_q, "qd": by_qd[None], "tau": by_tau[None]} | (
        {"error": by_error[None]} if len(by_error) else {}
    )
    inputs = [quantity.name for quantity in recipe.signature.inputs]
    point = {name: given[name].reshape(len(given["q"]), -1) for name in inputs}
    step = lowered(own.model, functions=[function])[function].single
    q_next, of_coordinates = slopes_along(step, point, ways, "q_next", nq)
    _, of_rates = slopes_along(step, point, ways, "qd_next", nv)
    of_tangents = np.linalg.pinv(rates_of_coordinates(q_next)) @ of_coordinates
    slopes = np.concatenate([of_tangents, of_rates], axis=1)

    condition = np.linalg.cond(mass := own.arrays.mass_matrix(given["q"])).max()
    if len(by_error):
        rows = RECIPES["contact_jacobian"].reference(own.arrays, given)["J"]
        condition *= np.linalg.cond(
            rows @ np.linalg.inv(mass) @ rows.swapaxes(1, 2) + 0.1 * np.eye(len(by_error))
        ).max()
    largest = np.abs(slopes).max(axis=(0, 1))
    error = (np.abs(whole - slopes) / largest).max()
    assert error < nv * np.finfo(float).eps * condition


@pytest.mark.parametrize("name", ["pair", *(["two", "hand"] if WHOLE else [])])
def test_a_runge_kutta_steps_jacobians_are_made_of_pinocchios(name: str) -> None:
    is_pinocchios("rk4_step_derivatives", name, exact=1e-9)


@pytest.mark.parametrize("name", KINDS)
def test_derivatives_of_frames_velocities_are_pinocchios(name: str) -> None:
    is_pinocchios("frame_velocity_derivatives", name, exact=1e-11, in_c=name == "free")


def test_along_the_motion_they_are_the_drift() -> None:
    """d (J qd) / d q qd is how fast J qd changes while the rates stay: the acceleration that `jacobian_dot_qd` says."""
    own = wide_robot("free")
    slopes = RECIPES["frame_velocity_derivatives"].reference(own.arrays, own.given)["dv_dq"]
    drift = RECIPES["jacobian_dot_qd"].reference(own.arrays, own.given)["drift"]
    found = (slopes @ own.given["qd"][:, None, :, None])[..., 0]
    np.testing.assert_allclose(found, drift, atol=1e-12 * np.abs(drift).max())


@cache
def satellite() -> tuple[DynamicsModel, CompiledRobot]:
    loaded = load_robot_text(SATELLITE, "urdf", floating=True, gravity=(0.0, 0.0, 0.0))
    model = derive_model(loaded.mechanism, expand=False)
    functions = [
        "rk4_step",
        "semi_implicit_euler",
        "kinetic_energy",
        "momentum",
        "neutral",
        "integrate",
        "difference",
    ]
    with without_optimisation():
        return model, psdmc.compile(model, functions=functions)


def start() -> tuple[np.ndarray, np.ndarray]:
    """Tumbling at up to 1 rad/s while its panels swing."""
    model, robot = satellite()
    rng = np.random.default_rng(8)
    q = np.tile(robot.neutral(), (COUNT, 1))
    return robot.integrate(q, rng.uniform(-1, 1, (COUNT, model.nv))), rng.uniform(-1, 1, (COUNT, model.nv))


def flown(step: str, dt: float, seconds: float = SECONDS) -> tuple[np.ndarray, np.ndarray]:
    """So long without torques, by emitted C."""
    _, robot = satellite()
    (q, qd), take = start(), getattr(robot, step)
    for _ in range(round(seconds / dt)):
        q, qd = take(q, qd, 0.0 * qd, dt)
    return q, qd


def drift(step: str, dt: float) -> tuple[float, float]:
    """Largest changes of momentum, about the world's origin, and of energy, relative to their sizes at the start."""
    _, robot = satellite()
    (q, qd), (q1, qd1) = start(), flown(step, dt)
    momentum, energy = robot.momentum(q, qd), robot.kinetic_energy(q, qd)
    lost = np.abs(robot.momentum(q1, qd1) - momentum).max() / np.abs(momentum).max()
    return float(lost), float((np.abs(robot.kinetic_energy(q1, qd1) - energy) / energy).max())


@pytest.mark.slow
def test_ten_seconds_of_free_flight_conserve_momentum_and_energy() -> None:
    lost, changed = drift("rk4_step", 2e-3)
    assert lost < 1e-10
    assert changed < 1e-10


def test_the_step_is_of_fourth_order() -> None:
    """A step of half the length leaves a sixteenth of the change, of momentum and of energy."""
    coarse, fine = drift("rk4_step", 0.02), drift("rk4_step", 0.01)
    for one, other in zip(coarse, fine, strict=True):
        assert 10.0 < one / other < 40.0


def test_both_methods_come_to_the_same_place() -> None:
    """Positions of both methods meet as steps shrink: of first order, against the fourth's."""
    _, robot = satellite()
    exact, _ = flown("rk4_step", 2e-3, 1.0)
    errors = [
        np.abs(robot.difference(exact, flown("semi_implicit_euler", dt, 1.0)[0])).max() for dt in (2e-3, 1e-3)
    ]
    assert 1.8 < errors[0] / errors[1] < 2.2


def test_quaternions_stay_on_their_sphere() -> None:
    for step in ("rk4_step", "semi_implicit_euler"):
        q, _ = flown(step, 0.01)
        np.testing.assert_allclose(np.linalg.norm(q[:, 3:7], axis=1), 1.0, rtol=0.0, atol=4e-16)
