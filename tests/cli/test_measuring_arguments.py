"""Arguments of excite, simulate and calibrate that cannot work: exit status 2, one line, nothing written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.cli import main
from psdmc.derivation.derive import derive_model
from psdmc.model.store import save
from psdmc.robot.load import load_robot

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "two_link.npz"
    save(derive_model(load_robot(EXAMPLES / "robots" / "two_link_full.toml").chain), path)
    return path


def log(folder: Path, quantity: str, rate: float = 250.0) -> Path:
    time = np.arange(int(12 * rate)) / rate
    q = 0.8 * np.sin(2 * np.pi * np.array([0.31, 0.47]) * time[:, None])
    path = folder / f"{quantity}.csv"
    write_log(Log("run", ("shoulder", "elbow"), time, q, None, 3 * q, quantity), path)  # type: ignore[arg-type]
    return path


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    assert left.value.code == 2
    return " ".join(capsys.readouterr().err.replace("│", " ").split())


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--duration", "1e9"), "--duration"),
        (("--duration", "nan"), "duration"),
        (("--seconds", "nan"), "seconds"),
        (("--seconds", "inf"), "seconds"),
        (("--harmonics", "1000000"), "--harmonics"),
        (("--seed", "-1"), "--seed"),
        (("--acceleration", "nan"), "acceleration"),
    ],
)
def test_excite_has_bounds(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path, given: tuple[str, str], message: str
):
    assert message in refused(capsys, "excite", model, "-o", tmp_path / "campaign", *given)
    assert not (tmp_path / "campaign").exists()


def test_excite_does_not_overwrite(capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path):
    (tmp_path / "campaign.toml").write_text("mine", encoding="utf-8")

    assert "holds a campaign already: campaign.toml" in refused(capsys, "excite", model, "-o", tmp_path)
    assert (tmp_path / "campaign.toml").read_text(encoding="utf-8") == "mine"


def test_simulate_of_a_model_says_what_a_plant_is(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path
):
    assert "such as a model: expected a plant (.toml)" in refused(capsys, "simulate", model, tmp_path)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("shoulder=2,elbow=nan", "torque constants: joint elbow: nan"),
        ("shoulder=2,elbow=0", "torque constants: joint elbow: 0"),
        ("shoulder=2,elbow=-3", "torque constants: joint elbow: -3"),
        ("shoulder=2,wrist=3", "no joint(s) 'wrist'"),
        ("shoulder=2", "no torque constant for joint(s) elbow"),
        ("shoulder=2,shoulder=3", "joint 'shoulder' twice"),
        ("=2", "'=2' names no joint"),
        ("shoulder=two", "write JOINT=NUMBER,JOINT=NUMBER"),
        ("", "no torque constants are known"),
    ],
)
def test_torque_constants_are_checked(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path, given: str, message: str
):
    words = ("calibrate", model, log(tmp_path, "current"), "-o", tmp_path / "out.npz")

    assert message in refused(capsys, *words, "--torque-constants", given)
    assert not (tmp_path / "out.npz").exists()


def test_torque_constants_are_not_for_torques(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path
):
    words = ("calibrate", model, log(tmp_path, "motor_torque"), "-o", tmp_path / "out.npz")

    text = refused(capsys, *words, "--torque-constants", "shoulder=2,elbow=3")

    assert "motor_torque.csv: holds motor_torque, which torque constants are not for" in text


def test_a_slow_log_is_told_the_cut_off_that_suits(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path
):
    words = ("calibrate", model, log(tmp_path, "motor_torque", 30.0), "-o", tmp_path / "out.npz")

    assert "filter a plain log at 7.5 Hz or less: --cutoff" in refused(capsys, *words)
    assert "cut-off is nan Hz" in refused(capsys, *words, "--cutoff", "nan")


def test_a_cut_off_is_not_for_campaigns(capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path):
    (tmp_path / "campaign.toml").write_text("", encoding="utf-8")

    text = refused(capsys, "calibrate", model, tmp_path, "-o", tmp_path / "out.npz", "--cutoff", "5")

    assert "--cutoff is for plain logs" in text
