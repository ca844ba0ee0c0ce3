"""The parts of benchmarks/identification, on data whose answer is known: Pinocchio's torques and friction in closed form."""

from __future__ import annotations

import sys
from importlib.metadata import distributions
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "benchmarks" / "identification"
LINK = """<link name="link{k}"><inertial><origin xyz="0.05 {y} 0.1"/><mass value="{m}"/>
<inertia ixx="0.05" iyy="0.06" izz="0.04" ixy="0.002" ixz="-0.003" iyz="0.001"/></inertial></link>"""
JOINT = """<joint name="joint{k}" type="revolute"><parent link="link{p}"/><child link="link{k}"/>
<origin xyz="0.1 0 0.3" rpy="{r} 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>"""
ARM = "".join(
    [
        '<robot name="arm"><link name="link0"/>',
        *(LINK.format(k=k, y=0.02 * k, m=5.0 - k) for k in (1, 2, 3)),
        *(JOINT.format(k=k, p=k - 1, r=0.7 * k) for k in (1, 2, 3)),
        "</robot>",
    ]
)
RATE = 200.0


def is_distributed(name: str) -> bool:
    return any(found.name == name for found in distributions(name=name))


@pytest.fixture
def flobaroid(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(FOLDER))
    import flobaroid

    return flobaroid


@pytest.fixture
def shared_robot(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(FOLDER))
    import shared_robot

    return shared_robot


def exact() -> tuple[pin.Model, np.ndarray, tuple[np.ndarray, ...]]:
    """A model, its true parameters with drive inertia, friction and offset, and states with Pinocchio's torques."""
    model = pin.buildModelFromXML(ARM)
    n, rng = model.nv, np.random.default_rng(3)
    own = rng.uniform(0.5, 2.0, (4, n))
    q, qd, qdd = (rng.uniform(-2.0, 2.0, (300, n)) for _ in range(3))
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *state).copy() for state in zip(q, qd, qdd, strict=True)])
    torque = rigid + own[0] * qdd + own[1] * np.sign(qd) + own[2] * qd + own[3]
    links = [model.inertias[k].toDynamicParameters() for k in range(1, model.njoints)]
    return model, np.concatenate([*links, own.ravel()]), (q, qd, qdd, torque)


@pytest.mark.parametrize(
    "method",
    [
        "wls",
        "essential",
        pytest.param("sdp", marks=pytest.mark.skipif(find_spec("cvxpy") is None, reason="cvxpy")),
    ],
)
def test_exact_data_give_the_true_base_parameters(flobaroid: ModuleType, method: str):
    model, truth, states = exact()

    found = flobaroid.identified(model, states, method)

    base = flobaroid.structural_base(model)
    tolerance = 1e-4 if method == "sdp" else 1e-8  # an interior point ends a little inside
    np.testing.assert_allclose(base.fold @ found, base.fold @ truth, rtol=0, atol=tolerance)
    friction = slice(-3 * model.nv, None)
    np.testing.assert_allclose(found[friction], truth[friction], rtol=0, atol=tolerance)


def test_what_the_data_do_not_show_stays_as_in_the_file(flobaroid: ModuleType):
    """Joint 1 does not move: its drive inertia and friction cannot be found, and essential parameters leave them alone."""
    model, truth, (q, qd, qdd, _) = exact()
    qd[:, 0] *= 1e-6
    qdd[:, 0] *= 1e-6
    columns = flobaroid.regressor(model, q, qd, qdd)
    noise = np.random.default_rng(1).standard_normal(len(columns))
    data = flobaroid.Data(columns, columns @ truth + 0.1 * noise, model.nv, flobaroid.file_parameters(model))

    found = flobaroid.essential(data, flobaroid.structural_base(model))

    viscous = slice(-2 * model.nv, -model.nv)
    assert found[viscous][0] == 0.0
    np.testing.assert_allclose(found[viscous][1:], truth[viscous][1:], rtol=0, atol=0.05)


def test_the_matrix_of_a_body_is_the_sum_over_its_points(flobaroid: ModuleType):
    """Of a point of mass m at c: m [S(c), 1]' [S(c), 1], where S(c) v = c x v."""
    rng = np.random.default_rng(2)
    masses, points = rng.uniform(0.5, 2.0, 7), rng.uniform(-1.0, 1.0, (7, 3))
    wanted, body = np.zeros((6, 6)), pin.Inertia.Zero()
    for m, c in zip(masses, points, strict=True):
        half = np.hstack([pin.skew(c), np.eye(3)])
        wanted += m * half.T @ half
        body += pin.Inertia(m, c, np.zeros((3, 3)))

    found = np.array(flobaroid.body_matrix(body.toDynamicParameters()))

    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def test_the_filters_keep_a_slow_sine_and_its_derivatives(flobaroid: ModuleType):
    time = np.arange(0.0, 10.0, 1.0 / RATE)
    w = 2.0 * np.pi * 0.5
    position = np.sin(w * time)[:, None]

    q, qd, qdd, tau = flobaroid.states_of(time, position, 3.0 * position)

    kept, inner = slice(100, -100), slice(300, -300)
    assert len(q) == len(time) - 200
    position, time = position[kept], time[kept]
    np.testing.assert_allclose(q[inner], position[inner], rtol=0, atol=2e-3)
    np.testing.assert_allclose(qd[inner, 0], w * np.cos(w * time[inner]), rtol=0, atol=0.02)
    np.testing.assert_allclose(
        qdd[inner, 0], -w * w * np.sin(w * time[inner]), rtol=0, atol=0.2
    )  # the median cuts peaks
    np.testing.assert_allclose(tau[inner], 3.0 * position[inner], rtol=0, atol=6e-3)


def test_wrong_masses_are_still_those_of_bodies(shared_robot: ModuleType):
    wrong = shared_robot.with_wrong_masses(ARM, 0.3, 0.01)

    true, other = (pin.buildModelFromXML(text) for text in (ARM, wrong))

    for a, b in zip(list(true.inertias)[1:], list(other.inertias)[1:], strict=True):
        factor = b.mass / a.mass
        assert 0.3 < factor < 3.0
        assert abs(factor - 1.0) > 1e-3
        np.testing.assert_allclose(b.inertia, factor * a.inertia, rtol=1e-9, atol=1e-12)
        assert 0.0 < np.linalg.norm(b.lever - a.lever) < 0.06


def test_figaroh_parameters_land_in_their_columns(monkeypatch: pytest.MonkeyPatch):
    """Columns 0 and 3 are eliminated, and of the rest columns 0 and 2 are base parameters: columns 1 and 4 of all."""
    part = ModuleType("figaroh.identification.base_identification")
    part.BaseIdentification = object  # type: ignore[attr-defined]
    for name in ("figaroh", "figaroh.identification"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, part.__name__, part)
    monkeypatch.syspath_prepend(str(FOLDER))
    import run_figaroh

    found = SimpleNamespace(
        dynamic_regressor=np.zeros((1, 6)), _idx_eliminated=[0, 3], _base_indices=(0, 2), phi_base=[7.0, 8.0]
    )

    assert run_figaroh.identified(found, "fit").tolist() == [0.0, 7.0, 0.0, 0.0, 8.0, 0.0]


@pytest.mark.skipif(not is_distributed("example-robot-data"), reason="the UR10's file")
def test_the_true_robot_has_no_error_and_an_offset_its_own(shared_robot: ModuleType):
    import scores

    urdf = shared_robot.robot_file()
    truth = scores.truth_of(urdf)
    model = pin.buildModelFromUrdf(str(urdf))
    q, qd, qdd = (np.random.default_rng(5).uniform(-2.0, 2.0, (80, model.nv)) for _ in range(3))
    data = model.createData()
    torque = np.array([pin.rnea(model, data, *state).copy() for state in zip(q, qd, qdd, strict=True)])
    torque += np.array(shared_robot.DRIVE_INERTIA) * qdd + np.array(shared_robot.VISCOUS) * qd
    torque += np.array(shared_robot.COULOMB) * np.sign(qd)
    held = scores.held_out_of(truth, (q, qd, qdd), torque)
    true = scores.Estimate(
        truth.theta_b, np.array(shared_robot.COULOMB), np.array(shared_robot.VISCOUS), np.zeros(model.nv)
    )
    shifted = scores.Estimate(true.theta_b, true.coulomb, true.viscous, true.offset + 0.25)

    good, off = (scores.score(estimate, truth, held) for estimate in (true, shifted))

    assert max(good.base, good.friction, *good.torque, *good.moving) < 1e-9
    np.testing.assert_allclose(off.torque, 0.25, rtol=1e-9)
    np.testing.assert_allclose(off.moving, 0.25, rtol=1e-9)
