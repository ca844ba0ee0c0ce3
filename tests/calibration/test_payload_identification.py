"""Loads found in logs of an independent plant: Pinocchio's torques of the robot with a body appended, friction by its
formula, noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model
from command_line import status
from loaded_kr6 import motor_torques, sines

import psdmc
from psdmc.calibration.known_load import PayloadFound, read_load
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel

MASS, COM = 2.5, np.array([0.03, -0.02, 0.08])
INERTIA = np.array([[0.013, 0.001, 0.001], [0.001, 0.011, 0.001], [0.001, 0.001, 0.007]])
TRUTH = np.array([MASS, *COM, 0.013, 0.001, 0.011, 0.001, 0.001, 0.007])


@dataclass(frozen=True)
class Run:
    """How the arm is moved: which joints, how far (rad), for how long (s)."""

    seed: int = 1
    loaded: bool = True
    joints: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    amplitude: float = 0.2
    seconds: float = 30.0


def record(path: Path, how: Run, sign: float = 1.0) -> Path:
    rng = np.random.default_rng(how.seed)
    motion = sines(rng, how.seconds, how.amplitude, how.joints)
    torque = motor_torques(motion, pin.Inertia(MASS, COM, INERTIA) if how.loaded else None)
    torque += rng.normal(size=torque.shape) * np.array([0.3, 0.3, 0.3, 0.03, 0.03, 0.03])
    q = motion.q + rng.normal(scale=2e-6, size=motion.q.shape)
    names = bundled_model("kr6").joint_names
    write_log(Log(path.stem, names, motion.time, q, None, sign * torque, "motor_torque"), path)
    return path


@pytest.fixture(scope="module")
def kr6() -> DynamicsModel:
    return bundled_model("kr6")


@pytest.fixture(scope="module")
def with_load(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("logs") / "loaded.csv", Run())


@pytest.fixture(scope="module")
def calibrated(kr6: DynamicsModel, tmp_path_factory: pytest.TempPathFactory) -> DynamicsModel:
    """By one log of the arm without a load."""
    log = record(tmp_path_factory.mktemp("logs") / "empty.csv", Run(seed=3, loaded=False))
    found = psdmc.calibrate(kr6, log)
    assert found.verdict is not None
    assert found.verdict.usable
    return found.model


def in_sigmas(found: PayloadFound) -> np.ndarray:
    values = np.array([found.mass, *found.com, *found.inertia])
    return (values - TRUTH) / np.array([found.mass_std, *found.com_std, *found.inertia_std])


def is_right(found: PayloadFound) -> bool:
    return abs(found.mass - MASS) < 0.01 * MASS and bool(np.all(np.abs(in_sigmas(found)) < 3.0))


def test_a_load_by_the_robot_s_own_parameters(kr6: DynamicsModel, with_load: Path) -> None:
    found = psdmc.identify_payload(kr6, with_load)
    assert found.verdict.word == "usable"
    assert is_right(found)
    assert set(found.visible.values()) == {"identified"}
    assert any("is not calibrated" in note for note in found.notes)


def test_a_load_by_a_calibrated_model_is_less_certain_and_right(
    kr6: DynamicsModel, calibrated: DynamicsModel, with_load: Path
) -> None:
    found, sharper = psdmc.identify_payload(calibrated, with_load), psdmc.identify_payload(kr6, with_load)
    assert found.verdict.usable
    assert is_right(found)
    assert found.mass_std > 1.5 * sharper.mass_std


@pytest.mark.parametrize("model", ["kr6", "calibrated"])
def test_without_a_load_there_is_none(model: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    log = record(tmp_path / "empty.csv", Run(seed=2, loaded=False))
    found = psdmc.identify_payload(request.getfixturevalue(model), log)
    assert found.mass < 3.0 * found.mass_std < 0.05
    assert not found.com.any()
    assert not found.inertia.any()
    assert found.verdict.word == "usable, with doubts"
    assert "no mass is seen" in found.verdict.doubts[0]


def test_what_one_vertical_axis_does_not_show_is_said_and_not_invented(
    kr6: DynamicsModel, tmp_path: Path
) -> None:
    """A turn about gravity shows one inertia about that axis and no weight."""
    found = psdmc.identify_payload(kr6, record(tmp_path / "turning.csv", Run(joints=(0,))))
    assert found.verdict.word == "not usable"
    assert any("does not show the load's mass" in reason for reason in found.verdict.reasons)
    assert not np.isfinite([found.mass_std, *found.com_std, *found.inertia_std]).any()


def test_one_moving_joint_leaves_something_open(kr6: DynamicsModel, tmp_path: Path) -> None:
    found = psdmc.identify_payload(kr6, record(tmp_path / "one.csv", Run(joints=(1,), amplitude=0.3)))
    hidden = [name for name, word in found.visible.items() if word not in ("identified", "weakly visible")]
    assert hidden
    assert any(name in doubt for name in hidden for doubt in found.verdict.doubts)
    body = found.added_to(kr6)  # whatever is open, it is the load of a body
    assert body.theta_b is not None


def test_a_torque_of_the_other_sign_is_not_usable(kr6: DynamicsModel, tmp_path: Path) -> None:
    log = record(tmp_path / "negated.csv", Run(), sign=-1.0)
    found = psdmc.identify_payload(kr6, log)
    assert not found.verdict.usable


def test_a_short_log_is_not_usable(kr6: DynamicsModel, tmp_path: Path) -> None:
    found = psdmc.identify_payload(kr6, record(tmp_path / "short.csv", Run(seconds=3.0)))
    assert any("samples per unknown" in reason for reason in found.verdict.reasons)


def test_an_arm_that_never_moves_is_refused(kr6: DynamicsModel, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="moves"):
        psdmc.identify_payload(kr6, record(tmp_path / "still.csv", Run(joints=())))


def test_inputs_that_cannot_be_used(kr6: DynamicsModel, with_load: Path) -> None:
    with pytest.raises(InputError, match="unknown"):
        psdmc.identify_payload(replace(kr6, theta_b=None), with_load)
    with pytest.raises(InputError, match="payload frame 'flange' is not the tip"):
        psdmc.identify_payload(kr6, with_load, "flange")
    with pytest.raises(InputError, match="no log"):
        psdmc.identify_payload(kr6, [])


def test_the_command_writes_a_load_and_a_loaded_model(
    calibrated: DynamicsModel, with_load: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calibrated.save(tmp_path / "empty.npz")
    words = ["payload", str(tmp_path / "empty.npz"), str(with_load), "-o", str(tmp_path / "load.toml")]
    assert status(*words, "--loaded", tmp_path / "loaded.npz") == 0
    said = capsys.readouterr().out
    assert said.startswith("verdict: usable")
    assert "on 'link6' of 'kr6':" in said
    loaded, file = psdmc.load(tmp_path / "loaded.npz"), read_load(tmp_path / "load.toml")
    assert np.array_equal(loaded.theta_b, file.added_to(calibrated).theta_b)
    assert file.mass == pytest.approx(MASS, rel=0.01)


def test_what_is_not_usable_is_not_written(kr6: DynamicsModel, tmp_path: Path) -> None:
    kr6.save(tmp_path / "kr6.npz")
    log = record(tmp_path / "turning.csv", Run(joints=(0,)))
    words = ["payload", str(tmp_path / "kr6.npz"), str(log), "-o", str(tmp_path / "load.toml")]
    assert status(*words) == 6
    assert not (tmp_path / "load.toml").exists()


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ('frame = "a"\nmass = 1.0\ncom = [0, 0]\ninertia = [0, 0, 0, 0, 0, 0]', "com"),
        ('frame = "a"\nmass = inf\ncom = [0, 0, 0]\ninertia = [0, 0, 0, 0, 0, 0]', "mass"),
        ("frame = 3\nmass = 1.0\ncom = [0, 0, 0]\ninertia = [0, 0, 0, 0, 0, 0]", "frame"),
        ("mass = 1.0", "com, inertia, frame"),
    ],
)
def test_damaged_load_files(text: str, wrong: str, tmp_path: Path) -> None:
    (tmp_path / "load.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=f"load.toml: {wrong}: missing or no such numbers"):
        read_load(tmp_path / "load.toml")


def test_a_hostile_name_stays_a_name(kr6: DynamicsModel, with_load: Path, tmp_path: Path) -> None:
    name = 'x"\n[std]\\u0000é'
    found = replace(psdmc.identify_payload(kr6, with_load), frame=name)
    found.save(tmp_path / "load.toml")
    assert read_load(tmp_path / "load.toml").frame == name


@pytest.mark.slow
def test_half_a_kilogram_on_an_industrial_arm_is_a_changed_load(
    calibrated: DynamicsModel, kr6: DynamicsModel, tmp_path: Path
) -> None:
    motion = sines(np.random.default_rng(4), 20.0, 0.2, Run().joints)
    torque = motor_torques(motion, pin.Inertia(0.5, COM, INERTIA / 5.0))
    torque += np.random.default_rng(5).normal(size=torque.shape) * np.array([0.3, 0.3, 0.3, 0.03, 0.03, 0.03])
    log = Log("half", kr6.joint_names, motion.time, motion.q, None, torque, "motor_torque")
    write_log(log, tmp_path / "half.csv")

    found = psdmc.validate(calibrated, tmp_path / "half.csv")

    assert found.word == "changed load"
    assert found.load is not None
    assert found.load.mass == pytest.approx(0.5, abs=3.0 * found.load.mass_std)
