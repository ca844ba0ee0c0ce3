"""Evaluation of the MODEL: shapes, chunks, and errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model
from random_chains import states

from psdmc.errors import InputError
from psdmc.model import evaluate


def test_two_link_against_the_closed_form() -> None:
    """Planar arm of two links with only m, rx and Izz; gravity along -y0."""
    model = bundled_model("two_link")
    m, r, inertia, a1 = (2.0, 1.5), (1.2 - 0.55, 1.1 - 0.5), (0.25, 0.15), 1.2
    q, qd, qdd = states(2, 20)
    (q1, q2), (w1, w2), (a, b) = q.T, qd.T, qdd.T
    i2 = inertia[1] + m[1] * r[1] ** 2
    coupling = m[1] * a1 * r[1]
    m12 = i2 + coupling * np.cos(q2)
    m11 = inertia[0] + m[0] * r[0] ** 2 + m[1] * a1**2 + i2 + 2 * coupling * np.cos(q2)
    g2 = 9.81 * m[1] * r[1] * np.cos(q1 + q2)
    g1 = 9.81 * (m[0] * r[0] + m[1] * a1) * np.cos(q1) + g2
    h = coupling * np.sin(q2)
    tau1 = m11 * a + m12 * b - h * (2 * w1 * w2 + w2**2) + g1
    tau2 = m12 * a + i2 * b + h * w1**2 + g2
    assert np.allclose(model.inverse_dynamics(q, qd, qdd), np.stack([tau1, tau2], axis=1), rtol=1e-12)


def test_leading_axes_broadcast() -> None:
    model = bundled_model("scara")
    q, qd, qdd = states(4, 6)
    q, qd, qdd = q.reshape(2, 3, 4), qd.reshape(2, 3, 4)[:, :1], qdd[0]
    torque = model.inverse_dynamics(q, qd, qdd)
    assert torque.shape == (2, 3, 4)
    assert np.allclose(torque[1, 2], model.inverse_dynamics(q[1, 2], qd[1, 0], qdd), rtol=1e-14)
    assert model.regressor(q, qd, qdd).shape == (2, 3, 4, 8)
    assert model.mass_matrix(q).shape == (2, 3, 4, 4)
    assert model.gravity(q[0, 0]).shape == (4,)
    assert model.inverse_dynamics(np.zeros((0, 4)), np.zeros(4), np.zeros(4)).shape == (0, 4)


def test_chunks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    model = bundled_model("scara")
    state = states(4, 23)
    whole = model.inverse_dynamics(*state), model.regressor(*state), model.mass_matrix(state[0])
    monkeypatch.setattr(evaluate, "CHUNK_BYTES", 5 * 8 * model.p)
    parts = model.inverse_dynamics(*state), model.regressor(*state), model.mass_matrix(state[0])
    for a, b in zip(whole, parts, strict=True):
        assert np.allclose(a, b, rtol=1e-13, atol=1e-14)


def test_torques_are_those_of_the_parts() -> None:
    model = bundled_model("scara")
    q, qd, qdd = states(4, 10)
    sum_of_parts = np.einsum("sij,sj->si", model.mass_matrix(q), qdd) + model.nonlinear_effects(q, qd)
    assert np.allclose(sum_of_parts, model.inverse_dynamics(q, qd, qdd), rtol=1e-12)


def test_a_wrong_number_of_joints() -> None:
    model = bundled_model("scara")
    with pytest.raises(InputError, match=r"qd has shape \(3,\), expected \(\.\.\., 4\)"):
        model.inverse_dynamics(np.zeros(4), np.zeros(3), np.zeros(4))
    with pytest.raises(InputError, match=r"q has shape \(\)"):
        model.gravity(0.0)


def test_shapes_that_do_not_broadcast() -> None:
    with pytest.raises(InputError, match="shapes do not broadcast"):
        bundled_model("scara").inverse_dynamics(np.zeros((2, 4)), np.zeros((3, 4)), np.zeros(4))


def test_unknown_base_parameters() -> None:
    model = replace(bundled_model("scara"), theta_b=None)
    with pytest.raises(InputError, match="base parameters of 'scara' are unknown"):
        model.gravity(np.zeros(4))
    assert model.regressor(np.zeros(4), np.zeros(4), np.zeros(4)).shape == (4, 8)


def test_a_model_without_E_and_P_says_so() -> None:
    model = replace(bundled_model("scara"), expansion=None)
    with pytest.raises(InputError, match="without E and P"):
        model.expanded()
