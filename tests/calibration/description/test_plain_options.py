"""Options of plain logs on the command line, and slow logs, whose doubt is said first."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status
from test_payload_identification import Run, record

from psdmc.calibration.description.description import read_description
from psdmc.calibration.description.read_described import described_logs
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import read_log, write_columns
from psdmc.calibration.verdict.judge import acceleration_lost, cutoff_for


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    bundled_model("kr6").save(folder / "kr6.npz")
    for seed, name in ((3, "one.csv"), (4, "two.csv")):
        record(folder / name, Run(seed=seed, loaded=False, seconds=30.0))
    return folder


def calibrated(capsys: pytest.CaptureFixture[str], folder: Path, *words: object) -> tuple[object, str]:
    code = status("calibrate", folder / "kr6.npz", *words, "-o", folder / "out.npz")
    shown = capsys.readouterr()
    return code, shown.out + shown.err


def test_validation_split_and_friction_from_the_command_line(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    code, text = calibrated(
        capsys,
        folder,
        folder / "one.csv",
        "--validate",
        folder / "two.csv",
        "--friction",
        "coulomb,viscous,viscous^2,offset",
        "--cutoff",
        "5",
        "--report",
        folder / "out.html",
    )

    assert code == 0, text
    kept = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert [log.get("use", "fit") for log in kept["facts"]["data"]] == ["fit", "validate"]
    assert kept["prediction"]["steps"]["all"]["split"]["held_out"] == 0.0
    assert kept["prediction"]["steps"]["all"]["filter"]["cutoff"] == 5.0
    assert kept["prediction"]["exponents"] == [1.0, 2.0]

    code, text = calibrated(
        capsys, folder, folder / "one.csv", "--split", "0.2,30", "--report", folder / "out.html"
    )

    kept = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert kept["prediction"]["steps"]["all"]["split"] == {"held_out": 0.2, "blocks": 30}


WRONG = {
    ("--split", "2"): "--split: 2: expected a share from 0 to 0.9",
    ("--split", "x"): "--split is 'x'",
    ("--split", "0.1,2.5"): "--split: 2.5 blocks, expected a whole number from 0 to 1000",
    ("--friction", "viscous"): "--friction: no coulomb, expected it among the terms",
    ("--friction", "coulomb,sticky"): "--friction: found 'sticky', expected coulomb, viscous",
    ("--joint-map", "a"): "--joint-map: 'a' names no joint",
    ("--joint-map", "a=joint_1,a=joint_2"): "--joint-map: 'a=joint_2' names a joint twice",
    ("--joint-map", "a=joint_1"): "--joint-map: no joint(s) 'a'",
    ("--validate", "none.csv"): "none.csv: no such file",
}


@pytest.mark.parametrize("words", WRONG)
def test_what_cannot_be_meant_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, str]
):
    code, text = calibrated(capsys, folder, folder / "one.csv", *words)

    assert code == 2
    assert WRONG[words] in text


def test_options_of_plain_logs_are_not_for_descriptions(folder: Path, capsys: pytest.CaptureFixture[str]):
    (folder / "log.toml").write_text('[[log]]\nfile = "one.csv"\n', encoding="utf-8")

    code, text = calibrated(capsys, folder, folder / "log.toml", "--joint-map", "a=joint_1")
    assert (code, "write topic in its [[log]], and logged_as in its [[joint]]" in text) == (2, True)
    code, text = calibrated(capsys, folder, folder / "log.toml", "--validate", folder / "two.csv")
    assert (code, "name the other logs in it, each as a [[log]]" in text) == (2, True)


@pytest.mark.slow
def test_joints_of_other_names(folder: Path, capsys: pytest.CaptureFixture[str]):
    text = (folder / "one.csv").read_text(encoding="utf-8")
    header, _, rows = text.partition("\n")
    (folder / "axes.csv").write_text(header.replace(".joint_", ".axis_") + "\n" + rows, encoding="utf-8")
    names = ",".join(f"axis_{k}=joint_{k}" for k in range(1, 7))

    plain, mapped = folder / "plain.json", folder / "mapped.json"
    assert calibrated(capsys, folder, folder / "one.csv", "--report", plain.with_suffix(".html"))[0] == 0
    options = ("--joint-map", names, "--report", mapped.with_suffix(".html"))
    assert calibrated(capsys, folder, folder / "axes.csv", *options)[0] == 0

    values = [json.loads(path.read_text(encoding="utf-8"))["base_parameters"] for path in (plain, mapped)]
    assert values[0] == values[1]


def test_a_log_of_25_hz_works_with_a_lower_cut_off_and_its_doubt_comes_first(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    log = read_log(record(folder / "long.csv", Run(seed=5, loaded=False, seconds=120.0)))
    slow = {"time_s": log.time[::4]}
    for k, name in enumerate(log.joint_names):
        slow |= {f"position_rad.{name}": log.position[::4, k], f"motor_torque_nm.{name}": log.effort[::4, k]}
    write_columns(slow, folder / "slow.csv")

    code, text = calibrated(capsys, folder, folder / "slow.csv")
    assert code == 2
    assert "filter a plain log at 6.25 Hz or less: --cutoff" in text
    code, text = calibrated(capsys, folder, folder / "slow.csv", "--cutoff", "5")
    assert code == 0
    first, second = text.splitlines()[:2]
    assert first.startswith("verdict: usable, with")
    assert (
        "sampled at 25 Hz and filtered at 5 Hz: accelerations of the fastest motion come out up to 12% too small"
        in (first + second)
    )
    code, text = calibrated(capsys, folder, folder / "slow.csv", "--cutoff", "3")
    assert code == 0
    assert "sampled at" not in text


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
def test_how_much_acceleration_differences_lose(share: float):
    """Against differences of a sine."""
    time = np.arange(1000.0)
    sine = np.sin(2 * np.pi * share * time)
    second = sine[2:] - 2 * sine[1:-1] + sine[:-2]
    true = -((2 * np.pi * share) ** 2) * sine[1:-1]

    assert acceleration_lost(share) == pytest.approx(
        1.0 - np.abs(second).max() / np.abs(true).max(), abs=1e-9
    )
    assert cutoff_for(acceleration_lost(share)) == pytest.approx(share, rel=2e-2)


def described(folder: Path, more: str) -> Log:
    (folder / "own.toml").write_text('[[log]]\nfile = "one.csv"\n' + more, encoding="utf-8")
    names = bundled_model("kr6").joint_names
    (log,) = described_logs(read_description(folder / "own.toml", names), names)
    assert isinstance(log, Log)
    return log


def test_start_and_end_count_from_the_first_row(folder: Path):
    whole, part = read_log(folder / "one.csv"), described(folder, "start = 2\nend = 4.5")

    assert part.time[0] == pytest.approx(2.0)
    assert part.time[-1] == pytest.approx(4.5)
    assert np.array_equal(part.position, whole.position[200:451])


def test_a_column_that_lags_is_moved_back(folder: Path):
    whole = read_log(folder / "one.csv")

    rows = described(folder, "[effort]\ndelay = 0.03")
    assert np.array_equal(rows.position, whole.position[:-3])
    assert np.abs(rows.effort - whole.effort[3:]).max() < 1e-9
    between = described(folder, "[position]\ndelay = -0.0137")
    k = np.searchsorted(whole.time, 0.0137)
    sine = np.interp(whole.time[k:] - 0.0137, whole.time, whole.position[:, 0])
    assert np.abs(between.position[:, 0] - sine).max() < 1e-3
    assert np.array_equal(between.effort, whole.effort[k:])
