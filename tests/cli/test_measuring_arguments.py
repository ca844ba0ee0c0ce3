"""Arguments of excite, simulate and calibrate that cannot work: exit status 2, one line, nothing written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status

from psdmc.calibration.campaign_plan import ROWS_PER_CUTOFF
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.steps import CalibrationOptions
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.motions.trajectory import read_trajectory


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "two_link.npz"
    bundled_model("two_link_full").save(path)
    return path


def log(folder: Path, quantity: str, rate: float = 250.0) -> Path:
    time = np.arange(int(12 * rate)) / rate
    q = 0.8 * np.sin(2 * np.pi * np.array([0.31, 0.47]) * time[:, None])
    path = folder / f"{quantity}.csv"
    write_log(Log("run", ("shoulder", "elbow"), time, q, None, 3 * q, quantity), path)  # type: ignore[arg-type]
    return path


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert status(*words) == 2
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
        (("--acceleration", "1,2"), "--acceleration: 2 numbers without a joint"),
        (("--acceleration", "elbow=fast"), "--acceleration: 'fast' is no number"),
        (("--margin", "1.0"), "--margin"),
        (("--margin", "nan"), "margin"),
        (("--torque-margin", "0"), "--torque-margin"),
        (("--rate", "0"), "--rate"),
        (("--rate", "nan"), "--rate"),
        (("--rate", "50"), "--rate is 50 rows a second, expected at least 160"),
        (("--load", "3.5"), "--load is '3.5'"),
        (("--load", "0,0,0,0"), "--load: 0 kg, expected 0.001 to 10000"),
        (("--load", "1,0,nan,0"), "--load: its centre of mass"),
        (("--load", "1,0,x,0"), "--load: 'x' is no number"),
        (("--range", "elbow=1"), "--range: '1' is no range"),
        (("--range", "elbow=-1:1,elbow=0:1"), "--range: joint 'elbow' twice"),
        (("--range", "wrist=-1:1"), "limits for joint(s) 'wrist'"),
        (("--range", "elbow=nan:1"), "range nan to 1 is none"),
        (("--speed", "elbow=-1"), "speed is -1, expected more than 0"),
        (("--effort", "elbow=inf"), "effort is inf, expected more than 0"),
        (("--floor", "nan"), "floor"),
        (("--meshes", "nowhere"), "no collision shapes"),
    ],
)
def test_excite_has_bounds(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path, given: tuple[str, str], message: str
):
    assert message in refused(capsys, "excite", model, "-o", tmp_path / "campaign", *given)
    assert not (tmp_path / "campaign").exists()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--one-log", "--load", "2,0,0,0.1"), "--load is for motor runs, and --one-log has none"),
        (("--no-collisions", "--meshes", "."), "--meshes has no effect with --no-collisions"),
    ],
)
def test_options_of_excite_that_exclude_each_other(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path, given: tuple[str, ...], message: str
):
    assert message in refused(capsys, "excite", model, "-o", tmp_path / "campaign", *given)
    assert not (tmp_path / "campaign").exists()


def test_a_draft_refuses_what_it_would_not_read(
    capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path
):
    draft = tmp_path / "draft.toml"
    words = ("calibrate", "--describe", model, log(tmp_path, "motor_torque"), "-o", draft)
    further = ("--cutoff", "5", "--report", tmp_path / "page.html", "--essential", "--no-physical")

    said = refused(capsys, *words, *further)

    assert (
        "--describe drafts a description, and reads no --report, --physical/--no-physical, --cutoff," in said
    )
    assert "--essential" in said
    assert not draft.exists()


def test_excite_does_not_overwrite(capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path):
    (tmp_path / "campaign.toml").write_text("mine", encoding="utf-8")

    assert "holds a campaign already: campaign.toml" in refused(capsys, "excite", model, "-o", tmp_path)
    assert (tmp_path / "campaign.toml").read_text(encoding="utf-8") == "mine"


def test_the_plan_is_printed(capsys: pytest.CaptureFixture[str], model: Path, tmp_path: Path):
    words = [
        "excite",
        model,
        "-o",
        tmp_path / "plan",
        "--one-log",
        "--rate",
        50,
        "--duration",
        3,
        "--repeats",
        2,
    ]
    words += [
        "--acceleration",
        6,
        "--effort",
        "shoulder=90,elbow=40",
        "--range",
        "elbow=-1:1.2",
        "--margin",
        0.9,
    ]

    assert status(*words, "--floor", "-2", "--harmonics", "2", "--seconds", "1") == 0
    said = capsys.readouterr()
    assert said.out.startswith("1 run, 0.1 min of motion; trajectories 0.")
    assert "exciting motion: condition number" in said.out
    compared = next(line for line in said.out.splitlines() if line.startswith("compared: "))
    assert "standard deviations" in compared
    assert "the best of 1000 random motions that pass the same checks" in compared
    assert "torques: by theta_b without friction, at most 80% of the limits" in said.out
    assert "not checked: self-collision" in said.out
    assert "floor at -2 m: origins of joints and the tip, not their bodies, stay 10 mm above" in said.out
    assert f"psdmc calibrate {model} {tmp_path / 'plan'} -o two_link_calibrated.npz" in said.err
    motion = read_trajectory(tmp_path / "plan" / "trajectories" / "exciting.csv")
    assert motion.period == pytest.approx(0.02)
    assert -0.99 < motion.q[:, 1].min() < motion.q[:, 1].max() < 1.19
    picture = (tmp_path / "plan" / "excitation.svg").read_text(encoding="utf-8")
    assert picture.count('<g id="limit">') == 2 * 2 * 3


def test_help_says_the_rates_that_plans_need(capsys: pytest.CaptureFixture[str]):
    assert status("excite", "--help") == 0

    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    four, one = (
        ROWS_PER_CUTOFF * options.filter.cutoff
        for options in (CalibrationOptions().friction, LinearOptions())
    )
    assert f"at least {four:g}, or {one:g} with --one-log" in said


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
