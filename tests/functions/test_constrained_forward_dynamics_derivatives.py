"""Derivatives of forward dynamics with contacts: dense systems of Pinocchio's numbers, complex steps, Pinocchio's own."""

from __future__ import annotations

from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import INTERPRETED, SEVERAL, matches_pinocchio, program_matches_pinocchio
from contact_trees import BRICK, brick, contact_tree
from installed import in_wheel
from slopes_of import are_slopes
from test_constrained_forward_dynamics import constraints
from wide_robots import is_pinocchios

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.random_states import states_of
from psdmc.robot.load import load_robot

WITHOUT = "constrained_forward_dynamics"
NAME = f"{WITHOUT}_derivatives"


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_they_are_the_dense_systems(robot: str, real: str) -> None:
    """test_constrained_forward_dynamics.py does the same on trees, with every mask."""
    matches_pinocchio(NAME, robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_their_programs_are_the_dense_systems(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


@pytest.mark.parametrize("robot", ["small", "hand"])
def test_they_are_complex_steps(robot: str) -> None:
    """Joints of several coordinates, and gains that are not zero."""
    are_slopes(NAME, WITHOUT, robot, 1e-8)


def test_loops_and_calls_where_joints_have_several_coordinates() -> None:
    is_pinocchios(NAME, "small", 1e-8)


def test_values_are_those_without_derivatives_and_without_contacts_those_of_forward_dynamics() -> None:
    own = contact_tree(0, True)
    state = [own.given[name] for name in ("q", "qd", "tau", "active")]
    found, plain = getattr(own.robot, NAME)(*state), own.robot.constrained_forward_dynamics(*state)
    for name in ("qdd", "forces"):
        expected = getattr(plain, name)
        np.testing.assert_allclose(getattr(found, name), expected, atol=1e-11 * np.abs(expected).max())
    off = own.given["active"].sum(axis=1) == 0
    free = own.model.forward_dynamics_derivatives(*(each[off] for each in state[:3]))
    for name in ("dqdd_dq", "dqdd_dqd", "dqdd_dtau"):
        expected = getattr(free, name)
        np.testing.assert_allclose(getattr(found, name)[off], expected, atol=1e-10 * np.abs(expected).max())
    for name in ("dforces_dq", "dforces_dqd", "dforces_dtau", "dforces_derror", "dqdd_derror"):
        assert not getattr(found, name)[off].any()


def test_too_many_contacts_are_refused_and_every_result_is_nan() -> None:
    model = brick("edge", "side")
    robot = psdmc.compile(model, functions=[NAME])
    state = (BRICK, np.zeros(6), np.zeros(6), [1.0, 1.0])
    for each in (model, robot):
        with pytest.raises(InputError, match="is not positive definite at mu = 0"):
            getattr(each, NAME)(*state)
        assert all(np.isfinite(values).all() for values in getattr(each, NAME)(*state, mu=0.1))


@pytest.mark.slow
def test_a_quadruped_has_pinocchios_derivatives_of_contact_dynamics() -> None:
    """HyQ, every mask: computeConstraintDynamicsDerivatives, of accelerations and of forces."""
    feet = ["lf_foot", "lh_foot", "rf_foot", "rh_foot"]
    path = in_wheel("hyq_no_sensors.urdf")
    model = derive_model(load_robot(path, floating=True, contacts=feet).mechanism, expand=False)
    robot = psdmc.compile(model, functions=[NAME])
    theirs = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    states = states_of(model.mechanism, np.random.default_rng(2), 4)
    settings = pin.ProximalSettings(1e-13, 1e-14, 50)
    for mask in product([0.0, 1.0], repeat=4):
        found = getattr(robot, NAME)(*states, mask)
        contacts = constraints(theirs, [name for name, on in zip(feet, mask, strict=True) if on], pin.LOCAL)
        on = np.repeat(mask, 3) > 0.0
        for row, state in enumerate(zip(*states, strict=True)):
            data, datas = theirs.createData(), pin.StdVec_RigidConstraintData()
            datas.extend([each.createData() for each in contacts])
            pin.initConstraintDynamics(theirs, data, contacts, datas)
            pin.constraintDynamics(theirs, data, *state, contacts, datas, settings)
            pin.computeConstraintDynamicsDerivatives(theirs, data, contacts, datas, settings)
            turns, about = _turns(theirs, state[0], contacts)
            forces = found.forces[row][on].reshape(-1, 1, 3)
            bent = np.cross(about, forces).transpose(0, 2, 1).reshape(-1, model.nv)
            for name, expected in (
                ("dqdd_dq", data.ddq_dq),
                ("dqdd_dqd", data.ddq_dv),
                ("dqdd_dtau", data.ddq_dtau),
                ("dforces_dq", _turned(turns, data.dlambda_dq) + bent),
                ("dforces_dqd", _turned(turns, data.dlambda_dv)),
                ("dforces_dtau", _turned(turns, data.dlambda_dtau)),
            ):
                values = getattr(found, name)[row]
                values = values[on] if name.startswith("dforces") else values
                assert np.abs(values - expected).max(initial=0.0) <= 1e-8 * np.abs(expected).max(
                    initial=1.0
                ), name


def _turns(
    model: pin.Model, q: np.ndarray, contacts: pin.StdVec_RigidConstraintModel
) -> tuple[list[np.ndarray], np.ndarray]:
    """Rotations of the contacts' frames, in which Pinocchio's forces are, and the axes that joints turn them about."""
    data, turns, about = model.createData(), [], [np.zeros((0, model.nv, 3))]
    for each in contacts:
        pin.computeJointJacobians(model, data, q)
        rows = pin.getJointJacobian(model, data, each.joint1_id, pin.LOCAL_WORLD_ALIGNED)
        turns.append(data.oMi[each.joint1_id].rotation @ each.joint1_placement.rotation)
        about.append(rows[3:].T[None])
    return turns, np.concatenate(about)


def _turned(turns: list[np.ndarray], rows: np.ndarray) -> np.ndarray:
    blocks = [turn @ rows[3 * k : 3 * k + 3] for k, turn in enumerate(turns)]
    return np.concatenate([np.zeros((0, rows.shape[1])), *blocks])
