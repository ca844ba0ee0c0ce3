"""The virtual robot against closed forms: it is what the calibration is judged by."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.identify.predictor import payload_torque
from psdmc.calibration.motions.sweeps import SweepOptions, gravity_sweep
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.calibration.plant.virtual_robot import Payload, load_virtual_robot, simulate
from psdmc.errors import InputError

RIPPLE = Path(__file__).parents[3] / "examples" / "friction_laws" / "ripple.py"
CONSTANTS = np.array([12.0, 5.0])


def resting(arm, q: list[float], count: int = 5) -> Trajectory:
    still = np.zeros((count, 2))
    return Trajectory(arm.model.joint_names, np.arange(count) * 1e-3, still + q, still, still)


def test_at_rest_the_motors_hold_the_weight(arm):
    robot = load_virtual_robot(arm.plant, ideal_sensors=True)

    log = simulate(robot, resting(arm, [0.0, 0.0]))

    # arm straight out along x: weights at their distances from the axes, gravity along -y
    elbow = 1.5 * 9.81 * (0.3 - 0.1)
    shoulder = 2.0 * 9.81 * (0.4 - 0.15) + 1.5 * 9.81 * (0.4 + 0.3 - 0.1)
    assert log.effort[0] * CONSTANTS == pytest.approx([shoulder, elbow], rel=1e-12)


def test_a_payload_adds_what_the_jacobian_says(arm):
    robot = load_virtual_robot(arm.plant, ideal_sensors=True)
    q = [0.4, -0.9]

    loaded = simulate(robot, resting(arm, q), payload=Payload(3.0, (0.1, 0.05, 0.0)))
    empty = simulate(robot, resting(arm, q))

    added = (loaded.effort - empty.effort)[0] * CONSTANTS
    expected = payload_torque(arm.model.chain, np.array([q]), 3.0, (0.1, 0.05, 0.0))[0]
    assert added == pytest.approx(expected, rel=1e-9)


def test_moving_it_agrees_with_the_model_plus_steady_friction(arm):
    robot = load_virtual_robot(arm.plant, ideal_sensors=True)
    motion = gravity_sweep(arm.model.chain, 1, SweepOptions(speed=0.2, seconds=4.0))

    torque = simulate(robot, motion).effort * CONSTANTS

    rigid = arm.regressor.regressor(motion.q, motion.qd, motion.qdd) @ arm.model.theta_b
    steady = (np.abs(motion.qdd) < 1e-9).all(axis=1) & (np.abs(motion.qd) > 0.3).all(axis=1)
    sign, speed = np.sign(motion.qd), np.abs(motion.qd)
    friction = sign * ([3.0, 1.2] + np.array([4.0, 1.5]) * speed ** np.array([0.7, 0.65]))
    assert steady.sum() > 500
    assert np.abs(torque - rigid - friction)[steady].max() < 1e-4


def test_sensors_quantise_and_delay(arm):
    robot = load_virtual_robot(arm.plant)
    ideal = load_virtual_robot(arm.plant, ideal_sensors=True)
    motion = shaken(arm)

    log, truth = simulate(robot, motion, seed=1), simulate(ideal, motion)

    steps = log.position / 5e-7
    assert np.abs(steps - np.round(steps)).max() < 1e-3
    later = truth.effort[1:] - log.effort[:-1]
    assert np.sqrt(np.mean(later**2)) == pytest.approx(np.hypot(5e-3, 1e-3 / np.sqrt(12)), rel=0.05)


def shaken(arm) -> Trajectory:
    """Fast enough for a millisecond to show in the rigid body's torque, without a reversal, where friction jumps."""
    time = np.arange(2000) * 1e-3
    w, sway = 2 * np.pi * 2.0, np.array([0.2, -0.3])
    swing = np.sin(w * time)[:, None] * sway
    slope = np.cos(w * time)[:, None] * sway * w
    drift = 1.5 * np.abs(sway) * w
    return Trajectory(
        arm.model.joint_names, time, swing + drift * time[:, None], slope + drift, -(w**2) * swing
    )


def test_the_harness_pulls_only_its_joints(arm):
    plain = load_virtual_robot(arm.plant, ideal_sensors=True)
    held = load_virtual_robot(arm.plant, ideal_sensors=True, harness=True)

    pull = (
        simulate(held, resting(arm, [1.0, 1.0])).effort - simulate(plain, resting(arm, [1.0, 1.0])).effort
    ) * CONSTANTS

    assert pull[0] == pytest.approx([0.0, 0.5 * np.tanh(1.0)])


def test_the_same_seed_gives_the_same_log(arm):
    robot = load_virtual_robot(arm.plant)

    first, second, other = (simulate(robot, resting(arm, [0.1, 0.2]), seed=seed) for seed in (1, 1, 2))

    assert np.array_equal(first.effort, second.effort)
    assert not np.array_equal(first.effort, other.effort)


def test_a_plant_whose_joints_are_not_the_robots_is_refused(arm):
    text = arm.plant.read_text(encoding="utf-8").replace('name = "elbow"', 'name = "wrist"')
    path = arm.folder / "wrong.toml"
    path.write_text(text, encoding="utf-8")

    with pytest.raises(InputError, match="wrist"):
        load_virtual_robot(path)


def test_a_plant_may_have_other_laws_and_a_law_of_its_own(arm, tmp_path):
    """Formulas are written out here; the ripple is the example's file."""
    shutil.copy(arm.folder / "two_link.toml", tmp_path)
    shutil.copy(RIPPLE, tmp_path)
    numbers = {
        "coulomb": (3.0, 1.2),
        "viscous^1.5": (0.4, 0.2),
        "load_friction": (0.1, 0.05),
        "ripple_sin": (0.9, -0.3),
        "ripple_cos": (0.0, 0.6),
    }
    lines = [
        'robot = "two_link.toml"',
        'friction = ["coulomb", "viscous^1.5", "load", "ripple.py"]',
        "[sensors]",
    ]
    for k, joint in enumerate(arm.model.joint_names):
        lines += ["[[joint]]", f'name = "{joint}"', f"torque_constant = {CONSTANTS[k]}"]
        lines += [f'"{name}" = {values[k]}' for name, values in numbers.items()]
    (tmp_path / "plant.toml").write_text("\n".join(lines), encoding="utf-8")
    motion = gravity_sweep(arm.model.chain, 1, SweepOptions(speed=0.2, seconds=2.0))

    torque = simulate(load_virtual_robot(tmp_path / "plant.toml"), motion).effort * CONSTANTS

    rigid = arm.regressor.regressor(motion.q, motion.qd, motion.qdd) @ arm.model.theta_b
    p = {name: np.array(values) for name, values in numbers.items()}
    size = p["coulomb"] + p["viscous^1.5"] * np.abs(motion.qd) ** 1.5 + p["load_friction"] * np.abs(rigid)
    waves = p["ripple_sin"] * np.sin(5 * motion.q) + p["ripple_cos"] * np.cos(5 * motion.q)
    assert np.abs(torque - (rigid + np.tanh(motion.qd / 0.03) * size + waves)).max() < 1e-9


def test_a_law_that_no_file_has_is_named(arm, tmp_path):
    shutil.copy(arm.folder / "two_link.toml", tmp_path)
    text = arm.plant.read_text(encoding="utf-8")
    (tmp_path / "plant.toml").write_text('friction = ["stick", "stribeck"]\n' + text, encoding="utf-8")
    with pytest.raises(InputError, match="friction: found 'stick', expected a law"):
        load_virtual_robot(tmp_path / "plant.toml")
