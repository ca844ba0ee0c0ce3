"""A pendulum behind an elastic joint, as files for psdmc, and simulated by SciPy alone (Spong's two equations)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.motions.trajectory import Trajectory

ROTOR, INERTIA, MASS, LENGTH, GRAVITY = 0.3, 0.5, 4.0, 0.25, 9.81
"""Drive inertia at the joint; of the link about its centre of mass; mass; distance of the centre of mass; m/s^2."""
ABOUT_JOINT = INERTIA + MASS * LENGTH**2
WEIGHT = MASS * GRAVITY * LENGTH
COULOMB, VISCOUS, SIGN_SPEED, CONSTANT = 2.0, 3.0, 0.03, 8.0

ROBOT = """
name = "pendulum"
convention = "standard"
gravity = [{gravity}]
[[joint]]
name = "swing"
type = "revolute"
a = 0.25
alpha = 0.0
d = 0.0
theta = 0.0
drive_inertia = 0.3
limits = {{ position = ["-170 deg", "170 deg"], speed = 20.0, acceleration = 200.0 }}
[joint.link]
mass = 4.0
com = [0.0, 0.0, 0.0]
inertia_com = {{ xx = 0.1, yy = 0.5, zz = 0.5, xy = 0.0, xz = 0.0, yz = 0.0 }}
"""
PLANT = """
robot = "pendulum.toml"
friction = ["coulomb", "viscous"]
[[joint]]
name = "swing"
torque_constant = 8.0
coulomb = {coulomb}
viscous = {viscous}
joint_stiffness = {stiffness}
joint_damping = {damping}
"""
UPRIGHT, LEVEL = "0.0, -9.81, 0.0", "0.0, 0.0, -9.81"
"""Gravity that acts on the joint, and gravity along its axis."""


def write_plant(
    folder: Path,
    stiffness: float,
    damping: float,
    gravity: str = UPRIGHT,
    friction: float = 1.0,
    more: str = "",
) -> Path:
    """Write the pendulum and its plant; `friction` multiplies the friction."""
    (folder / "pendulum.toml").write_text(ROBOT.format(gravity=gravity), encoding="utf-8")
    text = PLANT.format(
        coulomb=friction * COULOMB, viscous=friction * VISCOUS, stiffness=stiffness, damping=damping
    )
    (folder / "plant.toml").write_text(text.replace("[[joint]]", more + "\n[[joint]]"), encoding="utf-8")
    return folder / "plant.toml"


@dataclass(frozen=True)
class Sines:
    """A motion that is a sum of sines: sizes (rad) and angular speeds (rad/s)."""

    size: Array
    speed: Array

    def at(self, time: Array | float) -> tuple[Array, Array, Array]:
        turn = np.asarray(time)[..., None] * self.speed
        return (
            (self.size * np.sin(turn)).sum(-1),
            (self.size * self.speed * np.cos(turn)).sum(-1),
            -(self.size * self.speed**2 * np.sin(turn)).sum(-1),
        )

    def trajectory(self, time: Array) -> Trajectory:
        return Trajectory(("swing",), time, *(part[:, None] for part in self.at(time)))


SWING = Sines(np.array([0.8, 0.4, 0.15]), 2 * np.pi * np.array([0.13, 0.37, 1.1]))


def friction(rate: Array) -> Array:
    """Coulomb and viscous friction, whose sign changes over SIGN_SPEED (docs/calibration_method.md)."""
    return (COULOMB + VISCOUS * np.abs(rate)) * np.tanh(rate / SIGN_SPEED)


def link_by_scipy(
    motion: Sines, time: Array, stiffness: float, damping: float, weight: float, start: float
) -> tuple[Array, Array]:
    """Position and speed of the link behind a motor that moves as given; the link starts at that position, at the
    motor's speed."""

    def change(t: float, x: Array) -> list[float]:
        theta, rate, _ = motion.at(t)
        spring = stiffness * (theta - x[0]) + damping * (rate - x[1])
        return [x[1], float((spring - weight * np.cos(x[0])) / ABOUT_JOINT)]

    found = solve_ivp(
        change, (0, time[-1]), [start, float(motion.at(0.0)[1])], "DOP853", time, rtol=1e-10, atol=1e-12
    )
    return found.y[0], found.y[1]


@cache
def _columns(stiffness: float, damping: float, weight: float) -> tuple[Array, Array, Array, Array]:
    """Time, link, motor and torque without noise."""
    time = np.arange(0.0, 30.0, 0.004)
    theta, rate, acceleration = SWING.at(time)
    if weight:
        q, speed = link_by_scipy(SWING, time, stiffness, damping, weight, -weight / stiffness)
    else:  # in closed form, after the start
        spring = stiffness + 1j * SWING.speed * damping
        turn = (
            spring
            / (spring - ABOUT_JOINT * SWING.speed**2)
            * SWING.size
            * np.exp(1j * time[:, None] * SWING.speed)
        )
        q, speed = turn.imag.sum(-1), (1j * SWING.speed * turn).imag.sum(-1)
    torque = ROTOR * acceleration + friction(rate) + stiffness * (theta - q) + damping * (rate - speed)
    return time, q, theta, torque


def log_by_scipy(
    stiffness: float,
    damping: float,
    noise: float,
    seed: int,
    weight: float = WEIGHT,
    torque_noise: float = 0.05,
) -> Log:
    """A log of 30 s with noise of the two encoders (rad RMS) and of the torque (N m RMS)."""
    time, q, theta, torque = _columns(stiffness, damping, weight)
    rng = np.random.default_rng(seed)
    draws = rng.standard_normal((3, len(time)))
    columns = (q + noise * draws[0], theta + noise * draws[1] + 0.01, torque + torque_noise * draws[2])
    place, motor, effort = (column[:, None] for column in columns)
    return Log("run", ("swing",), time, place, None, effort, "motor_torque", motor_position=motor)
