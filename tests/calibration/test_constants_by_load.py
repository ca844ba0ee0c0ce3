"""Torque constants from two ordinary logs of an independent plant, one with a known load: Pinocchio's torques of the robot
with a body appended, friction by its formula, divided by the constants, and noise on the currents."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model
from command_line import status
from loaded_kr6 import motor_torques, sines

import psdmc
from psdmc.calibration.calibrate import CalibrateOptions
from psdmc.calibration.identify.least_squares import FitOptions
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.known_load import KnownLoad
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import open_log, write_log
from psdmc.calibration.motors_of_loads import LoadedLogs, loaded_quality
from psdmc.calibration.verdict.record import Calibration
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel

MASS, COM = 2.5, (0.1, -0.05, 0.08)
INERTIA = np.diag([0.013, 0.011, 0.007])
TRUE = np.array([36.1, 40.3, 24.4, 17.9, 14.6, 5.42])
NOISE = 5e-3
"""A, of a sample."""
LONG = 36.0
"""s. In 30 s the twentieth parameter is known to 52 % of its value; 50 % count as identified."""
TWICE = CalibrateOptions(linear=LinearOptions(fit=FitOptions(method="wls", rounds=1)))
"""Solved twice a step, not seven times: what is refused does not depend on weights of outliers, of which there are none."""
LOAD_FILE = (
    f"frame = 'link6'\nmass = {MASS}\ncom = {list(COM)}\ninertia = [0.013, 0.0, 0.011, 0.0, 0.0, 0.007]\n"
)


@dataclass(frozen=True)
class Recording:
    """How the KR6 is moved and what it carries."""

    seed: int
    loaded: bool = False
    com: tuple[float, float, float] = COM
    joints: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    quick: float = 1.0
    seconds: float = 30.0
    constants: tuple[float, ...] = tuple(TRUE)


def record(path: Path, how: Recording, quantity: str = "current") -> Path:
    """The log of one motion, the same for every recording of the same joints and speed."""
    motion = sines(np.random.default_rng(1), how.seconds, joints=how.joints, quick=how.quick)
    torque = motor_torques(motion, pin.Inertia(MASS, np.array(how.com), INERTIA) if how.loaded else None)
    noise = np.random.default_rng(how.seed)
    current = torque / np.array(how.constants) + NOISE * noise.normal(size=torque.shape)
    q = motion.q + noise.normal(scale=2e-6, size=motion.q.shape)
    names = bundled_model("kr6").joint_names
    write_log(Log(path.stem, names, motion.time, q, None, current, quantity), path)
    return path


@pytest.fixture(scope="module")
def kr6() -> DynamicsModel:
    return bundled_model("kr6")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """empty.csv, loaded.csv, two that are longer, and load.toml."""
    found = tmp_path_factory.mktemp("logs")
    record(found / "empty.csv", Recording(11))
    record(found / "loaded.csv", Recording(12, loaded=True))
    record(found / "longer_empty.csv", Recording(11, seconds=LONG))
    record(found / "longer_loaded.csv", Recording(12, loaded=True, seconds=LONG))
    (found / "load.toml").write_text(LOAD_FILE, encoding="utf-8")
    return found


@pytest.fixture(scope="module")
def found(kr6: DynamicsModel, folder: Path) -> Calibration:
    """By a model whose inertias are unknown."""
    unknown = replace(kr6, theta_b=None)
    return psdmc.calibrate(
        unknown, folder / "longer_empty.csv", loaded=folder / "longer_loaded.csv", load=folder / "load.toml"
    )


def constants(record: Calibration) -> tuple[np.ndarray, np.ndarray]:
    return np.array([row.value for row in record.motors]), np.array([row.std for row in record.motors])


def test_the_constants_are_found_within_a_per_cent_and_three_sigma(found: Calibration):
    values, std = constants(found)

    assert np.abs(values / TRUE - 1.0).max() < 0.01
    assert np.abs((values - TRUE) / std).max() < 3.0
    assert np.all(std < 0.01 * TRUE)
    assert all(row.seen for row in found.motors)


def test_the_robot_is_found_with_them(found: Calibration, kr6: DynamicsModel):
    """Base parameters come in N m, and their standard deviations contain those of the constants."""
    assert found.verdict is not None
    assert found.verdict.word == "usable"
    std = np.array([row.std for row in found.parameters])
    sure = np.array([row.identifiable for row in found.parameters])
    error = np.array([row.value for row in found.parameters]) - kr6.known_theta_b()
    assert sure.sum() >= 20
    assert np.abs(error / std)[sure].max() < 3.0


def test_the_known_load_is_followed_by_the_file_read_back(found: Calibration, folder: Path):
    load = KnownLoad(MASS, np.array(COM), np.array([0.013, 0.0, 0.011, 0.0, 0.0, 0.007]))
    again = loaded_quality(
        found.model, LoadedLogs([open_log(folder / "longer_loaded.csv")], load), LinearOptions()
    )

    kept = found.as_json()["quality"]["Motor"]
    assert set(again.joints) == set(kept)
    assert {"joint_2", "joint_3", "joint_5"} <= set(kept)
    for name, both in again.joints.items():
        assert both.held_out.r2 == pytest.approx(kept[name]["held_out"]["r2"], abs=1e-9)
        assert both.held_out.r2 > 0.99


def test_a_current_s_sign_against_its_joint_shows_as_a_negative_constant(kr6: DynamicsModel, tmp_path: Path):
    turned = tuple(TRUE * [1, -1, 1, 1, -1, 1])
    empty = record(tmp_path / "empty.csv", Recording(11, constants=turned))
    loaded = record(tmp_path / "loaded.csv", Recording(12, loaded=True, constants=turned))

    result = psdmc.calibrate(kr6, empty, loaded=loaded, load=_file(tmp_path))

    assert np.abs(constants(result)[0] / turned - 1.0).max() < 0.01
    assert any("is negative at joint(s) joint_2" in doubt for doubt in result.verdict.doubts)


def _file(folder: Path) -> Path:
    path = folder / "load.toml"
    path.write_text(LOAD_FILE, encoding="utf-8")
    return path


def refused(kr6: DynamicsModel, empty: Path, loaded: Path, load: Path | str, **given) -> InputError:
    with pytest.raises(InputError) as raised:
        psdmc.calibrate(kr6, empty, TWICE, loaded=loaded, load=load, **given)
    return raised.value


@pytest.mark.slow
def test_exchanged_logs_and_a_load_that_is_not_there_are_refused(
    kr6: DynamicsModel, folder: Path, tmp_path: Path
):
    empty, loaded, load = folder / "empty.csv", folder / "loaded.csv", folder / "load.toml"
    again = record(tmp_path / "again.csv", Recording(13))

    assert "lowers the currents where it should raise them" in refused(kr6, loaded, empty, load).message
    assert "again.csv: the load does not show" in refused(kr6, empty, again, load).message


@pytest.mark.slow
def test_a_vertical_axis_that_hardly_accelerates_is_named_with_the_remedy(kr6: DynamicsModel, tmp_path: Path):
    """The first axis is along gravity: slow motion says nothing of its constant. With it given the rest is found."""
    slow = Recording(11, quick=0.05, seconds=40.0)
    empty = record(tmp_path / "empty.csv", slow)
    loaded = record(tmp_path / "loaded.csv", replace(slow, seed=12, loaded=True))

    error = refused(kr6, empty, loaded, _file(tmp_path))

    assert (
        "joint joint_1: torque constant not found: its axis is along gravity, and the load adds at most"
        in error.message
    )
    assert "accelerate it with the load far out, or tilt the base" in error.message
    assert "found: joint_2=40." in error.message
    assert "--torque-constants for joint_1" in error.hint
    result = psdmc.calibrate(
        kr6, empty, TWICE, loaded=loaded, load=tmp_path / "load.toml", torque_constants={"joint_1": 36.1}
    )
    rows = {row.joint: row for row in result.motors}
    assert not rows["joint_1"].seen
    assert rows["joint_2"].value == pytest.approx(40.3, rel=0.01)


@pytest.mark.slow
def test_a_load_on_the_last_axis_is_named(kr6: DynamicsModel, tmp_path: Path):
    slow = Recording(11, quick=0.05, seconds=40.0, com=(0.0, 0.0, 0.08))
    empty = record(tmp_path / "empty.csv", slow)
    loaded = record(tmp_path / "loaded.csv", replace(slow, seed=12, loaded=True))

    error = refused(kr6, empty, loaded, "2.5,0,0,0.08")

    assert "joint joint_6: torque constant not found: the load hangs on its axis" in error.message
    assert "mount the load off that axis" in error.message


def test_what_does_not_belong_together_is_refused(kr6: DynamicsModel, folder: Path, tmp_path: Path):
    empty, loaded = folder / "empty.csv", folder / "loaded.csv"
    torques = [record(tmp_path / f"{k}.csv", Recording(k), "motor_torque") for k in (1, 2)]

    with pytest.raises(InputError, match="belong together"):
        psdmc.calibrate(kr6, empty, loaded=loaded)
    with pytest.raises(InputError, match="holds currents, and no torque constants are known"):
        psdmc.calibrate(kr6, empty)
    assert "torques need no torque constants" in refused(kr6, *torques, "2.5,0.1,0,0.1").message
    assert "hold different things" in refused(kr6, empty, torques[1], "2.5,0.1,0,0.1").message
    for text in ("2.5", "2.5,a,0,0", "nan,0,0,0", "-1,0,0,0", "2.5,1e9,0,0"):
        assert refused(kr6, empty, loaded, text).message.startswith("load: ")


def test_the_command_prints_the_constants_and_writes_the_model(
    kr6: DynamicsModel, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    kr6.save(tmp_path / "kr6.npz")
    words = [
        "calibrate",
        str(tmp_path / "kr6.npz"),
        str(folder / "empty.csv"),
        "-o",
        str(tmp_path / "out.npz"),
    ]
    words += ["--loaded", str(folder / "loaded.csv"), "--load", ",".join(map(str, (MASS, *COM)))]

    assert status(*words, "--report", tmp_path / "page.html") == 0
    said = capsys.readouterr().out
    assert said.startswith("verdict: usable")
    line = next(line for line in said.splitlines() if line.strip().startswith("joint_2") and "%" in line)
    assert float(line.split()[1]) == pytest.approx(40.3, rel=0.01)
    assert "note: the load is taken as a point" in said
    assert psdmc.load(tmp_path / "out.npz").theta_b is not None
    assert "loaded.csv" in (tmp_path / "page.html").read_text(encoding="utf-8")
    numbers = json.loads((tmp_path / "page.json").read_text(encoding="utf-8"))
    assert [row["file"] for row in numbers["base_parameters"]] == kr6.known_theta_b().tolist()
    assert numbers["facts"]["versions"]["psdmc"] == psdmc.__version__
    assert numbers["facts"]["with_load"][0]["rows"] == 3000
