"""Robots of the example-robot-data wheel, against Pinocchio given the same snapped chain."""

from __future__ import annotations

import numpy as np
import pytest
from installed import in_wheel
from random_chains import relative_error

from psdmc.derivation.derive import derive_model
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference

REAL = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", None, 36),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", None, 36),
    "panda": ("panda_description/urdf/panda.urdf", "panda_link8", 43),
    "kinova": ("kinova_description/robots/kinova.urdf", None, 36),
    "z1": ("z1_description/urdf/z1.urdf", None, 43),
}
"""File, tip, l."""


@pytest.mark.parametrize("name", REAL)
def test_real_robot(name: str) -> None:
    file, tip, l = REAL[name]
    loaded = load_robot(in_wheel(file), tip=tip)
    model, robot = derive_model(loaded.chain), reference(loaded)
    assert model.l == l
    assert model.certificate.max() < 1e-12
    rng = np.random.default_rng(3)
    q, qd, qdd = (limit * rng.uniform(-1, 1, (300, model.n)) for limit in (np.pi, 3.0, 5.0))
    torque = robot.inverse_dynamics(q, qd, qdd)
    assert relative_error(model.inverse_dynamics(q, qd, qdd), torque) < 1e-12
    assert relative_error(model.gravity(q), robot.gravity(q), torque) < 1e-12
    assert relative_error(model.mass_matrix(q[:50]), robot.mass_matrix(q[:50])) < 1e-12
