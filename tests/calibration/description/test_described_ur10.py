"""A real UR10's log through a description gives what it gives by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shared_data import UR10_LOG
from slow_cases import slow_but_for
from test_ur10 import model  # noqa: F401  a fixture

from psdmc.calibration.calibrate import CalibrateOptions, calibrate
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log_files import read_log, write_columns
from psdmc.model.dynamics_model import DynamicsModel

pytestmark = pytest.mark.skipif(not UR10_LOG.exists(), reason="the UR10 log is not part of the project")

TABLE = UR10_LOG / "exciting_trajectory.csv"


def described(folder: Path, text: str) -> Path:
    (folder / "log.toml").write_text(text, encoding="utf-8")
    return folder / "log.toml"


@pytest.mark.parametrize("how", slow_but_for(["in other units"], ["as it is", "in other units"]))
def test_the_same_calibration(model: DynamicsModel, tmp_path: Path, how: str):  # noqa: F811
    log = read_log(TABLE)
    assert log.velocity is not None
    if how == "as it is":
        text = f"[[log]]\nfile = '{TABLE}'\n"
    else:
        columns = {"ms": 1000.0 * log.time}
        for k in range(6):
            columns |= {f"a{k}": -np.degrees(log.position[:, k]), f"w{k}": -np.degrees(log.velocity[:, k])}
            columns[f"m{k}"] = 1000.0 * log.effort[:, k]
        write_columns(columns, tmp_path / "own.parquet")
        units = '[time]\ncolumn = "ms"\nunit = "ms"\n[position]\nunit = "deg"\nsign = -1\n'
        units += '[velocity]\nunit = "deg/s"\nsign = -1\n[effort]\nunit = "mNm"\n'
        joints = "".join(
            f'[[joint]]\nname = "{name}"\nposition = "a{k}"\nvelocity = "w{k}"\neffort = "m{k}"\n'
            for k, name in enumerate(log.joint_names)
        )
        text = '[[log]]\nfile = "own.parquet"\n' + units + joints
    bare = CalibrateOptions(physical=False)

    ours = calibrate(model, described(tmp_path, text), bare, regressor=ChainRegressor(model))
    plain = calibrate(model, TABLE, bare, regressor=ChainRegressor(model))

    assert plain.verdict is not None
    assert ours.verdict is not None
    assert ours.verdict.word == plain.verdict.word
    theta = plain.model.known_theta_b()
    assert np.abs(ours.model.known_theta_b() - theta).max() < 1e-9 * np.abs(theta).max()
    for name, both in plain.steps[0].joints.items():
        assert ours.steps[0].joints[name].held_out.r2 == pytest.approx(both.held_out.r2, abs=1e-9)
