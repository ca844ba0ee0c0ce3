"""Inverse dynamics with contacts against dense least squares of Pinocchio's numbers, in closed form, and as the inverse of
forward dynamics with contacts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import EVERY, matches_pinocchio
from contact_trees import BRICK, ContactTree, brick, contact_tree, floating_gripper
from direct import Direct
from loop_trees import four_bar_legs
from slow_cases import slow_but_for
from unoptimised import compiled

from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.errors import InputError
from psdmc.functions import SIGNATURES
from psdmc.lower.kernels import lower
from psdmc.recipes.singular_matrices import least_squares

NAME = "contact_inverse_dynamics"
ROUNDING = {"float64": 2.2e-16, "float32": 1.2e-7}
Array = np.ndarray


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_robots_on_a_fixed_base_have_no_forces(robot: str, real: str) -> None:
    matches_pinocchio(NAME, robot, real)


def worst_condition(own: ContactTree) -> float:
    """The largest ratio of the singular values of the base's rows of J^T on active contacts, without those that are zero."""
    rows = own.robot.contact_jacobian(own.given["q"])[..., :6]
    on = np.repeat(own.given["active"], own.loaded.mechanism.rows_of_contacts, axis=1)
    values = np.linalg.svd(on[..., None] * rows, compute_uv=False)
    values = values[values[:, 0] > 0.0]
    least = np.where(values > 1e-8 * values[:, :1], values, np.inf).min(axis=1)
    return float((values[:, 0] / least).max())


CASES = slow_but_for(
    [(0, "float64")], [(0, "float64"), (1, "float64"), (2, "float64"), (0, "float32")], spread=True
)


@pytest.mark.parametrize(("seed", "real"), CASES)
def test_trees_with_every_mask_have_the_least_squares_solution(seed: int, real: str) -> None:
    """No contact, points, a surface, and more rows than the base has. The bound is 100 roundings times the condition
    number."""
    own = contact_tree(seed, True, real)
    bound = 100.0 * ROUNDING[real] * worst_condition(own)
    assert bound < (1e-10 if real == "float64" else 0.05)
    for mu in (np.zeros(len(own.given["q"])), np.linspace(0.1, 1.0, len(own.given["q"]))):
        given = own.given | {"mu": mu}
        if real == "float32":
            given = {name: array.astype(np.float32).astype(np.float64) for name, array in given.items()}
        states = [given[quantity.name] for quantity in SIGNATURES[NAME].inputs]
        expected = own.expected(NAME, **given)
        for found in (
            own.robot.contact_inverse_dynamics(*states),
            own.model.contact_inverse_dynamics(*states),
        ):
            assert np.abs(found.forces - expected["forces"]).max() < bound * np.abs(expected["forces"]).max()
            assert np.abs(found.tau - expected["tau"]).max() < bound * np.abs(expected["tau"]).max()
            inactive = np.repeat(given["active"], own.loaded.mechanism.rows_of_contacts, axis=1) == 0.0
            assert not found.forces[inactive].any()


def test_two_feet_on_an_almost_level_line() -> None:
    """The five rows of A before the last are dependent but for the slope of the line, which is about as small as the bound
    for dependent rows. An SVD with this bound has the same solution."""
    rng = np.random.default_rng(0)
    rows, right, expected = [], [], []
    for slope, angle in zip(
        10.0 ** rng.uniform(-10.0, -4.0, 4000), rng.uniform(0.0, 2.0 * np.pi, 4000), strict=True
    ):
        along = 0.4 * np.array([np.cos(angle), np.sin(angle), slope])
        feet = [pin.skew(np.array([0.02, -0.03, -0.45]) + sign * along) for sign in (1.0, -1.0)]
        rows.append(np.hstack([np.vstack([np.eye(3), turns]) for turns in feet]))
        right.append(rng.standard_normal(6) * [300.0, 300.0, 300.0, 50.0, 50.0, 50.0])
        expected.append(np.linalg.lstsq(rows[-1], right[-1], rcond=1e-8)[0])
    entries = np.moveaxis(rows, 0, -1)
    found = np.transpose(
        least_squares([list(row) for row in entries], list(np.transpose(right)), np.zeros(4000))
    )
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_forward_dynamics_gives_the_motion_back() -> None:
    """Torques of joints alone move the base if enough contacts act; a surface alone has one solution for the forces."""
    own = contact_tree(0, True)
    q, qd, tau, active = (own.given[name] for name in ("q", "qd", "tau", "active"))
    surface = own.loaded.mechanism.rows_of_contacts.index(6)
    held = active[:, surface] > 0.0
    q, qd, tau, active = q[held], qd[held], tau[held].copy(), active[held]
    tau[:, :6] = 0.0
    alone = active.sum(axis=1) == 1.0
    given = own.robot.constrained_forward_dynamics(q, qd, tau, active, 1e-9)
    found = own.robot.contact_inverse_dynamics(q, qd, given.qdd, active)
    scale = np.abs(found.tau).max()
    assert np.abs(found.tau[:, :6]).max() < 1e-11 * scale
    assert np.abs(found.tau[alone] - tau[alone]).max() < 1e-9 * scale
    assert np.abs(found.forces[alone] - given.forces[alone]).max() < 1e-9 * np.abs(given.forces).max()
    again = own.robot.constrained_forward_dynamics(q, qd, found.tau, active, 1e-9)
    assert np.abs(again.qdd - given.qdd).max() < 1e-6 * np.abs(given.qdd).max()
    smaller = np.linalg.norm(found.forces, axis=1) <= np.linalg.norm(given.forces, axis=1) * (1.0 + 1e-9)
    assert smaller.all()


def test_a_brick_on_its_feet() -> None:
    """A surface carries the weight W. A point at x = 0.1 carries the F of the least (F - W)^2 + (0.1 F)^2 + mu F^2."""
    still, weight = np.zeros(6), 39.24
    tau, wrench = brick("brick:6").contact_inverse_dynamics(BRICK, still, still, [1.0])
    np.testing.assert_allclose(wrench, [0.0, 0.0, weight, 0.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(tau, still, atol=1e-12)
    for mu in (0.0, 0.5):
        tau, forces = brick("edge", "side").contact_inverse_dynamics(BRICK, still, still, [1.0, 0.0], mu)
        force = weight / (1.01 + mu)
        np.testing.assert_allclose(forces, [0.0, 0.0, force, 0.0, 0.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(tau, [0.0, 0.0, weight - force, 0.0, 0.1 * force, 0.0], atol=1e-12)
    tau, forces = brick("edge", "side").contact_inverse_dynamics(BRICK, still, still, [0.0, 0.0])
    assert not forces.any()
    np.testing.assert_allclose(tau, [0.0, 0.0, weight, 0.0, 0.0, 0.0], atol=1e-12)


def test_mimic_joints_and_a_frame_that_is_no_contact() -> None:
    """A gripper on a floating arm: C against the model in NumPy."""
    model, robot, given = floating_gripper()
    states = [given[quantity.name] for quantity in SIGNATURES[NAME].inputs]
    for found, expected in zip(
        robot.contact_inverse_dynamics(*states), model.contact_inverse_dynamics(*states), strict=True
    ):
        assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize(("active", "mu"), [(0.5, 0.0), (1.001, 0.0), (-0.001, 0.0), (1.0, -0.1)])
def test_other_masks_and_negative_mu_are_refused(active: float, mu: float) -> None:
    own = contact_tree(0, True)
    state = [own.given[name][0] for name in ("q", "qd", "qdd")]
    mask = np.array([1.0, active, 0.0])[: own.given["active"].shape[1]]
    said = f"mu is {mu:g}" if mu else rf"active of '\w+' is {active:g}"
    for robot in (own.robot, own.model):
        with pytest.raises(InputError, match=rf": {said}\n"):
            robot.contact_inverse_dynamics(*state, mask, mu)


def test_c_returns_a_status_and_nan_in_every_layout() -> None:
    model = brick("edge", "side")
    package = package_view(package_info(model, "brick"), lower(model, functions=[NAME]), EmitOptions())
    call, count = Direct(package, compiled(package, False)), 2 * package.lanes
    q, zeros = np.tile(BRICK, (count, 1)), np.zeros((count, 6))
    active, mu = np.ones((count, 2)), np.zeros(count)
    active[1, 1], mu[2], mu[3], q[4, 2] = 0.5, -1.0, np.nan, np.nan
    tau, forces = np.ones((count, 6)), np.ones((count, 6))
    lost = np.array([1, 2, 3, 4])
    assert call(f"{NAME}_batch", count, q, zeros, zeros, active, mu, tau, forces) == 2
    assert np.isfinite(np.delete(tau, lost, axis=0)).all()
    assert np.isnan(tau[lost[:3]]).all()
    assert np.isnan(forces[lost]).all()
    one = [np.ascontiguousarray(array[k]) for k in (1,) for array in (q, zeros, zeros, active, mu[:, None])]
    assert call(NAME, *one, tau[1], forces[1]) == 2  # 1 + contact 1
    laid = [
        np.ascontiguousarray(array.reshape(-1, package.lanes, array[0].size).transpose(0, 2, 1))
        for array in (q, zeros, zeros, active, mu, tau, forces)
    ]
    assert call(f"{NAME}_batch_soa", count, *laid) == 2
    assert np.array_equal(np.isnan(laid[-1].transpose(0, 2, 1).reshape(count, 6)), np.isnan(forces))


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_forces_of_loops_take_away_the_torques_of_passive_joints(mu: float) -> None:
    """Two legs with four-bars, a boom that slides on a wall, every set of feet: least squares of Pinocchio's numbers."""
    own = four_bar_legs()
    passive = list(own.loaded.mechanism.passive_rates)
    masks = (np.arange(len(own.given["q"]))[:, None] >> np.arange(2)) & 1
    given = {"active": masks.astype(float), "mu": np.full(len(masks), mu)}
    expected = own.expected(NAME, **given)
    for tau, forces in own.found(NAME, **given):
        assert np.abs(forces - expected["forces"]).max() < 1e-10 * np.abs(expected["forces"]).max()
        assert np.abs(tau - expected["tau"]).max() < 1e-10 * np.abs(expected["tau"]).max()
        assert np.abs(tau[:, passive]).max() < 1e-10 * np.abs(tau).max()
        assert not forces[masks.sum(axis=1) == 0][:, :9].any()


def test_the_planned_motion_of_a_robot_with_loops_follows_from_its_torques() -> None:
    """With the rates and accelerations of passive joints that keep loops closed; no foot acts in forward dynamics."""
    own = four_bar_legs()
    q, qd, qdd = (own.given[name] for name in ("q", "qd", "qdd"))
    motion = own.model.passive_motion(q, qd, qdd)
    still = np.zeros((len(q), 2))
    tau, forces = own.model.contact_inverse_dynamics(q, motion.qd_closed, motion.qdd_closed, still)
    found = own.model.constrained_forward_dynamics(q, motion.qd_closed, tau, still)
    assert np.abs(found.qdd - motion.qdd_closed).max() < 1e-8 * np.abs(motion.qdd_closed).max()
    assert np.abs(found.forces - forces).max() < 1e-8 * np.abs(forces).max()
