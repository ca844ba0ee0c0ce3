"""A real UR10's log, where it is at hand: as good as the reference fit that its README states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared_data import UR10_LOG

from psdmc.calibrate.calibrate import CalibrateOptions, calibrate
from psdmc.calibrate.log_files import read_log
from psdmc.calibrate.predictor import ChainRegressor
from psdmc.calibrate.record import Calibration
from psdmc.derive.derive import derive_model
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


def test_the_fit_is_as_good_as_the_reference(model):
    record = calibrate(model, UR10_LOG / "exciting_trajectory.csv", regressor=ChainRegressor(model))

    assert np.all(np.round(held_out(record), 3) >= REFERENCE)
    assert any("motor torque" in warning for warning in record.warnings)


def test_physical_consistency_costs_at_most_a_hundredth(model):
    pytest.importorskip("cvxpy")
    log = UR10_LOG / "exciting_trajectory.csv"

    plain = calibrate(model, log, regressor=ChainRegressor(model))
    physical = calibrate(model, log, CalibrateOptions(physical=True), regressor=ChainRegressor(model))

    assert np.all(held_out(physical) >= held_out(plain) - 0.01)
    assert np.all(held_out(physical) >= REFERENCE)
