"""Derived models against Pinocchio: E, P, theta_b in NumPy."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from hypothesis import given, settings
from hypothesis import strategies as st
from random_chains import Oracle, random_chain, relative_error, states

from psdmc.derivation.certify import certificate
from psdmc.derivation.derive import derive_model
from psdmc.errors import InternalError
from psdmc.model.expansion import Expansion
from psdmc.robot.mechanism import Mechanism
from psdmc.robot.reference import reference

ACCURACY = 1e-12
whole = pytest.mark.skipif(os.environ.get("PSDMC_ACCURACY") != "whole", reason="make test-accuracy takes it")
"""E and P of seven oblique joints are a hundred thousand monomials; six joints, two of them sliding, go the same way."""
BUNDLED = (
    "two_link",
    "two_link_full",
    "scara",
    "scara_zeros",
    "denso_wall",
    "denso_floor",
    "kr6",
    "lbr7",
    "rounded_arm",
)


@pytest.mark.parametrize("name", BUNDLED)
def test_bundled_robots(name: str) -> None:
    """1,000 states: q within pi, qd within 3, qdd within 5."""
    model, robot = bundled_model(name), reference(bundled_robot(name))
    rng = np.random.default_rng(11)
    q, qd, qdd = (limit * rng.uniform(-1, 1, (1000, model.n)) for limit in (np.pi, 3.0, 5.0))
    torque = robot.inverse_dynamics(q, qd, qdd)
    assert model.certificate.max() < ACCURACY
    assert relative_error(model.inverse_dynamics(q, qd, qdd), torque) < ACCURACY
    few = slice(0, 100)
    assert relative_error(model.regressor(q[few], qd[few], qdd[few]) @ model.theta_b, torque[few]) < ACCURACY
    assert relative_error(model.mass_matrix(q[few]), robot.mass_matrix(q[few])) < ACCURACY
    assert relative_error(model.nonlinear_effects(q, qd), robot.nonlinear_effects(q, qd), torque) < ACCURACY
    assert relative_error(model.gravity(q), robot.gravity(q), torque) < ACCURACY


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    kinds=st.text(alphabet="RP", min_size=1, max_size=4),
    tidy=st.booleans(),
    weightless=st.booleans(),
)
def test_random_chains(seed: int, kinds: str, tidy: bool, weightless: bool) -> None:
    gravity = (0.0, 0.0, 0.0) if weightless else (1.0, -2.0, -9.0)
    chain = random_chain(seed, kinds, tidy=tidy, gravity=gravity)
    model = derive_model(chain)
    q, qd, qdd = states(len(chain), 50, seed)
    torque = Oracle(chain).rnea(q, qd, qdd)
    assert relative_error(model.inverse_dynamics(q, qd, qdd), torque) < ACCURACY
    assert model.certificate.max() < ACCURACY
    if weightless:
        assert model.E[3 * model.n :].any(axis=0).all()


@pytest.mark.parametrize(
    ("seed", "kinds"),
    [(2, "RPRRPR"), *(pytest.param(*case, marks=whole) for case in ((1, "RRRRRR"), (3, "RRRRRRR")))],
)
def test_oblique_axes(seed: int, kinds: str) -> None:
    chain = random_chain(seed, kinds)
    model = derive_model(chain)
    q, qd, qdd = states(len(chain), 200, seed)
    assert relative_error(model.inverse_dynamics(q, qd, qdd), Oracle(chain).rnea(q, qd, qdd)) < ACCURACY


@pytest.mark.parametrize("name", BUNDLED)
def test_base_parameters_do_not_depend_on_expansion(name: str) -> None:
    model = bundled_model(name)
    plain = derive_model(model.chain, expand=False)
    assert plain.E is None
    assert plain.P is None
    assert np.array_equal(plain.B, model.B)
    assert np.array_equal(plain.theta_b, model.theta_b)
    q, qd, qdd = states(model.n, 20)
    assert relative_error(plain.inverse_dynamics(q, qd, qdd), model.inverse_dynamics(q, qd, qdd)) < ACCURACY
    assert np.allclose(plain.regressor(q, qd, qdd), model.regressor(q, qd, qdd), rtol=1e-9, atol=1e-9)
    assert np.allclose(plain.mass_matrix(q), model.mass_matrix(q), rtol=1e-12, atol=1e-12)


def test_twelve_joints_without_expansion() -> None:
    chain = random_chain(5, "RRPRRRRRPRRR")
    model = derive_model(chain, expand=False)
    q, qd, qdd = states(12, 50)
    assert relative_error(model.inverse_dynamics(q, qd, qdd), Oracle(chain).rnea(q, qd, qdd)) < ACCURACY


def test_drive_inertia_is_pinocchios_armature() -> None:
    chain = random_chain(6, "RPR")
    drives = np.array([0.3, 0.2, 0.1])
    geared = with_drives(chain, drives)
    model = derive_model(geared)
    q, qd, qdd = states(3, 50)
    torque = Oracle(chain, drives).rnea(q, qd, qdd)
    assert relative_error(model.inverse_dynamics(q, qd, qdd), torque) < ACCURACY
    assert model.l > derive_model(chain).l


def with_drives(chain: Mechanism, drives: np.ndarray) -> Mechanism:
    parameters = chain.parameters.copy()
    parameters[:, 10] = drives
    return replace(chain, parameters=parameters, parameter_span=np.eye(11 * len(chain)))


def test_unknown_inertias_leave_theta_open_and_certify_all_the_same() -> None:
    chain = random_chain(7, "RRR")
    parameters = chain.parameters.copy()
    parameters[2, 4] = np.nan
    model = derive_model(replace(chain, parameters=parameters))
    assert model.theta_b is None
    assert model.certificate.max() < ACCURACY


def test_unknown_parameters_that_no_joint_feels_do_not_matter() -> None:
    model = bundled_model("two_link_full")
    parameters = model.chain.parameters.copy()
    unfelt = np.flatnonzero(~model.B.any(axis=0))
    assert len(unfelt) > 10
    parameters.reshape(-1)[unfelt] = np.nan
    found = derive_model(replace(model.chain, parameters=parameters))
    assert np.array_equal(found.theta_b, model.theta_b)
    assert found.certificate.max() < ACCURACY


def test_the_certificate_refuses_a_wrong_model() -> None:
    model = bundled_model("scara")
    matrices = [matrix.copy() for matrix in model.P]
    matrices[1].data[0] *= 1 + 1e-6
    with pytest.raises(InternalError, match=r"joint '.*': the derived model is off Newton-Euler"):
        certificate(replace(model, expansion=Expansion.of(model.E, matrices)))


def test_representative_lifts_base_parameters_into_the_span() -> None:
    model = bundled_model("denso_wall")
    lift = model.representative
    assert np.array_equal(model.B @ lift, np.eye(model.l))
    span = model.chain.parameter_span
    assert np.linalg.matrix_rank(np.hstack([span, lift])) == span.shape[1]
