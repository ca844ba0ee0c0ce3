"""The search: derivatives against differences, limits by construction, conditions against other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from arms import urdf

from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.motions.allowed import GivenLimits, TorqueLimits, bounded
from psdmc.calibration.motions.criterion import FitColumns, all_columns, inertial_columns
from psdmc.calibration.motions.excite import Excitation, excite
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.limited_sines import LimitedSines
from psdmc.calibration.motions.search import Criterion
from psdmc.calibration.motions.trajectory import limit_faults
from psdmc.compiler import compile as compile_model
from psdmc.compiler import derive
from psdmc.derivation.derive import derive_model
from psdmc.robot.load import load_robot, load_robot_text
from psdmc.robot.reference_model import reference_model

DENSO = Path(__file__).resolve().parents[3] / "examples" / "robots" / "denso_wall.toml"


def crane():
    loaded = load_robot_text(urdf(), "urdf")
    return derive_model(loaded.chain)


@pytest.mark.parametrize("objective", ["deviation", "condition", "log_det"])
def test_slopes_are_those_of_the_criterion(objective: str):
    """Through friction, torque limits that are exceeded, and the scaling to the limits."""
    model = crane()
    chain = bounded(model.chain, GivenLimits(acceleration=10.0))
    regressor = ChainRegressor(model)
    options = ExciteOptions(
        duration=3.0, harmonics=(1, 2, 3), samples=50, objective=objective, torque_margin=0.2
    )
    space = LimitedSines(chain, options)
    friction = lambda qd: 3.0 * np.tanh(qd / 0.1) + 2.0 * qd  # noqa: E731
    limits = TorqueLimits(chain, regressor, np.full(3, 60.0), model.theta_b, friction)
    columns = all_columns(regressor, model.l, LinearOptions(sign_speed=0.3))
    criterion = Criterion(space, columns, options, limits)
    rng = np.random.default_rng(4)
    point = rng.standard_normal(space.size)
    assert limits.excess(*exceeding(space, regressor, point), 0.2)[0] > 0.0

    _, slope, _ = criterion.smooth(point, 3.0)

    for direction in rng.standard_normal((5, space.size)):
        step = 1e-6 * direction
        ahead, behind = (criterion.smooth(point + sign * step, 3.0)[0] for sign in (1.0, -1.0))
        assert slope @ direction == pytest.approx((ahead - behind) / 2e-6, rel=2e-5, abs=1e-6)


def exceeding(space: LimitedSines, regressor: ChainRegressor, point: np.ndarray):
    q, qd, qdd = (part.T for part in space.placed(point).states)
    return regressor.regressor(q, qd, qdd), qd


def test_every_point_of_the_space_keeps_the_limits_between_samples(arm):
    chain = arm.model.chain
    options = ExciteOptions(duration=5.0, samples=20)
    space = LimitedSines(chain, options)
    for point in 3.0 * np.random.default_rng(1).standard_normal((50, space.size)):
        fine = space.motion(point).sampled(chain.joint_names, 5.0 / 5000)

        assert limit_faults(fine, chain) == []
        states = space.placed(point).states
        assert np.allclose(
            space.motion(point).at(np.arange(space.samples) * 5.0 / space.samples)[0], states[0].T
        )


def pinocchio_columns(model, loaded, states) -> np.ndarray:
    """(N n, l) by Pinocchio's regressor: columns of psdmc's base parameters, each on the standard parameters that stand for
    it. Bodies about their link frames become bodies about Pinocchio's joints by its own transport of inertias."""
    robot = reference_model(loaded)
    data, n = robot.createData(), robot.nv
    change = np.zeros((11 * n, 11 * n))
    for k, joint in enumerate(loaded.chain.joints):
        frame = robot.frames[robot.getFrameId(joint.link_name, pin.FrameType.BODY)].placement
        start = np.array([1.0, 0.1, 0.2, 0.3, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0])
        carried = lambda x, at=frame: at.act(pin.Inertia.FromDynamicParameters(x)).toDynamicParameters()  # noqa: E731
        for j in range(10):
            moved = carried(start + np.eye(10)[j]) - carried(start)
            change[11 * k : 11 * k + 10, 11 * k + j] = moved
        change[11 * k + 10, 11 * k + 10] = 1.0
    rows = []
    for q, qd, qdd in zip(*states, strict=True):
        bodies = pin.computeJointTorqueRegressor(robot, data, q, qd, qdd).reshape(n, n, 10)
        drives = (np.diag(qdd))[:, :, None]
        rows.append(np.concatenate([bodies, drives], axis=2).reshape(n, 11 * n))
    return (np.array(rows) @ change @ model.representative).reshape(-1, model.l)


def test_the_condition_reached_is_the_one_of_columns_built_without_psdmc():
    loaded = load_robot(DENSO, drive_inertia=True)
    model = derive_model(loaded.chain, expand=False)
    columns = all_columns(ChainRegressor(model), model.l, LinearOptions())
    options = ExciteOptions(duration=5.0, samples=80, evaluations=20, random=10)

    found = excite(model.chain, columns, options)

    states = found.motion.at(np.arange(80) * 5.0 / 80)
    rigid = pinocchio_columns(model, loaded, states)
    qd = states[1]
    sign = np.tanh(qd / 0.03)
    own = [np.diag(row) for row in sign], [np.diag(row) for row in sign * np.abs(qd)], [np.eye(6)] * 80
    stack = np.column_stack([rigid, *(np.concatenate(part) for part in own)])
    assert found.condition == pytest.approx(np.linalg.cond(stack / np.linalg.norm(stack, axis=0)), rel=1e-6)


def test_the_inertial_steps_columns_are_those_that_gravity_does_not_show():
    """At rest in any pose they are zero, and at speed they have full rank. Columns of Y alone are not always so."""
    model = derive_model(load_robot(DENSO, drive_inertia=True).chain, expand=False)
    columns = inertial_columns(model.chain, ChainRegressor(model), model.l)
    q, qd, qdd = np.random.default_rng(1).uniform(-2.0, 2.0, (3, 40, 6))

    still = columns.at(q, 0 * qd, 0 * qdd)
    moving = columns.at(q, qd, qdd).reshape(240, -1)

    assert np.abs(still).max() < 1e-12
    assert np.linalg.matrix_rank(moving) == moving.shape[1]


@pytest.mark.slow
def test_the_denso_reaches_twice_the_best_of_a_thousand_random_motions():
    """In condition number, in a tenth of the evaluations that the search may make: for one log by the standard deviations'
    bound, for the inertial step by the condition number alone, whose motion is slower: its standard deviations, by numpy,
    are more than twice as large."""
    model = derive(DENSO, drive_inertia=True)
    robot = compile_model(model, functions=["regressor"])
    inertial = inertial_columns(model.chain, robot, model.l)
    options = ExciteOptions(evaluations=600)
    alone = replace(options, objective="condition")

    one_log = excite(model.chain, all_columns(robot, model.l, LinearOptions()), options)
    slow, fast = (excite(model.chain, inertial, each) for each in (alone, options))

    for found in (one_log, slow, fast):
        assert len(found.random_times) == 1000
        assert found.evaluations <= 600
        assert limit_faults(found.motion.sampled(model.joint_names, 10.0 / 1000), model.chain) == []
    assert one_log.random_condition > 2 * one_log.condition
    assert slow.times > 2
    assert fast.times > 2
    assert np.mean(std_of(slow, inertial)) > 2 * np.mean(std_of(fast, inertial))


def std_of(found: Excitation, columns: FitColumns) -> np.ndarray:
    rows = columns.at(*found.motion.at(np.arange(100) * 0.1))
    flat = rows.reshape(-1, rows.shape[-1])
    return np.sqrt(np.diag(np.linalg.inv(flat.T @ flat)))
