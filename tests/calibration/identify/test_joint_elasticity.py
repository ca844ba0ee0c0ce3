"""Stiffness and damping of elastic joints, recovered from logs that SciPy integrated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from elastic_pendulum import ABOUT_JOINT, ROTOR, SWING, Log, friction, log_by_scipy, write_plant

from psdmc.calibration.calibrate import CalibrateOptions, calibrate, calibrate_logs
from psdmc.calibration.identify.friction import FrictionResult, JointFriction, prepared
from psdmc.calibration.identify.joint_elasticity import Elasticity, joint_elasticity
from psdmc.calibration.identify.linear_problem import ElasticityOptions, LinearOptions
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.identify.steps import FrictionRun, Robot, StepOptions
from psdmc.calibration.logs.log import StoredLog
from psdmc.calibration.logs.log_files import open_log, read_log, write_log
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.plant.spoiled import stuck
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.calibrated import NumberRow
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load
from psdmc.robot.load import load_robot

STIFFNESS, DAMPING, NOISE = 2000.0, 12.0, 2e-6
TRUTH = {"joint_stiffness": STIFFNESS, "joint_damping": DAMPING, "drive_inertia": ROTOR}


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> DynamicsModel:
    folder = tmp_path_factory.mktemp("pendulum")
    write_plant(folder, STIFFNESS, DAMPING)
    return derive_model(load_robot(folder / "pendulum.toml", drive_inertia=True).chain)


def known_delay(delay: float, std: float) -> FrictionResult | None:
    """What friction runs give that found a delay and no friction of this joint."""
    zero, own = np.zeros(7), np.append(np.zeros(7), std**2)
    other = JointFriction("other", zero, np.zeros((7, 7)), (), 0.0, 0.0, delay, with_delay=own)
    return FrictionResult({"other": other}, ()) if delay else None


def found(
    model: DynamicsModel, log: Log | StoredLog, delay: float = 0.0, late: float = 0.0, **known: float
) -> Elasticity:
    """Elasticity by a log whose delay, with the standard deviation `late`, is known."""
    options = LinearOptions(elasticity=ElasticityOptions(drive_inertia=known))
    assert model.theta_b is not None
    return joint_elasticity(
        model.mechanism,
        ChainRegressor(model),
        [log],
        options,
        Motors.torques(1),
        model.theta_b,
        known_delay(delay, late),
    )


def by_name(rows: tuple[NumberRow, ...]) -> dict[str, NumberRow]:
    return {row.name: row for row in rows}


def errors(rows: tuple[NumberRow, ...]) -> list[float]:
    """Errors in standard deviations."""
    return [(row.value - TRUTH[row.name]) / row.std for row in rows]


def test_values_lie_within_three_standard_deviations(pendulum: DynamicsModel) -> None:
    whole = np.array(
        [errors(found(pendulum, log_by_scipy(STIFFNESS, DAMPING, NOISE, s)).rows) for s in range(6)]
    )
    assert np.abs(whole).max() < 3.0
    assert np.sqrt(np.mean(whole**2)) > 0.2
    row = by_name(found(pendulum, log_by_scipy(STIFFNESS, DAMPING, NOISE, 9)).rows)["joint_stiffness"]
    assert row.std < 0.003 * STIFFNESS
    assert row.unit == "Nm/rad"


def test_noise_of_the_encoders_does_not_make_a_joint_softer(pendulum: DynamicsModel) -> None:
    logs = [log_by_scipy(STIFFNESS, DAMPING, 3e-4, seed) for seed in range(6)]
    rows = [found(pendulum, log, swing=ROTOR).rows[0] for log in logs]
    assert np.mean([row.value for row in rows]) == pytest.approx(
        STIFFNESS, rel=2e-3
    )  # 3e-3 below, without correction
    assert max(map(abs, errors(tuple(rows)))) < 3.0


def test_a_known_drive_inertia_is_needed_where_deflections_follow_the_acceleration(
    pendulum: DynamicsModel,
) -> None:
    """Without gravity, the deflection is the link's inertia times the acceleration over the stiffness."""
    log = log_by_scipy(50 * STIFFNESS, 50 * DAMPING, NOISE, 1, weight=0.0)
    plain, known = found(pendulum, log), found(pendulum, log, swing=ROTOR)
    assert not by_name(plain.rows)["joint_stiffness"].seen
    assert "state drive_inertia in [elasticity]" in plain.notes[0]
    assert set(by_name(known.rows)) == {"joint_stiffness", "joint_damping"}
    row = by_name(known.rows)["joint_stiffness"]
    assert row.seen
    assert abs(row.value - 50 * STIFFNESS) < 3.0 * row.std


def test_a_known_delay_is_not_taken_for_damping(pendulum: DynamicsModel) -> None:
    log = log_by_scipy(STIFFNESS, DAMPING, NOISE, 1)
    assert log.motor_position is not None
    early = replace(
        log.rows(0, len(log) - 2),
        effort=log.effort[2:],  # 8 ms
    )
    wrong, right = found(pendulum, early, swing=ROTOR), found(pendulum, early, 0.008, swing=ROTOR)
    assert max(map(abs, errors(right.rows))) < 3.0
    assert by_name(wrong.rows)["joint_damping"].value == pytest.approx(DAMPING + 0.008 * STIFFNESS, rel=0.3)


def test_the_uncertainty_of_a_delay_is_one_of_the_damping(pendulum: DynamicsModel) -> None:
    """It is what a delay larger by one standard deviation does to the damping."""
    log, none, std = log_by_scipy(STIFFNESS, DAMPING, NOISE, 1), 1e-9, 1e-3
    sure, unsure, moved = (
        by_name(found(pendulum, log, delay, late, swing=ROTOR).rows)["joint_damping"]
        for delay, late in ((none, 0.0), (none, std), (std, 0.0))
    )
    assert unsure.value == sure.value
    assert unsure.std == pytest.approx(np.hypot(sure.std, moved.value - sure.value), rel=0.02)
    assert unsure.std > 2.0 * sure.std


def test_the_inertia_of_a_friction_run_is_that_of_the_link(pendulum: DynamicsModel) -> None:
    """The torque without friction is that of the spring and of the rotor; SciPy integrated the link."""
    stiffness = 500.0
    log = log_by_scipy(stiffness, DAMPING, 1e-9, 1, torque_noise=1e-9)
    rate = SWING.at(log.time)[1][:, None]
    log = replace(log, effort=log.effort - friction(rate))
    model, chain = ChainRegressor(pendulum), pendulum.mechanism
    options = StepOptions(FilterOptions(cutoff=20.0))
    assert pendulum.theta_b is not None
    robot = Robot(chain, model, Motors.torques(1))
    run = prepared(robot, pendulum.theta_b, FrictionRun("swing", log, None), 0, options)
    error = (run.low_pass(run.rigid(ABOUT_JOINT + ROTOR, 0.0, 0.0)) - run.measured)[run.every]
    rigid = ROTOR * (run.qdd - np.gradient(run.qd, run.period))[run.every]
    bent = np.sqrt(np.mean(rigid**2))
    assert np.sqrt(np.mean(error**2)) < 0.1 * bent


def test_a_motor_encoder_that_stood_still_jumps(pendulum: DynamicsModel) -> None:
    log = stuck(log_by_scipy(STIFFNESS, DAMPING, NOISE, 2), 0, 12.0, 0.5, "motor_position")
    with pytest.raises(InputError, match=r"joint swing: motor_position jumps by .* rad after 12\.49"):
        calibrate_logs(pendulum, [log], CalibrateOptions(), ChainRegressor(pendulum), None, lambda _: None)


def test_a_torque_sensor_behind_the_gear_needs_no_friction(pendulum: DynamicsModel) -> None:
    log = log_by_scipy(STIFFNESS, DAMPING, NOISE, 2)
    assert log.motor_position is not None
    rate = np.gradient(log.motor_position[:, 0] - log.position[:, 0], log.time)
    bent = log.motor_position[:, 0] - log.position[:, 0] - 0.01
    spring = (STIFFNESS * bent + DAMPING * rate)[:, None]
    rows = found(pendulum, replace(log, effort=spring, quantity="joint_torque")).rows
    assert set(by_name(rows)) == {"joint_stiffness", "joint_damping"}
    assert rows[0].value == pytest.approx(STIFFNESS, rel=2e-3)


def test_a_log_on_disk_gives_what_a_log_in_memory_gives(pendulum: DynamicsModel, tmp_path: Path) -> None:
    log = log_by_scipy(STIFFNESS, DAMPING, NOISE, 3)
    write_log(log, tmp_path / "run.csv")
    stored, whole = open_log(tmp_path / "run.csv", held=10_000), read_log(tmp_path / "run.csv")
    assert isinstance(stored, StoredLog)
    assert found(pendulum, stored).rows[0].value == pytest.approx(
        found(pendulum, whole).rows[0].value, rel=1e-9
    )


def test_the_result_is_kept_in_the_model_s_file(pendulum: DynamicsModel, tmp_path: Path) -> None:
    log = log_by_scipy(STIFFNESS, DAMPING, NOISE, 4)
    options = CalibrateOptions(physical=False)
    record = calibrate_logs(pendulum, [log], options, ChainRegressor(pendulum), None, lambda step: None)
    assert max(map(abs, errors(record.elasticity))) < 3.0
    record.model.save(tmp_path / "found.npz")
    kept = load(tmp_path / "found.npz").calibrated
    assert kept is not None
    assert kept.elasticity == record.elasticity
    assert [row["name"] for row in record.as_json()["elasticity"]] == list(TRUTH)
    assert record.verdict is not None
    assert record.verdict.usable


ASKED = """
[[log]]
file = "run.csv"
[elasticity]
"""


def described(folder: Path, model: DynamicsModel, log: Log, more: str) -> InputError:
    write_log(log, folder / "run.csv")
    (folder / "log.toml").write_text(ASKED + more, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        calibrate(model, folder / "log.toml")
    return caught.value


def test_one_encoder_is_not_enough_for_a_stiffness(pendulum: DynamicsModel, tmp_path: Path) -> None:
    log = replace(log_by_scipy(STIFFNESS, DAMPING, NOISE, 5), motor_position=None)
    error = described(tmp_path, pendulum, log, "")
    assert "[elasticity] asks for the stiffness of joint(s) swing: run.csv has one position" in error.message
    assert "motor_position" in (error.hint or "")


def test_a_motor_s_own_turns_are_refused(pendulum: DynamicsModel, tmp_path: Path) -> None:
    log = log_by_scipy(STIFFNESS, DAMPING, NOISE, 6)
    assert log.motor_position is not None
    error = described(tmp_path, pendulum, replace(log, motor_position=100 * log.motor_position), "")
    assert "joint swing: motor_position moves 99." in error.message


def test_columns_of_a_motor_are_named_in_the_description(pendulum: DynamicsModel, tmp_path: Path) -> None:
    log = log_by_scipy(STIFFNESS, DAMPING, NOISE, 7)
    assert log.motor_position is not None
    table = np.column_stack([log.time, log.position, -100 * np.degrees(log.motor_position), log.effort])
    head = "time_s,place,turns,torque"
    np.savetxt(tmp_path / "run.csv", table, "%.12g", ",", header=head, comments="")
    motor = 'motor_position = { column = "turns", unit = "deg", gear_ratio = 100, sign = -1 }'
    text = f'{ASKED}joints = ["swing"]\n[[joint]]\nname = "swing"\nposition = "place"\neffort = "torque"\n{motor}\n'
    (tmp_path / "log.toml").write_text(text, encoding="utf-8")
    record = calibrate(pendulum, tmp_path / "log.toml", CalibrateOptions(physical=False))
    assert max(map(abs, errors(record.elasticity))) < 3.0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('joints = ["knee"]', "elasticity: name: found 'knee', expected joints of the model: 'swing'"),
        ("drive_inertia = { swing = -1 }", "elasticity: drive_inertia: swing: found -1, expected a number"),
        ("stiffness = 3", "elasticity: unknown key(s) 'stiffness'"),
    ],
)
def test_faults_of_the_table(pendulum: DynamicsModel, tmp_path: Path, more: str, said: str) -> None:
    log = log_by_scipy(STIFFNESS, DAMPING, NOISE, 8)
    assert said in described(tmp_path, pendulum, log, more).message
