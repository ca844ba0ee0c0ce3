"""A real UR10's log, where it is at hand: as good as the reference fit that its README states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shared_data import UR10_LOG
from slow_cases import slow_but_for

from psdmc.calibration.calibrate import CalibrateOptions, calibrate, calibrate_logs
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log_files import read_log
from psdmc.calibration.verdict.record import Calibration
from psdmc.derivation.derive import derive_model
from psdmc.model.parameter_checks import check_mass_matrix
from psdmc.robot.load import load_robot

REFERENCE = np.array([0.974, 0.989, 0.996, 0.986, 0.976, 0.962])

pytestmark = pytest.mark.skipif(not UR10_LOG.exists(), reason="the UR10 log is not part of the project")


@pytest.fixture(scope="module")
def model():
    folder = pytest.importorskip("cmeel").__path__[0]
    found = sorted((Path(folder).parent / "cmeel.prefix").rglob("ur10_robot.urdf"))
    if not found:
        pytest.skip("example-robot-data is not installed")
    return derive_model(load_robot(found[0], drive_inertia=True).chain, expand=False)


def held_out(record: Calibration) -> np.ndarray:
    return np.array([both.held_out.r2 for both in record.steps[0].joints.values()])


def test_the_bag_holds_what_the_table_holds():
    table = read_log(UR10_LOG / "exciting_trajectory.csv")
    bag = read_log(UR10_LOG / "exciting_trajectory.db3").ordered(table.joint_names)

    assert len(bag) == len(table) == 3441
    assert np.abs(bag.time - table.time).max() < 1e-6
    assert np.abs(bag.position - table.position).max() < 1e-8
    assert np.abs(bag.effort - table.effort).max() < 1e-6


DELIVERED = np.array([0.976, 0.989, 0.996, 0.992, 0.986, 0.980])
"""What the calibrated file must reach on the held-out part: physically consistent, with its own friction."""


def test_the_delivered_file_is_as_good_as_it_must_be(model):
    record = calibrate(model, UR10_LOG / "exciting_trajectory.csv", regressor=ChainRegressor(model))

    assert np.all(held_out(record) >= DELIVERED)
    assert np.all(np.round(held_out(record), 3) >= REFERENCE)
    assert any("motor torque" in warning for warning in record.warnings)
    mass = check_mass_matrix(record.model)
    assert mass is not None
    assert mass.passed


def test_physical_consistency_costs_at_most_a_hundredth_and_says_so(model):
    log = UR10_LOG / "exciting_trajectory.csv"

    plain = calibrate(model, log, CalibrateOptions(physical=False), regressor=ChainRegressor(model))
    physical = calibrate(model, log, regressor=ChainRegressor(model))

    cost = held_out(plain) - held_out(physical)
    assert np.all(cost <= 0.01)
    assert list(physical.facts["physical_cost_r2"].values()) == pytest.approx(cost.tolist(), abs=1e-12)
    assert any("physical consistency moved the parameters" in note for note in physical.notes)
    assert any("not positive definite in" in warning for warning in plain.warnings)


@pytest.mark.parametrize("resting", slow_but_for([(3, 4, 5)], [(3, 4, 5), (1, 2, 3, 4, 5)]))
@pytest.mark.parametrize("physical", [True, False])
def test_joints_that_rest_and_ripple_show_nothing_of_themselves(model, resting, physical: bool):
    """2e-4 rad of white noise on joints held at rest, the torques of their motion left in: a fit of noise was 15,000
    and more in friction, all of it called identified."""
    log = read_log(UR10_LOG / "exciting_trajectory.csv").ordered(model.joint_names)
    position = np.array(log.position)
    rng = np.random.default_rng(4)
    for k in resting:
        position[:, k] = position[:, k].mean() + 2e-4 * rng.standard_normal(len(position))
    rippled = replace(log, position=position, velocity=None)

    options = CalibrateOptions(physical=physical)
    record = calibrate_logs(model, [rippled], options, ChainRegressor(model), None, lambda step: None)

    own = {(row.joint, row.name): row for row in record.friction}
    for k in resting:
        for name in ("coulomb", "viscous"):
            row = own[model.joint_names[k], name]
            assert row.value == pytest.approx(0.0, abs=1e-3)
            assert row.visibility.startswith("not visible")
    assert max(abs(row.value) for row in record.friction) < np.abs(log.effort).max()
    assert max(abs(row.value) for row in record.parameters) < 20.0
    assert sum(row.identifiable for row in record.parameters) <= 40 - 6 * len(resting)
