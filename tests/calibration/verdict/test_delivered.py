"""Every printed figure is the written file's: read back, it predicts the logs as well as JSON and console say."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import status
from shared_data import UR10_LOG
from slow_cases import slow_but_for
from test_ur10 import model as ur10_model  # noqa: F401  a fixture
from unoptimised import wrapper

from psdmc.calibration.calibrate import CalibrateOptions, calibrate, calibrate_campaign, calibrate_logs
from psdmc.calibration.campaign_file import read_campaign
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.identify.steps import InertialRun
from psdmc.calibration.logs.log import Log, StoredLog
from psdmc.calibration.logs.log_files import open_log, read_log, write_log
from psdmc.calibration.verdict.delivered import delivered_quality
from psdmc.calibration.verdict.record import Calibration
from psdmc.cli.calibrating import print_accuracy
from psdmc.compiler import emit_c
from psdmc.errors import InputError
from psdmc.model.calibrated_json import document
from psdmc.model.load import load
from psdmc.model.parameter_checks import check_mass_matrix
from psdmc.model.store import save
from psdmc.report.calibrate_report import write_report
from psdmc.toolchain.build_package import build_package

FEW = ("inverse_dynamics", "forward_dynamics")
"""Functions of the packages; of one, the default ones."""


def written_log(log: Log, path: Path) -> Path:
    columns = {"time_s": log.time}
    for k, name in enumerate(log.joint_names):
        columns[f"position_rad.{name}"] = log.position[:, k]
        columns[f"motor_torque_nm.{name}"] = log.effort[:, k]
    np.savez(path, **columns)
    return path


def require_delivered(record: Calibration, source, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """File, JSON and console agree; the mass matrix is positive definite."""
    save(record.model, folder / "calibrated.npz")
    _, numbers = write_report(record, folder / "page.html")
    file = load(folder / "calibrated.npz")
    said = json.loads(numbers.read_text(encoding="utf-8"))["quality"]
    capsys.readouterr()
    print_accuracy(record)
    console = capsys.readouterr().out

    steps = delivered_quality(file, source)

    assert {step.step for step in steps} == set(said)
    for step in steps:
        assert step.joints.keys() == said[step.step].keys()
        for name, both in step.joints.items():
            for part in ("fit", "held_out"):
                found, told = getattr(both, part), said[step.step][name][part]
                assert found.r2 == pytest.approx(told["r2"], abs=1e-9, nan_ok=True)
                assert found.rmse == pytest.approx(told["rmse"], rel=1e-9)
            assert f"{both.held_out.r2:.4f}" in console
    assert file.calibrated is not None
    assert document(file.calibrated)["quality"] == said
    mass = check_mass_matrix(file)
    assert mass is not None
    assert mass.passed


def require_package(record: Calibration, folder: Path, functions: Sequence[str] | None = FEW) -> None:
    emit_c(record.model, folder / "c", functions=functions)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CC", str(wrapper(folder)))
        assert "forward_dynamics" in build_package(folder / "c")


@pytest.fixture(scope="module")
def ur10(ur10_model) -> tuple[Log, Calibration]:  # noqa: F811
    if not UR10_LOG.exists():
        pytest.skip("the UR10 log is not part of the project")
    path = UR10_LOG / "exciting_trajectory.csv"
    return read_log(path), calibrate(ur10_model, path, regressor=ChainRegressor(ur10_model))


def test_one_log(arm, log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = written_log(log, tmp_path / "log.npz")

    record = calibrate(arm.model, path, regressor=arm.regressor)

    require_delivered(record, [read_log(path)], tmp_path, capsys)
    require_package(record, tmp_path, functions=None)


@pytest.mark.parametrize("variant", slow_but_for(["noisy"], ["noisy", "harness"]))
def test_a_campaign(
    variant: str, request: pytest.FixtureRequest, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder, record = request.getfixturevalue(variant)

    require_delivered(record, read_campaign(folder), tmp_path, capsys)
    require_package(record, tmp_path)


def test_the_ur10(ur10: tuple[Log, Calibration], tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    log, record = ur10
    require_delivered(record, [log], tmp_path, capsys)


@pytest.mark.slow
def test_the_ur10s_package_builds(ur10: tuple[Log, Calibration], tmp_path: Path):
    require_package(ur10[1], tmp_path)


def test_a_model_that_was_not_calibrated_is_said(arm, log: Log):
    with pytest.raises(InputError, match="holds no calibration"):
        delivered_quality(arm.model, [log])


def test_without_a_solver_the_remedy_is_said(arm, log: Log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        sys.modules["psdmc.links.pseudo_inertias"],
        "find_spec",
        lambda name: None if name == "clarabel" else found(name),
    )
    path = written_log(log, tmp_path / "log.npz")

    with pytest.raises(InputError, match="physical consistency needs clarabel, not installed") as caught:
        calibrate(arm.unknown, path, regressor=arm.regressor)
    assert "pip install 'psdmc[calibrate]'" in str(caught.value.hint)
    assert "--no-physical" in str(caught.value.hint)
    calibrate(arm.unknown, path, CalibrateOptions(physical=False), regressor=arm.regressor)


def test_physical_is_the_default_of_the_command(
    arm, log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """The elbow's torques say that its friction drives it: bare, its Coulomb friction is negative."""
    pushed = replace(log, effort=log.effort - 1.2 * np.tanh(np.gradient(log.position, 0.004, axis=0) / 0.03))
    path = written_log(pushed, tmp_path / "log.npz")
    save(arm.unknown, tmp_path / "model.npz")

    def coulomb(*options: str) -> list[float]:
        assert status("calibrate", tmp_path / "model.npz", path, "-o", tmp_path / "out.npz", *options) == 0
        found = load(tmp_path / "out.npz").calibrated
        assert found is not None
        return [row.value for row in found.friction if row.name == "coulomb"]

    assert min(coulomb("--no-physical")) < 0
    capsys.readouterr()
    assert min(coulomb()) >= 0
    assert "physical consistency moved the parameters" in capsys.readouterr().out
    assert min(coulomb("--physical")) >= 0
    assert "note: --physical is the default;" in capsys.readouterr().out


@pytest.mark.slow
def test_a_campaign_that_shows_little_keeps_the_files_values(
    arm, noisy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """The fast run moves the shoulder alone: what only the elbow's acceleration shows stays at the file's value."""
    runs = read_campaign(noisy[0])
    poor = replace(runs, inertial=[InertialRun(runs.friction[0].log)])
    plain = CalibrateOptions()
    lugre = replace(plain.campaign.lugre, law="coulomb_viscous")
    options = replace(plain, campaign=replace(plain.campaign, passes=1, lugre=lugre))
    wrong = arm.model.theta_b + 0.05 * (np.arange(arm.model.l) == 6)

    model = replace(arm.model, theta_b=wrong)
    record = calibrate_campaign(model, poor, options, arm.regressor, None, lambda step: None)

    elbow_drive = record.parameters[6]
    assert elbow_drive.equation == "Im2"
    assert elbow_drive.value == pytest.approx(wrong[6], rel=1e-3)
    assert elbow_drive.visibility.startswith("not visible: kept at")
    assert "the file's value" in elbow_drive.visibility
    assert np.isinf(elbow_drive.std)
    assert record.parameters[2].identifiable
    assert any("theta_b[6] Im2: not visible" in warning for warning in record.warnings)
    require_delivered(record, poor, tmp_path, capsys)
    require_package(record, tmp_path)


def test_a_log_of_currents_in_pieces(arm, log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    constants = {"shoulder": 12.0, "elbow": 5.0}
    currents = replace(log, effort=log.effort / [12.0, 5.0], quantity="current")
    write_log(currents, tmp_path / "currents.csv")
    stored = open_log(tmp_path / "currents.csv", held=10_000)
    assert isinstance(stored, StoredLog)

    options = CalibrateOptions()
    record = calibrate_logs(arm.model, [stored], options, arm.regressor, constants, lambda step: None)

    require_delivered(record, [stored], tmp_path, capsys)
    require_delivered(record, [currents], tmp_path, capsys)
    require_package(record, tmp_path)


def test_files_may_be_given_by_their_paths(arm, plant_log: Log, noisy, tmp_path: Path):
    """Of a model, a log, a description, and a campaign."""
    record = calibrate_logs(
        arm.model, [plant_log], CalibrateOptions(), arm.regressor, None, lambda step: None
    )
    save(record.model, tmp_path / "calibrated.npz")
    written = written_log(plant_log, tmp_path / "log.npz")
    (tmp_path / "log.toml").write_text('[[log]]\nfile = "log.npz"\n', encoding="utf-8")
    (wanted,) = delivered_quality(record.model, [plant_log])

    for source in (written, str(written), [written], tmp_path / "log.toml"):
        (found,) = delivered_quality(tmp_path / "calibrated.npz", source)
        assert found.joints == wanted.joints

    folder, of_campaign = noisy
    given = [delivered_quality(of_campaign.model, source) for source in (folder, read_campaign(folder))]
    assert [step.joints for step in given[0]] == [step.joints for step in given[1]]
