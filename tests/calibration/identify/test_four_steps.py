"""The four steps end to end on the virtual two-link arm: the truth comes out, and what is missing is said."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.calibrate import CalibrateOptions, calibrate
from psdmc.calibration.campaign_file import listed_runs, read_campaign
from psdmc.calibration.identify.four_steps import calibrate_four_steps
from psdmc.calibration.identify.gravity import calibrate_gravity, gravity_split
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.steps import CalibrationOptions, GravityRun, Load, Robot
from psdmc.calibration.motions.sweeps import SweepOptions, gravity_sweep
from psdmc.calibration.plant.virtual_robot import Payload, load_virtual_robot, simulate
from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign
from psdmc.errors import InputError
from psdmc.model.load import load
from psdmc.model.store import save
from psdmc.report.truth import compare


@pytest.mark.slow
def test_with_ideal_sensors_the_truth_comes_out(arm, ideal):
    found = compare(ideal[1], arm.model, load_virtual_robot(arm.plant, ideal_sensors=True))

    assert found.torque_constant < 1e-3
    assert found.gravity < 1e-3
    assert found.inertial < 5e-3
    for name in ("coulomb", "viscous", "viscous_exponent"):
        assert found.friction[name] < 0.02
    for name in ("static", "stribeck_velocity", "stiffness", "damping"):
        assert found.friction[name] < 0.10


def test_with_sensors_the_truth_lies_within_the_standard_deviations(arm, noisy):
    record = noisy[1]
    found = compare(record, arm.model, load_virtual_robot(arm.plant))

    assert found.within_three_std >= 0.95
    assert record.facts["delay_s"] == pytest.approx(1e-3, abs=1e-4)
    for step in record.steps:
        for name, both in step.joints.items():
            assert both.held_out.r2 > 0.98, (step.step, name)
    assert record.warnings == ()


@pytest.mark.slow
def test_a_campaign_with_ideal_or_with_real_sensors_is_usable(ideal, noisy):
    for _, record in (ideal, noisy):
        assert record.verdict is not None
        assert record.verdict.word == "usable"
        assert record.verdict.samples_per_unknown > 16


def test_the_calibrated_model_is_a_model_file(arm, noisy, tmp_path: Path):
    save(noisy[1].model, tmp_path / "calibrated.npz")

    again = load(tmp_path / "calibrated.npz")

    assert again.theta_b is not None
    assert again.theta_b.tolist() == [row.value for row in noisy[1].parameters]
    assert again.calibrated is not None
    assert again.calibrated.method == "four steps, physically consistent"


@pytest.mark.slow
def test_physical_consistency_moves_a_sound_estimate_by_no_more_than_its_uncertainty(arm, noisy):
    folder, physical = noisy

    plain = calibrate(arm.unknown, folder, CalibrateOptions(physical=False), regressor=arm.regressor)

    moved = np.array([row.value for row in physical.parameters]) - [row.value for row in plain.parameters]
    assert np.all(np.abs(moved) < 3 * np.array([row.std for row in plain.parameters]))


@pytest.mark.slow
def test_a_harness_that_the_model_lacks_is_noticed(harness):
    record = harness[1]

    told = " ".join(record.warnings)
    assert "the residual is no noise" in told
    assert "elbow" in told
    assert "standard deviations are widened" in told
    assert record.verdict is not None
    assert record.verdict.word == "usable, with doubts"
    assert any("lacks an effect" in doubt and "elbow" in doubt for doubt in record.verdict.doubts)


def test_plain_coulomb_and_viscous_friction_for_those_who_want_no_more(arm, noisy):
    options = CalibrateOptions()
    plain = replace(options.campaign, passes=1, lugre=replace(options.campaign.lugre, law="coulomb_viscous"))

    record = calibrate(arm.unknown, noisy[0], replace(options, campaign=plain), regressor=arm.regressor)

    shoulder = {row.name: row for row in record.friction if row.joint == "shoulder"}
    # the truth is 3.0 + 4.0 |v|^0.7: a straight line through it starts higher and rises less
    assert 3.0 < shoulder["coulomb"].value < 4.5
    assert 2.5 < shoulder["viscous"].value < 4.0
    assert shoulder["viscous_exponent"].value == 1.0
    assert record.steps[-1].joints["shoulder"].held_out.r2 > 0.97


@pytest.mark.slow
def test_friction_that_has_no_stribeck_peak_leaves_its_velocity_unseen(arm, campaign: Path):
    text = arm.plant.read_text(encoding="utf-8").replace("static = 3.8", "static = 3.0")
    flat = arm.folder / "flat.toml"
    flat.write_text(text, encoding="utf-8")
    folder = arm.folder / "flat"
    shutil.copytree(campaign.parent, folder, dirs_exist_ok=True)
    simulate_campaign(flat, folder, SimulateOptions())

    record = calibrate(arm.unknown, folder, regressor=arm.regressor)

    seen = {(row.joint, row.name): row.seen for row in record.friction}
    assert not seen["shoulder", "stribeck_velocity"]
    assert seen["elbow", "stribeck_velocity"]
    assert seen["shoulder", "coulomb"]
    (warning,) = [text for text in record.warnings if "shoulder" in text]
    assert "stribeck_velocity" in warning


def test_a_known_tool_is_taken_out_of_gravity(arm):
    chain, options = arm.model.chain, CalibrationOptions()
    robot = load_virtual_robot(arm.plant, ideal_sensors=True)
    motion = gravity_sweep(chain, 1, SweepOptions(speed=0.15, seconds=16.0, range=0.8))
    log = simulate(robot, motion, payload=Payload(2.0, (0.05, 0.02, 0.0)))
    motors = Motors(np.array([12.0, 5.0]), np.zeros(2))
    split = gravity_split(chain, arm.regressor, arm.model.l)

    def phi(tool: Load | None) -> np.ndarray:
        runs = [GravityRun(log, tool)]
        own = Robot(chain, arm.regressor, motors)
        found = calibrate_gravity(own, split, runs, options.gravity, arm.model.theta_b)
        return found.estimate.values

    truth = split.phi(arm.model.theta_b)
    assert np.abs(phi(Load(2.0, (0.05, 0.02, 0.0))) - truth).max() < 5e-2 * np.abs(truth).max()
    assert np.abs(phi(None) - truth).max() > 0.3 * np.abs(truth).max()


def test_logs_are_simulated_once(arm, ideal):
    folder = ideal[0]

    assert simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True)) == 0
    next(iter(listed_runs(folder))).log.unlink()
    assert simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True)) == 1


def test_currents_without_a_motor_step_are_refused(arm, noisy):
    runs = replace(read_campaign(noisy[0]), motor=[])

    with pytest.raises(InputError, match=r"joint\(s\) shoulder, elbow: torque constant unknown"):
        calibrate_four_steps(arm.model.chain, arm.regressor, arm.model.l, runs)


@pytest.mark.slow
def test_a_joint_that_no_load_reaches_can_be_given_its_constant(arm, noisy):
    runs = read_campaign(noisy[0])
    only = replace(runs, motor=[run for run in runs.motor if run.joint == "elbow"])
    given = {"shoulder": 12.0, "elbow": 999.0}

    with pytest.raises(InputError, match=r"joint\(s\) shoulder: torque constant unidentifiable"):
        calibrate_four_steps(arm.model.chain, arm.regressor, arm.model.l, only)
    options = replace(CalibrationOptions(), passes=1)
    found = calibrate_four_steps(
        arm.model.chain, arm.regressor, arm.model.l, only, options, torque_constants=given
    )

    assert found.motors.torque_constant == pytest.approx([12.0, 5.0], rel=1e-2)


def test_a_load_on_the_axis_leaves_the_torque_constant_unidentifiable(arm, noisy):
    from psdmc.calibration.identify.motor import calibrate_motors

    # the loaded run's currents are the unloaded one's: as if the mass hung where the elbow cannot feel it
    run = next(run for run in read_campaign(noisy[0]).motor if run.joint == "elbow")
    deaf = replace(
        run, loaded=replace(run.unloaded, effort=run.unloaded.effort), load=Load(3.0, (-0.3, 0.0, 0.0))
    )

    found = calibrate_motors(arm.model.chain, [deaf], CalibrationOptions().motor)

    assert np.isnan(found.torque_constant).all()
    assert "joint elbow: torque constant unidentifiable" in found.warnings[0]


def test_a_friction_run_where_other_joints_move_is_refused(arm, noisy):
    runs = read_campaign(noisy[0])
    wrong = replace(runs, friction=[replace(runs.friction[0], log=runs.inertial[0].log)])

    with pytest.raises(InputError, match=r"joint\(s\) elbow move in the friction run of joint shoulder"):
        calibrate_four_steps(arm.model.chain, arm.regressor, arm.model.l, wrong)


def test_a_gravity_run_that_does_not_come_back_is_refused(arm, noisy):
    runs = read_campaign(noisy[0])
    log = runs.gravity[0].log
    one_way = replace(runs, gravity=[replace(runs.gravity[0], log=log.between(0.0, 0.4 * log.duration))])

    with pytest.raises(InputError, match="does not follow the forward sweep"):
        calibrate_four_steps(arm.model.chain, arm.regressor, arm.model.l, one_way)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# nothing", r"no \[\[run\]\]"),
        ("", "is empty"),
        ("[[run]]\nstep = 'dance'\nlog = 'a.csv'", "run 1: step: found 'dance', expected one of motor"),
        ("[[run]]\nstep = 'gravity'", "run 1: log: missing"),
        ("[[run]]\nstep = 'friction'\nlog = 'a.csv'", "run 1: joint: missing"),
        (
            "[[run]]\nstep = 'motor'\njoint = 'a'\nlog = 'a.csv'\nload = 3",
            "run 1: load: found 3, expected a table",
        ),
        ("step =", "not TOML"),
    ],
)
def test_a_campaign_file_that_lacks_something_says_where(tmp_path: Path, text: str, message: str):
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")

    with pytest.raises(InputError, match=message):
        listed_runs(tmp_path)
