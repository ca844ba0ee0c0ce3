"""What `psdmc calibrate` does first, and what is said once: logs before compiling, the verdict before the rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import status

from psdmc.calibration.calibrate import CalibrateOptions, calibrate
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.verdict.record import Calibration
from psdmc.compiler import derive
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.store import save
from psdmc.report.calibrate_commands import calibrate_command

ROBOT = Path(__file__).resolve().parents[2] / "examples" / "robots" / "two_link.toml"


@pytest.fixture(scope="module")
def model() -> DynamicsModel:
    return derive(ROBOT, drive_inertia=True)


def log_of(model: DynamicsModel, drift: float = 0.0) -> Log:
    time = np.arange(4000) / 200.0
    w = 2 * np.pi * np.array([0.31, 0.47])
    q = 0.9 * np.sin(w * time[:, None] + [0.0, 0.4])
    qd, qdd = 0.9 * w * np.cos(w * time[:, None] + [0.0, 0.4]), -(w**2) * q
    tau = ChainRegressor(model).regressor(q, qd, qdd) @ np.asarray(model.theta_b)
    tau = tau + np.tanh(qd / 0.03) + 0.5 * qd + 0.01 * np.random.default_rng(1).standard_normal(tau.shape)
    tau = tau + drift * np.sin(0.7 * time)[:, None]
    return Log("two", model.joint_names, time, q, qd, tau, "motor_torque")


def test_a_bad_log_is_refused_before_anything_is_compiled(
    model: DynamicsModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    save(model, tmp_path / "m.npz")
    log = log_of(model)
    write_log(replace(log, position=np.degrees(log.position), velocity=None), tmp_path / "bad.csv")
    compiled: list[str] = []
    monkeypatch.setattr(
        "psdmc.report.calibrate_commands.compile_model", lambda *a, **k: compiled.append("yes")
    )

    with pytest.raises(InputError, match="degrees"):
        calibrate_command(tmp_path / "m.npz", [tmp_path / "bad.csv"], tmp_path / "out.npz")

    assert compiled == []


@pytest.fixture(scope="module")
def record(model: DynamicsModel, tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    path = tmp_path_factory.mktemp("logs") / "two.csv"
    write_log(log_of(model, drift=0.5), path)
    return calibrate(model, path, CalibrateOptions(physical=False))


def test_what_a_doubt_says_no_warning_repeats(record: Calibration):
    assert record.verdict is not None
    assert any(
        "the model lacks an effect" in doubt and "by a factor of" in doubt for doubt in record.verdict.doubts
    )
    assert any("the residual is no noise" in text for text in record.warnings)

    assert not any("the residual is no noise" in text for text in record.unsaid)


def test_show_says_the_verdict_first_then_logs_accuracy_and_friction(
    record: Calibration, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    save(record.model, tmp_path / "calibrated.npz")

    assert status("show", tmp_path / "calibrated.npz") == 0
    said = capsys.readouterr().out
    assert record.verdict is not None
    assert said.startswith(f"verdict: {record.verdict.word}\n  doubt: ")
    places = [
        said.index(word)
        for word in ("verdict:", "log: two.csv, 4,000 rows", "R^2 held out", "coulomb", "gravity 0")
    ]
    assert places == sorted(places)
    (log,) = [line for line in said.splitlines() if line.startswith("log:")]
    assert log.endswith(" s"), "a log whose time starts at zero has no date"
    held_out = record.steps[0].joints["J1" if "J1" in record.joint_names else record.joint_names[0]].held_out
    assert f"{held_out.r2:.4f}" in said
    row = next(row for row in record.friction if row.name == "viscous")
    assert f"{row.value:.4g} +- {row.std:.1g}" in said
