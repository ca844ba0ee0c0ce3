"""Elastic joints of a virtual robot against closed forms and SciPy's own integration of Spong's equations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elastic_pendulum import (
    ABOUT_JOINT,
    CONSTANT,
    LEVEL,
    ROTOR,
    SWING,
    WEIGHT,
    Sines,
    friction,
    link_by_scipy,
    write_plant,
)
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.calibration.plant.virtual_robot import load_virtual_robot, simulate
from psdmc.errors import InputError

TIME = np.arange(0.0, 3.0, 0.002)


def test_a_resting_link_hangs_by_its_torque_over_the_stiffness(tmp_path: Path) -> None:
    robot = load_virtual_robot(write_plant(tmp_path, 500.0, 1.0))
    still = np.full((len(TIME), 1), 0.4)
    log = simulate(robot, Trajectory(("swing",), TIME, still, 0 * still, 0 * still))
    expected = brentq(lambda q: 500.0 * (0.4 - q) - WEIGHT * np.cos(q), -1.0, 1.0, xtol=1e-14)
    assert np.abs(log.position - expected).max() < 1e-10
    assert np.abs(CONSTANT * log.effort - 500.0 * (0.4 - expected)).max() < 1e-7
    assert log.motor_position is not None
    assert np.all(log.motor_position == 0.4)


def _response(frequency: float, stiffness: float, damping: float) -> complex:
    """Motor torque per rad of a motor that moves as exp(i w t), in closed form."""
    spring = stiffness + 1j * frequency * damping
    swung = -ABOUT_JOINT * frequency**2
    return -ROTOR * frequency**2 + spring * swung / (spring + swung)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_at_the_natural_frequency_the_motor_needs_no_torque(tmp_path: Path, share: float) -> None:
    stiffness, damping = 2000.0, 20.0
    natural = np.sqrt(stiffness * (1 / ROTOR + 1 / ABOUT_JOINT))
    robot = load_virtual_robot(write_plant(tmp_path, stiffness, damping, LEVEL, 0.0))
    motion = Sines(np.array([1e-3]), np.array([share * natural]))
    time = np.arange(0.0, 3.0, 0.0005)
    log = simulate(robot, motion.trajectory(time))
    late = time > 2.0
    turn = motion.speed[0] * time[late]
    waves = np.stack([np.sin(turn), np.cos(turn)], axis=1)
    found = np.linalg.lstsq(waves, CONSTANT * log.effort[late, 0], rcond=None)[0] / motion.size[0]
    expected = _response(motion.speed[0], stiffness, damping)
    free = abs(_response(0.5 * natural, stiffness, damping))
    assert np.abs(found - [expected.real, expected.imag]).max() < 2e-4 * free
    assert abs(complex(*_response_undamped(share * natural, stiffness))) < 1e-9 * free or share != 1.0


def _response_undamped(frequency: float, stiffness: float) -> tuple[float, float]:
    found = _response(frequency, stiffness, 0.0)
    return found.real, found.imag


def test_the_logged_torque_drives_two_free_masses_along_the_logged_motion(tmp_path: Path) -> None:
    stiffness, damping = 800.0, 6.0
    robot = load_virtual_robot(write_plant(tmp_path, stiffness, damping))
    time = np.arange(0.0, 1.5, 0.0005)
    log = simulate(robot, SWING.trajectory(time))
    torque = CONSTANT * log.effort[:, 0]

    def change(t: float, x: Array) -> list[float]:
        spring = stiffness * (x[0] - x[1]) + damping * (x[2] - x[3])
        given = np.interp(t, time, torque)
        motor = (given - float(friction(x[2])) - spring) / ROTOR
        return [x[2], x[3], motor, (spring - WEIGHT * np.cos(x[1])) / ABOUT_JOINT]

    rate = float(SWING.at(0.0)[1])
    found = solve_ivp(
        change,
        (0, 1.0),
        [0.0, float(log.position[0, 0]), rate, rate],
        "DOP853",
        time[time <= 1.0],
        rtol=1e-9,
        atol=1e-11,
        max_step=0.0005,
    )
    assert log.motor_position is not None
    rows = len(found.t)
    assert np.abs(found.y[0] - log.motor_position[:rows, 0]).max() < 1e-5
    assert np.abs(found.y[1] - log.position[:rows, 0]).max() < 1e-5
    assert np.abs(log.motor_position - log.position).max() > 1e-2


@pytest.mark.parametrize("stiffness", [3e3, 1e7])
def test_deflections_of_soft_and_stiff_joints(tmp_path: Path, stiffness: float) -> None:
    """The stiff joint is integrated implicitly; its link follows the springs' balance."""
    robot = load_virtual_robot(write_plant(tmp_path, stiffness, 1e-3 * stiffness))
    log = simulate(robot, SWING.trajectory(TIME))
    assert log.motor_position is not None
    bent = log.motor_position[:, 0] - log.position[:, 0]
    q, _ = link_by_scipy(SWING, TIME, 3e3, 3.0, WEIGHT, float(log.position[0, 0]))
    if stiffness == 3e3:
        assert np.abs(log.position[:, 0] - q).max() < 1e-9
        return
    theta, _, acceleration = SWING.at(TIME)
    carried = ABOUT_JOINT * acceleration + WEIGHT * np.cos(theta)
    own = TIME > 0.5  # after the start, at which the damper is not stretched
    slow = np.gradient(carried, TIME) * 1e-3 / stiffness  # the damper's share: (K + D d/dt) bent = carried
    assert np.abs(bent + slow - carried / stiffness)[own].max() < 2e-4 * np.abs(carried).max() / stiffness


TWO = """
name = "two"
convention = "standard"
gravity = [0.0, -9.81, 0.0]
[[joint]]
name = "upper"
type = "revolute"
a = 0.4
alpha = 0.0
d = 0.0
theta = 0.0
drive_inertia = 0.2
[joint.link]
mass = 2.0
com = [-0.2, 0.0, 0.0]
inertia_com = { xx = 0.01, yy = 0.05, zz = 0.05, xy = 0.0, xz = 0.0, yz = 0.0 }
[[joint]]
name = "lower"
type = "revolute"
a = 0.3
alpha = 0.0
d = 0.0
theta = 0.0
drive_inertia = 0.1
[joint.link]
mass = 1.5
com = [-0.1, 0.0, 0.0]
inertia_com = { xx = 0.01, yy = 0.03, zz = 0.03, xy = 0.0, xz = 0.0, yz = 0.0 }
"""
TWO_PLANT = """
robot = "two.toml"
friction = ["viscous"]
[[joint]]
name = "upper"
torque_constant = 1.0
viscous = 0.0
[[joint]]
name = "lower"
torque_constant = 1.0
viscous = 0.0
joint_stiffness = 400.0
joint_damping = 2.0
"""


def test_an_elastic_joint_on_a_rigid_one_moves_by_the_textbook_s_equations(tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(TWO, encoding="utf-8")
    (tmp_path / "plant.toml").write_text(TWO_PLANT, encoding="utf-8")
    robot = load_virtual_robot(tmp_path / "plant.toml")
    moves = (
        Sines(np.array([0.7, 0.2]), np.array([2.0, 5.0])),
        Sines(np.array([0.5, 0.3]), np.array([3.0, 6.5])),
    )
    parts = [np.stack(both, axis=1) for both in zip(*(move.at(TIME) for move in moves), strict=True)]
    log = simulate(robot, Trajectory(("upper", "lower"), TIME, *parts))
    m1, m2, l1, c1, c2, i1, i2, g = 2.0, 1.5, 0.4, 0.2, 0.2, 0.05, 0.03, 9.81

    def link(t: float, x: Array) -> tuple[float, float]:
        """Acceleration of the lower link, and torque of the upper joint."""
        (q1, v1, a1), (theta, rate, _) = (tuple(map(float, move.at(t))) for move in moves)
        q2, v2 = x
        coupled = i2 + m2 * (c2**2 + l1 * c2 * np.cos(q2))
        turned, weight = m2 * l1 * c2 * np.sin(q2), m2 * g * c2 * np.cos(q1 + q2)
        spring = 400.0 * (theta - q2) + 2.0 * (rate - v2)
        a2 = (spring - coupled * a1 - turned * v1**2 - weight) / (i2 + m2 * c2**2)
        own = 0.2 + i1 + m1 * c1**2 + i2 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * np.cos(q2))
        upper = own * a1 + coupled * a2 - turned * (2 * v1 * v2 + v2**2)
        return a2, upper + (m1 * c1 + m2 * l1) * g * np.cos(q1) + weight

    start = [float(log.position[0, 1]), float(moves[1].at(0.0)[1])]
    found = solve_ivp(
        lambda t, x: [x[1], link(t, x)[0]], (0, TIME[-1]), start, "DOP853", TIME, rtol=1e-10, atol=1e-12
    )
    assert np.abs(found.y[0] - log.position[:, 1]).max() < 1e-8
    torque = np.array([link(t, x)[1] for t, x in zip(TIME, found.y.T, strict=True)])
    assert np.abs(torque - log.effort[:, 0]).max() < 1e-5
    assert log.motor_position is not None
    assert np.array_equal(log.motor_position[:, 0], log.position[:, 0])


@pytest.mark.parametrize(("word", "moves"), [("motor", True), ("link", False)])
def test_a_robot_with_one_encoder_logs_that_side(tmp_path: Path, word: str, moves: bool) -> None:
    more = f'[sensors]\nencoders = "{word}"'
    robot = load_virtual_robot(write_plant(tmp_path, 800.0, 6.0, more=more), ideal_sensors=True)
    log = simulate(robot, SWING.trajectory(TIME))
    assert log.motor_position is None
    assert np.array_equal(log.position[:, 0], SWING.at(TIME)[0]) == moves


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("joint_stiffness = 800.0", "", "joint 'swing': joint_damping: found without joint_stiffness"),
        (
            "joint_stiffness = 800.0",
            "joint_stiffness = -1",
            "joint_stiffness: found -1, expected a number from",
        ),
        ('"both"', '"two"', "sensors: encoders: found 'two', expected one of both, motor, link"),
    ],
)
def test_faults_of_elastic_plants(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = write_plant(tmp_path, 800.0, 6.0, more='[sensors]\nencoders = "both"')
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_virtual_robot(path)
    assert said in caught.value.message


def test_springs_that_cannot_carry_the_link_are_refused(tmp_path: Path) -> None:
    robot = load_virtual_robot(write_plant(tmp_path, 1e-3, 0.0))
    with pytest.raises(InputError) as caught:
        simulate(robot, SWING.trajectory(TIME))
    assert "joint(s) swing: no deflection of at most 1 rad" in caught.value.message
