"""A rigid load on the tip, against Pinocchio with the same body appended."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model, bundled_robot
from random_chains import Oracle, random_chain, relative_error, states

from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot.mechanism import Placement
from psdmc.robot.reference_model import reference_model

MASS, COM = 2.5, np.array([0.03, -0.02, 0.09])
INERTIA = np.array([[0.03, 0.002, -0.001], [0.002, 0.02, 0.003], [-0.001, 0.003, 0.025]])


def placed(placement: Placement) -> pin.SE3:
    return pin.SE3(placement.rotation.copy(), placement.translation.copy())


@pytest.mark.parametrize("expand", [True, False])
@pytest.mark.parametrize("in_frame", [True, False])
def test_against_pinocchio(expand: bool, in_frame: bool) -> None:
    chain = random_chain(3, "RPRR")
    flange = random_chain(4, "R").tip if in_frame else Placement.identity()
    model = derive_model(chain, expand=expand)
    loaded = model.with_payload(MASS, COM, INERTIA, frame=flange if in_frame else None)
    oracle = Oracle(chain)
    oracle.model.appendBodyToJoint(4, pin.Inertia(MASS, COM, INERTIA), placed(chain.tip @ flange))
    oracle.data = oracle.model.createData()
    q, qd, qdd = states(4, 50)
    torque = oracle.rnea(q, qd, qdd)
    assert relative_error(loaded.inverse_dynamics(q, qd, qdd), torque) < 1e-12
    assert relative_error(model.inverse_dynamics(q, qd, qdd), torque) > 1e-3
    assert "2.5 kg" in loaded.chain.notes[-1]


def test_bundled_robot_with_a_point_mass() -> None:
    model, robot = bundled_model("kr6"), bundled_robot("kr6")
    loaded = model.with_payload(6.0, [0.0, 0.0, 0.1], frame=model.chain.tip_name)
    oracle = reference_model(robot)
    body = pin.Inertia(6.0, np.array([0.0, 0.0, 0.1]), np.zeros((3, 3)))
    oracle.appendBodyToJoint(6, body, placed(model.chain.tip))
    data = oracle.createData()
    q, qd, qdd = states(6, 30)
    torque = np.array([pin.rnea(oracle, data, *row) for row in zip(q, qd, qdd, strict=True)])
    assert relative_error(loaded.inverse_dynamics(q, qd, qdd), torque) < 1e-12


def test_loads_add_up() -> None:
    model = derive_model(random_chain(1, "RR"))
    once = model.with_payload(3.0, [0.1, 0.0, 0.0])
    twice = model.with_payload(1.0, [0.1, 0.0, 0.0]).with_payload(2.0, [0.1, 0.0, 0.0])
    assert np.allclose(once.theta_b, twice.theta_b, rtol=1e-14)


def test_a_load_that_the_assumptions_do_not_admit_is_refused() -> None:
    with pytest.raises(InputError, match="cannot carry this load: the model assumes"):
        bundled_model("denso_wall").with_payload(1.0, [0.0, 0.0, 0.1])


def test_unknown_parameters_are_refused() -> None:
    chain = random_chain(1, "R")
    unknown = derive_model(replace(chain, parameters=np.full((1, 11), np.nan)))
    with pytest.raises(InputError, match=r"base parameters of .* are unknown"):
        unknown.with_payload(1.0, [0.0, 0.0, 0.1])


@pytest.mark.parametrize(
    ("mass", "com", "inertia", "frame", "message"),
    [
        (-1.0, [0, 0, 0], None, None, "payload mass is -1.0"),
        (np.nan, [0, 0, 0], None, None, "payload mass is nan"),
        (1.0, [0, 0], None, None, "payload com"),
        (1.0, [0, 0, np.inf], None, None, "payload com"),
        (1.0, [0, 0, 0], np.zeros(6), None, "payload inertia has shape"),
        (1.0, [0, 0, 0], np.triu(np.ones((3, 3))), None, "not symmetric"),
        (1.0, [0, 0, 0], np.diag([-0.1, 0.1, 0.1]), None, "negative principal moment of inertia -0.1 kg m"),
        (1.0, [0, 0, 0], np.diag([0.1, 0.1, 0.3]), None, "principal moments break the triangle inequality"),
        (0.0, [0, 0, 0], 0.1 * np.eye(3), None, "inertia without mass"),
        (1.0, [0, 0, 0], np.full((3, 3), np.nan), None, "payload inertia is"),
        (
            1.0,
            [0, 0, 0],
            1e300 * np.eye(3),
            None,
            r"payload inertia: 1e\+300 is out of range, expected 0, or",
        ),
        (
            1.0,
            [0, 0, 1e155],
            None,
            None,
            r"payload com: 1e\+155 is out of range, expected 0, or 1e-60 to 10000 m",
        ),
        (1e300, [0, 0, 0], None, None, r"payload mass: 1e\+300 is out of range"),
        (10**400, [0, 0, 0], None, None, "payload mass is 1000"),
        ("two", [0, 0, 0], None, None, "payload mass is 'two'"),
        ([1.0], [0, 0, 0], None, None, r"payload mass has shape \(1,\), expected a finite number"),
        (1.0, [0, 0, "x"], None, None, "payload com is"),
        (1.0, [[0], 0, 0], None, None, "payload com is"),
        (1.0, [0, 0, 0], None, 3, "payload frame 3 is not the tip"),
        (1.0, [0, 0, 0], None, Placement(np.diag([1.0, 1.0, -1.0]), np.zeros(3)), "is a reflection"),
        (
            1.0,
            [0, 0, 0],
            None,
            Placement(2.0 * np.eye(3), np.zeros(3)),
            "rotation of the payload's frame is none",
        ),
        (1.0, [0, 0, 0], None, Placement(np.full((3, 3), np.nan), np.zeros(3)), "payload's frame is none"),
        (1.0, [0, 0, 0], None, Placement(np.eye(3), [0, 0, np.inf]), "translation of the payload's frame is"),
        (1.0, [0, 0, 0], None, "elbow", "payload frame 'elbow' is not the tip 'tip'"),
    ],
)
def test_wrong_loads_are_refused(mass, com, inertia, frame, message) -> None:
    model = derive_model(random_chain(1, "RR"))
    with pytest.raises(InputError, match=message):
        model.with_payload(mass, com, inertia, frame=frame)
