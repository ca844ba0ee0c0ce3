"""Several logs of one robot: each log's share in the parameters, and the log of another load, friction or robot."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import status
from scipy import signal
from worn_arm import COULOMB, VISCOUS, Worn, recorded

from psdmc.calibration.calibrate import CalibrateOptions, calibrate
from psdmc.calibration.identify.linear_fit import LinearResult, calibrate_linear
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.log_information import LogInformation, log_information
from psdmc.calibration.logs.log_files import read_log, write_log
from psdmc.calibration.plant.virtual_robot import Payload
from psdmc.calibration.sources import plain_sources
from psdmc.model.store import save
from psdmc.progress import silent

GOOD = 20


@pytest.fixture(scope="module")
def folder(arm, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The arm's model, twenty logs of it as it is, and logs of other loads, frictions and arms."""
    path = tmp_path_factory.mktemp("many")
    save(arm.model, path / "arm.npz")
    table = arm.folder / "two_link.toml"
    for k in range(GOOD):
        recorded(path, f"good{k}", Worn(seed=k), table)
    heavier = path / "heavier.toml"
    heavier.write_text(
        table.read_text(encoding="utf-8").replace("mass = 1.5", "mass = 1.6"), encoding="utf-8"
    )
    recorded(path, "loaded", Worn(seed=31, load=Payload(0.1, (0.0, 0.0, 0.05))), table)
    recorded(path, "warm", Worn(seed=32, viscous=(0.9 * VISCOUS[0], VISCOUS[1])), table)
    recorded(path, "other", Worn(seed=33), heavier)
    recorded(path, "noisy", Worn(seed=34, noise=0.05), table)
    log = read_log(path / "good0.csv")
    still = log.position.copy()
    still[:, 0] = 0.0
    qd, qdd = _rates(still, log.time)
    rest = arm.regressor.regressor(still, qd, qdd) @ arm.model.theta_b
    rest += np.array(COULOMB) * np.tanh(qd / 0.03) + np.array(VISCOUS) * qd
    rest += 0.05 * np.random.default_rng(5).standard_normal(rest.shape)
    write_log(
        replace(log, name="elbow_only", position=still, velocity=None, effort=rest), path / "elbow_only.csv"
    )
    return path


def _rates(q: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    qd = np.gradient(q, time, axis=0)
    return qd, np.gradient(qd, time, axis=0)


def fitted(arm, folder: Path, *names: str, **how: int) -> tuple[LinearResult, LogInformation | None]:
    logs = [read_log(folder / f"{name}.csv") for name in names]
    options = LinearOptions(**how)
    chain = arm.model.mechanism
    found = calibrate_linear(chain, arm.regressor, arm.model.l, logs, options, theta_b=arm.model.theta_b)
    return found, log_information(found.problem, found.estimate, names)


def test_twenty_sets_of_good_logs_raise_no_alarm(arm, folder: Path):
    statistics = []
    for k in range(GOOD):
        found = fitted(arm, folder, *(f"good{(k + i) % GOOD}" for i in range(4)))[1]
        assert found is not None
        assert (found.odd, found.disagree, found.noisier) == ((), False, ())
        statistics.append(found.statistics)
    assert 0.6 < np.mean(statistics) < 1.3


def test_noise_that_lasts_is_no_contradiction(arm, folder: Path):
    statistics = []
    for k in range(0, GOOD, 4):
        names = [f"good{i}" for i in range(k, k + 4)]
        for i, name in enumerate(names):
            log = read_log(folder / f"{name}.csv")
            white = np.random.default_rng(k + i).standard_normal((len(log.time), 2))
            noise = signal.lfilter([0.1], [1.0, -0.9], white, axis=0)
            write_log(
                replace(log, name=f"slow_{name}", effort=log.effort + noise), folder / f"slow_{name}.csv"
            )
        found = fitted(arm, folder, *(f"slow_{name}" for name in names))[1]
        assert found is not None
        assert (found.odd, found.disagree) == ((), False)
        statistics.append(found.statistics)
    assert 0.05 < np.mean(statistics) < 1.3


@pytest.mark.parametrize("bad", ["loaded", "warm", "other"])
@pytest.mark.parametrize("at", [0, 2])
def test_the_log_of_another_robot_is_named(arm, folder: Path, bad: str, at: int):
    names = ["good1", "good2", "good3"]
    names.insert(at, bad)

    found = fitted(arm, folder, *names)[1]

    assert found is not None
    assert [each["log"] for each in found.odd] == [bad]
    assert not found.disagree
    assert found.odd[0]["rmse"] > 2.0 * found.odd[0]["own"]


def test_a_noisy_log_is_named_and_does_not_contradict(arm, folder: Path):
    found = fitted(arm, folder, "good1", "noisy", "good2", "good3")[1]

    assert found is not None
    assert found.odd == ()
    (name, ratio), *others = found.noisier
    assert (name, others) == ("noisy", [])
    assert 2.0 < ratio < 5.5


def test_two_logs_disagree_and_one_log_is_not_compared(arm, folder: Path):
    found = fitted(arm, folder, "good1", "loaded")[1]

    assert found is not None
    assert found.disagree
    assert fitted(arm, folder, "good1")[1] is None


def test_two_of_six_are_named_both(arm, folder: Path):
    found = fitted(arm, folder, "good1", "loaded", "good2", "good3", "good4", "warm")[1]

    assert found is not None
    assert {each["log"] for each in found.odd} == {"loaded", "warm"}
    assert not found.disagree


def test_the_shares_are_those_of_the_whole_matrix(arm, folder: Path):
    """By the whole weighted matrix in memory: derivatives of the information, and a fit without each log."""
    names = ("good1", "good2", "noisy")
    result, found = fitted(arm, folder, *names)

    assert found is not None
    problem, solved = result.problem, result.estimate
    rows = np.concatenate([block.columns for block in problem.rows]) * solved.weights[:, :, None]
    ends = np.cumsum(problem.counts)
    own = [part.reshape(-1, rows.shape[2]) for part in np.split(rows, ends[:-1])]
    step = 1e-4

    def variance(*factors: float) -> np.ndarray:
        stacked = np.vstack([np.sqrt(f) * part for f, part in zip(factors, own, strict=True)])
        r = np.linalg.qr(stacked, mode="r")
        return np.sum(np.linalg.inv(r) ** 2, axis=1)

    whole = variance(1.0, 1.0, 1.0)
    for i in range(3):
        more, less, none = ([1.0] * 3 for _ in range(3))
        more[i], less[i], none[i] = 1.0 + step, 1.0 - step, 0.0
        grown = np.log(variance(*less) / variance(*more)) / (2.0 * step)
        assert found.shares[i] == pytest.approx(grown, rel=1e-3, abs=1e-4)
        assert found.std_without[i] == pytest.approx(np.sqrt(variance(*none) / whole), rel=1e-5)
    assert found.shares.sum(axis=0) == pytest.approx(1.0, abs=1e-9)


def test_rows_on_disk_say_the_same(arm, folder: Path):
    names = ("good1", "good2", "good3", "loaded")
    (there, kept), (gone, read) = fitted(arm, folder, *names), fitted(arm, folder, *names, held_bytes=1000)

    assert (there.problem.rows.on_disk, gone.problem.rows.on_disk) == (False, True)
    assert kept is not None
    assert read is not None
    assert np.array_equal(kept.shares, read.shares)
    assert kept.odd == read.odd


def test_held_out_logs_are_not_compared(arm, folder: Path):
    record = calibrate(arm.model, [folder / "good1.csv"], validation=[folder / "loaded.csv"])

    assert "log_information" not in record.facts


def test_the_command_names_the_log_first(folder: Path, capsys: pytest.CaptureFixture[str]):
    names = [folder / f"{name}.csv" for name in ("good1", "loaded", "good2", "good3")]
    out = folder / "out.npz"

    assert status("calibrate", folder / "arm.npz", *names, "-o", out, "--report", folder / "o.html") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "verdict: usable, with doubts"
    assert lines[1].startswith(
        "  doubt: loaded.csv contradicts the other logs: they predict its torque at joint "
    )
    numbers = json.loads((folder / "o.json").read_text(encoding="utf-8"))
    assert numbers["verdict"]["codes"]["doubts"][0] == "odd_log"
    assert numbers["facts"]["log_information"]["logs"] == [name.name for name in names]
    page = (folder / "o.html").read_text(encoding="utf-8")
    assert "Which log determines which parameter" in page
    assert "odd logs" not in page


def test_what_one_log_alone_shows_is_said(arm, folder: Path):
    logs = [folder / "good1.csv", folder / "elbow_only.csv"]

    record = calibrate(arm.model, logs, CalibrateOptions(physical=False))

    (note,) = [note for note in record.notes if note.startswith("parameters that depend on one log alone")]
    assert "viscous of shoulder (good1.csv: 100% of its information)" in note
    assert "elbow_only" not in note


def test_what_needs_two_logs_together_depends_on_none_alone(arm, folder: Path):
    """Coulomb and viscous friction at one speed each: either log shows a sum of both, and only both logs show each."""
    log, names = read_log(folder / "good0.csv"), []
    for k, speed in enumerate((0.45, 0.55)):
        turn = speed * (2.0 * np.abs((log.time / 2.0) % 2.0 - 1.0) - 1.0)
        position = np.column_stack([turn, log.position[:, 1]])
        qd, qdd = _rates(position, log.time)
        effort = arm.regressor.regressor(position, qd, qdd) @ arm.model.theta_b
        effort += np.array(COULOMB) * np.tanh(qd / 0.03) + np.array(VISCOUS) * qd
        effort += 0.05 * np.random.default_rng(k).standard_normal(effort.shape)
        names.append(folder / f"even{k}.csv")
        write_log(replace(log, name=f"even{k}", position=position, velocity=None, effort=effort), names[-1])

    record = calibrate(arm.model, names, CalibrateOptions(physical=False))

    rows = {row["name"]: row for row in record.facts["log_information"]["parameters"]}
    assert max(rows["coulomb of shoulder"]["shares"]) < 0.8
    assert max(rows["coulomb of shoulder"]["std_without"]) > 10.0
    assert not any("coulomb of shoulder" in note for note in record.notes if "one log alone" in note)


def test_files_of_one_name_are_called_by_their_paths(arm, folder: Path, tmp_path: Path):
    paths = [tmp_path / name / "log.csv" for name in ("a", "b")]
    for k, path in enumerate(paths):
        path.parent.mkdir()
        path.write_bytes((folder / f"good{k}.csv").read_bytes())
    paths.append(folder / "good2.csv")
    read = plain_sources(paths, arm.model.v_names, LinearOptions(), silent)
    assert [log.name for log in read.logs] == [str(paths[0]), str(paths[1]), "good2.csv"]
