"""A KR6 with springs and more friction, of Pinocchio's torques and closed forms alone: nothing of psdmc computes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from bundled import bundled_robot

from psdmc.calibration.logs.log import Log
from psdmc.robot.reference import Reference, reference

NAMES = tuple(f"joint_{k}" for k in range(1, 7))
SIGN_SPEED = 0.03
NOISE = np.array([0.3, 0.3, 0.3, 0.05, 0.05, 0.05])
COULOMB = np.array([2.0, 2.5, 1.5, 0.6, 0.5, 0.4])
VISCOUS = np.array([1.0, 1.2, 0.8, 0.3, 0.2, 0.2])
OFFSET = np.array([0.5, -0.4, 0.3, 0.1, -0.1, 0.05])

BASE_POINT, ARM_POINT = np.array([0.12, 0.05, 0.25]), np.array([0.10, 0.03, 0.02])
GAS = {"force": 900.0, "rate": 700.0, "friction": 12.0, "length": 0.4}
"""N at 0.4 m, N/m, N: between the base and link 2."""
TORSION = {"stiffness": 8.0, "rest": 0.3}
"""N m/rad about joint 3."""
CABLE = {"stiffness": 20.0, "ratios": np.array([0.0, 0.0, 0.0, 0.5, -0.8, 0.0])}
ASYMMETRY = {"joint_1": 0.7, "joint_4": -0.2}
"""N m: half of what Coulomb friction differs by between the directions."""
STRIBECK = {"joint_1": 1.1, "joint_2": 1.4, "joint_5": 0.4}
STRIBECK_SPEED = 0.15
LOADED = np.array([0.0, 0.06, 0.05, 0.0, 0.0, 0.0])
"""N m of friction per N m of the rigid bodies' torque."""

State = tuple[np.ndarray, np.ndarray, np.ndarray]
Torque = Callable[[Reference, State], np.ndarray]


def gas_spring(robot: Reference, state: State) -> np.ndarray:
    """By Pinocchio's positions and Jacobians of the two points: the motors hold against a push along the line."""
    q, qd, _ = state
    data, frame = robot.model.createData(), robot.model.getFrameId("link2")
    torque = np.zeros_like(q)
    for k in range(len(q)):
        pin.computeJointJacobians(robot.model, data, q[k])
        pin.updateFramePlacements(robot.model, data)
        place = data.oMf[frame]
        arm = place.rotation @ ARM_POINT
        jacobian = pin.getFrameJacobian(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED)
        velocity = jacobian[:3] - pin.skew(arm) @ jacobian[3:]
        apart = place.translation + arm - BASE_POINT
        length = float(np.linalg.norm(apart))
        slope = apart / length @ velocity
        push = GAS["force"] + GAS["rate"] * (GAS["length"] - length)
        torque[k] = (GAS["friction"] * np.tanh(float(slope @ qd[k]) / 0.01) - push) * slope
    return torque


def torsional_spring(robot: Reference, state: State) -> np.ndarray:
    torque = np.zeros_like(state[0])
    torque[:, 2] = TORSION["stiffness"] * (state[0][:, 2] - TORSION["rest"])
    return torque


def cable(robot: Reference, state: State) -> np.ndarray:
    return CABLE["stiffness"] * (state[0] @ CABLE["ratios"])[:, None] * CABLE["ratios"]


def asymmetric(robot: Reference, state: State) -> np.ndarray:
    size = np.array([ASYMMETRY.get(name, 0.0) for name in NAMES])
    return np.asarray(size * np.abs(np.tanh(state[1] / SIGN_SPEED)))


def stribeck(robot: Reference, state: State) -> np.ndarray:
    peak = np.array([STRIBECK.get(name, 0.0) for name in NAMES])
    qd = state[1]
    return np.asarray(np.tanh(qd / SIGN_SPEED) * peak * np.exp(-((qd / STRIBECK_SPEED) ** 2)))


def loaded(robot: Reference, state: State) -> np.ndarray:
    rigid = robot.inverse_dynamics(*state)
    return np.asarray(LOADED * np.abs(rigid) * np.tanh(state[1] / SIGN_SPEED))


@dataclass(frozen=True)
class Run:
    """How the arm is moved: amplitude of each of four sines a joint (rad), how long (s)."""

    seed: int = 1
    amplitude: float = 0.3
    seconds: float = 60.0
    offset: bool = True


def recorded(path: Path, effects: tuple[Torque, ...], how: Run = Run()) -> Log:
    """A log of 100 Hz with these effects beside rigid bodies and plain friction; the file's name is the log's."""
    rng = np.random.default_rng(how.seed)
    time = np.arange(0.0, how.seconds, 0.01)
    rates, starts = rng.uniform(0.3, 4.0, (4, 6)), rng.uniform(0.0, 6.0, (4, 6))
    turning = np.einsum("t,kj->tkj", time, rates) + starts
    q, qd = how.amplitude * np.sin(turning).sum(axis=1), how.amplitude * (rates * np.cos(turning)).sum(axis=1)
    qdd = -how.amplitude * (rates**2 * np.sin(turning)).sum(axis=1)
    robot, state = reference(bundled_robot("kr6")), (q, qd, qdd)
    torque = robot.inverse_dynamics(*state) + np.tanh(qd / SIGN_SPEED) * (COULOMB + VISCOUS * np.abs(qd))
    torque = torque + (OFFSET if how.offset else 0.0)
    torque = torque + sum(effect(robot, state) for effect in effects)
    torque = torque + rng.normal(size=torque.shape) * NOISE
    q = q + rng.normal(scale=2e-6, size=q.shape)
    return Log(path.stem, NAMES, time, q, None, torque, "motor_torque")
