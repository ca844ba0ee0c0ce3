"""Forward dynamics with contacts against dense systems of Pinocchio's numbers, in closed form, and where it has none."""

from __future__ import annotations

import os
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import EVERY, matches_pinocchio
from contact_trees import BRICK, FUNCTIONS, ContactTree, brick, contact_tree, floating_gripper
from direct import Direct
from installed import in_wheel
from slow_cases import slow_but_for
from unoptimised import compiled

import psdmc
from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import SIGNATURES
from psdmc.lower.kernels import lower
from psdmc.model.random_states import states_of
from psdmc.robot.load import load_robot

NAME = "constrained_forward_dynamics"
ROUNDING = 2.2e-16
Array = np.ndarray


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_accelerations_and_forces_are_pinocchios(robot: str, real: str) -> None:
    """One state, rows, lanes and run-time parameters, with mu from 0.1 to 1 and random masks."""
    matches_pinocchio(NAME, robot, real)


SEEDS = 30 if os.environ.get("PSDMC_TREES") == "whole" else 4

QUICK = (NAME, "constrained_forward_dynamics_derivatives", "impulse_vjp", "delassus", "contact_jacobian")
TREES = slow_but_for(
    [(0, True, name) for name in QUICK],
    [(seed, floating, name) for seed in range(SEEDS) for floating in (True, False) for name in FUNCTIONS],
    spread=True,
)


@pytest.mark.parametrize(("seed", "floating", "name"), TREES)
def test_trees_with_every_mask_have_the_dense_systems_solution(seed: int, floating: bool, name: str) -> None:
    """mu = 0, and of the dynamics other mu. The bound is 1e-10, or 1000 roundings times the condition number where that is
    more."""
    own = contact_tree(seed, floating)
    bound = max(1e-10, 1e3 * ROUNDING * own.worst_condition())
    assert bound < 1e-7
    _matches(own, name, 100.0 * bound if name.endswith(("_derivatives", "_vjp", "_jvp")) else bound)
    if name == NAME:
        _matches(own, name, bound, mu=np.linspace(0.0, 1.0, len(own.given["q"])))


def _matches(own: ContactTree, name: str, bound: float, **other: Array) -> None:
    expected = own.expected(name, **other)
    given = [(own.given | other)[q.name] for q in SIGNATURES[name].inputs]
    one = getattr(own.robot, name)(*(array[5] for array in given))
    both = (getattr(own.robot, name)(*given), getattr(own.model, name)(*given))
    for found in both:
        values = found if isinstance(found, tuple) else (found,)
        for value, array in zip(values, expected.values(), strict=True):
            assert np.abs(value - array).max() <= bound * np.abs(array).max(), name
    for value, array in zip(one if isinstance(one, tuple) else (one,), expected.values(), strict=True):
        assert np.abs(value - array[5]).max() <= bound * np.abs(array).max(), name


@pytest.mark.slow
def test_single_precision() -> None:
    own = contact_tree(0, True, "float32")
    rounded = {name: array.astype(np.float32).astype(np.float64) for name, array in own.given.items()}
    expected = own.expected(NAME, **rounded)
    found = getattr(own.robot, NAME)(*(rounded[q.name] for q in SIGNATURES[NAME].inputs))
    bound = max(2e-4, 1e3 * 6e-8 * own.worst_condition())
    assert bound < 0.1
    for value, array in zip(found, expected.values(), strict=True):
        assert np.abs(value - array).max() < bound * np.abs(array).max()


@pytest.mark.slow
@pytest.mark.parametrize("function", [name for name in FUNCTIONS if name.startswith(("constr", "impulse"))])
def test_mimic_joints_and_a_frame_that_is_no_contact(function: str) -> None:
    """A gripper on a floating arm: C, with loops and calls, against the model in NumPy."""
    model, robot, given = floating_gripper()
    states = [given[q.name] for q in SIGNATURES[function].inputs]
    for found, expected in zip(
        getattr(robot, function)(*states), getattr(model, function)(*states), strict=True
    ):
        assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


def test_what_may_be_left_out_is_zero() -> None:
    own = contact_tree(0, True)
    state = [own.given[name] for name in ("q", "qd", "tau", "active")]
    for robot in (own.robot, own.model):
        plain = robot.constrained_forward_dynamics(*state)
        zeros = robot.constrained_forward_dynamics(*state, 0.0, 0.0, 0.0, np.zeros(own.given["error"].shape))
        assert all(map(np.array_equal, plain, zeros))
        assert np.array_equal(plain.qdd, robot.constrained_forward_dynamics(*state, kp=3.0).qdd)
    free = own.given["active"].sum(axis=1) == 0
    np.testing.assert_allclose(plain.qdd[free], own.model.forward_dynamics(*state[:3])[free], rtol=1e-10)
    assert not plain.forces[free].any()


def test_a_brick_rests_on_its_feet() -> None:
    """Two points carry half of the weight each, or one point all of it while the brick tips."""
    model = brick("edge", "side")
    still = np.zeros(6)
    qdd, forces = model.constrained_forward_dynamics(BRICK, still, still, [1.0, 0.0])
    alpha = 4.0 * 9.81 * 0.1 / (0.03 + 4.0 * 0.1**2)  # about y through the edge, by the weight at the centre
    np.testing.assert_allclose(qdd, [0.0, 0.0, -0.1 * alpha, 0.0, -alpha, 0.0], atol=1e-12)
    np.testing.assert_allclose(forces, [0.0, 0.0, 4.0 * (9.81 - 0.1 * alpha), 0.0, 0.0, 0.0], atol=1e-12)
    qdd, wrench = brick("brick:6").constrained_forward_dynamics(BRICK, still, still, [1.0])
    np.testing.assert_allclose(qdd, still, atol=1e-12)
    np.testing.assert_allclose(wrench, [0.0, 0.0, 39.24, 0.0, 0.0, 0.0], atol=1e-12)


def test_two_contacts_that_hold_the_same_motion_need_mu() -> None:
    """The edge's distance from the side cannot change twice: six rows hold five motions. mu > 0 spreads the forces."""
    model = brick("edge", "side")
    state = (BRICK, np.zeros(6), np.zeros(6), [1.0, 1.0])
    with pytest.raises(
        InputError, match=r"contact '\w+': J M\^-1 J\^T \+ mu I of the active contacts is not pos"
    ) as error:
        model.constrained_forward_dynamics(*state)
    assert "mu > 0" in str(error.value.hint)
    qdd, forces = model.constrained_forward_dynamics(*state, mu=1e-9)
    assert np.isfinite(forces).all()
    assert abs(qdd[2] + qdd[4] * -0.1) < 1e-6  # the edge's vertical acceleration


@pytest.mark.parametrize(("active", "mu"), [(0.5, 0.0), (1.001, 0.0), (-0.001, 0.0), (1.0, -0.1)])
def test_other_masks_and_negative_mu_are_refused(active: float, mu: float) -> None:
    own = contact_tree(0, True)
    state = [own.given[name][0] for name in ("q", "qd", "tau")]
    mask = np.array([1.0, active, 0.0])[: own.given["active"].shape[1]]
    said = f"mu is {mu:g}" if mu else rf"active of '\w+' is {active:g}"
    for robot in (own.robot, own.model):
        with pytest.raises(InputError, match=rf": {said}\n"):
            robot.constrained_forward_dynamics(*state, mask, mu)
        many = [np.stack([entry, entry]) for entry in state]
        with pytest.raises(InputError, match=rf": {said} in state 1\n"):
            robot.constrained_forward_dynamics(*many, np.stack([mask * 0.0, mask]), [0.0, mu])
    with pytest.raises(InputError, match=r"active has shape \(9,\)") as error:
        own.robot.constrained_forward_dynamics(*state, np.ones(9))
    assert "the contacts are foot" in str(error.value.hint)


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_c_returns_a_status_and_nan_in_every_layout(real: str) -> None:
    model = brick("edge", "side")
    dtype = np.dtype(real)
    package = package_view(
        package_info(model, "brick"), lower(model, functions=[NAME]), EmitOptions(real=real)
    )  # type: ignore[arg-type]
    call, count = Direct(package, compiled(package, False)), 2 * package.lanes + 3
    q, qd, tau = (
        np.ascontiguousarray(a, dtype) for a in states_of(model.mechanism, np.random.default_rng(3), count)
    )
    q[:, :3], failing = 0.0, package.lanes + 1
    active = np.tile(np.array([1.0, 0.0], dtype), (count, 1))
    active[failing] = 1.0
    gains, error = [np.zeros(count, dtype) for _ in range(3)], np.zeros((count, 6), dtype)
    qdd, forces = np.zeros((count, 6), dtype), np.zeros((count, 6), dtype)
    given = [q, qd, tau, active, *gains, error]
    assert call(f"{NAME}_batch", count, *given, qdd, forces) == 1 + failing
    good = np.arange(count) != failing
    assert np.isnan(qdd[failing]).all()
    assert np.isnan(forces[failing]).all()
    assert np.isfinite(qdd[good]).all()
    assert np.isfinite(forces[good]).all()
    blocks = -(-count // package.lanes)
    laid = []
    for array in given:
        rows = array.reshape(count, -1)
        padded = np.concatenate([rows, np.repeat(rows[:1], blocks * package.lanes - count, axis=0)])
        laid.append(np.ascontiguousarray(padded.reshape(blocks, package.lanes, -1).transpose(0, 2, 1)))
    lanes = [np.zeros((blocks, 6, package.lanes), dtype) for _ in range(2)]
    assert call(f"{NAME}_batch_soa", count, *laid, *lanes) == 1 + failing
    for rows, block in zip((qdd, forces), lanes, strict=True):
        by_lane = block.transpose(0, 2, 1).reshape(-1, 6)[:count]
        np.testing.assert_allclose(
            by_lane, rows, atol=(1e-9 if real == "float64" else 2e-2) * np.nanmax(np.abs(rows))
        )

    one = [array[0] for array in (q, qd, tau)]
    out = [np.zeros(6, dtype) for _ in range(2)]

    def status(mask: list[float], mu: float = 0.0) -> int:
        numbers = [np.array([each], dtype) for each in (mu, 0.0, 0.0)]
        return call(NAME, *one, np.array(mask, dtype), *numbers, error[0], *out)

    assert status([1.0, 0.0]) == 0
    assert status([1.0, 1.0]) == 1 + 6
    assert status([1.0, 1.0], 0.1) == 0
    for mask, mu in [([0.5, 0.0], 0.0), ([np.nan, 0.0], 0.0), ([1.0, 0.0], -1.0), ([1.0, 0.0], np.nan)]:
        assert status(mask, mu) == 1 + 6
        assert all(np.isnan(values).all() for values in out)
    assert status([0.0, 3.0]) == 1 + 6 + 1


@pytest.mark.slow
def test_a_quadruped_has_the_accelerations_of_pinocchios_contact_dynamics() -> None:
    """HyQ, every mask, some states with a straight knee: constraintDynamics, and the equations of an impact."""
    feet = ["lf_foot", "lh_foot", "rf_foot", "rh_foot"]
    path = in_wheel("hyq_no_sensors.urdf")
    model = derive_model(load_robot(path, floating=True, contacts=feet).mechanism, expand=False)
    robot = psdmc.compile(model, functions=[NAME, "impulse"])
    theirs = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    q, qd, tau = states_of(model.mechanism, np.random.default_rng(2), 6)
    q[::3, 9] = 0.0  # lf_kfe_joint
    for mask in product([0.0, 1.0], repeat=4):
        found, impact = robot.constrained_forward_dynamics(q, qd, tau, mask), robot.impulse(q, qd, mask, 0.3)
        contacts = constraints(theirs, [name for name, on in zip(feet, mask, strict=True) if on])
        on = np.repeat(mask, 3) > 0.0
        for row, state in enumerate(zip(q, qd, tau, strict=True)):
            data, datas = theirs.createData(), pin.StdVec_RigidConstraintData()
            datas.extend([each.createData() for each in contacts])
            pin.initConstraintDynamics(theirs, data, contacts, datas)
            settings = pin.ProximalSettings(1e-13, 1e-14, 50)
            qdd = pin.constraintDynamics(theirs, data, *state, contacts, datas, settings)
            assert np.abs(found.qdd[row] - qdd).max() < 1e-9 * np.abs(qdd).max()
            rows = model.contact_jacobian(q[row])[on]
            left = rows @ impact.qd_after[row] + 0.3 * (rows @ qd[row])
            assert np.abs(left).max(initial=0.0) < 1e-9
            kicked = model.mass_matrix(q[row]) @ (impact.qd_after[row] - qd[row])
            assert np.abs(kicked - rows.T @ impact.impulses[row][on]).max() < 1e-9


def constraints(
    model: pin.Model, names: list[str], axes: pin.ReferenceFrame = pin.LOCAL_WORLD_ALIGNED
) -> pin.StdVec_RigidConstraintModel:
    found = pin.StdVec_RigidConstraintModel()
    for name in names:
        frame = model.frames[model.getFrameId(name)]
        found.append(
            pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D, model, frame.parentJoint, frame.placement, axes
            )
        )
    return found
