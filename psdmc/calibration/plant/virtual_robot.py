"""Simulates a robot with known parameters: Pinocchio's dynamics, friction, and imperfect sensors.

It has its own code for robot files and sensors. Friction torques come from the friction laws, but SciPy's stiff
integrator integrates their states, and not the step that the calibration uses. The motion of the motors is prescribed,
as by a stiff position controller, and the motors give the torque that it needs. Links of elastic joints move behind.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import ODEintWarning, odeint

from psdmc.calibration.logs.foreign_bytes import decoding
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.calibration.plant.elastic import Elastic
from psdmc.calibration.plant.plant_file import (
    SIGN_SPEED,
    Harness,
    JointTruth,
    PlantRobot,
    PlantUrdf,
    Sensors,
    read_plant,
)
from psdmc.errors import InputError
from psdmc.friction.law import At, Term, tanh
from psdmc.robot.urdf.pinocchio_text import JOINT_PREFIX, pinocchio_model

RELATIVE_ERROR = 1e-9
"""Of the bristle deflection, per step of the stiff integrator."""
ABSOLUTE_ERROR = 1e-14
"""rad: a millionth of the stiffest joint's smallest deflection of interest."""
LONGEST_STEP = 2e-3
"""s: no reversal of a sine below 50 Hz is stepped over."""


@dataclass(frozen=True, slots=True)
class Payload:
    """A load at the tip: mass in kg, and its centre of mass `com` in m in the tip frame."""

    mass: float
    com: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class VirtualRobot:
    """A simulated robot: Pinocchio's model, motors, friction, sensors, and optionally a cable harness."""

    name: str
    model: Any
    tip: Any
    joints: tuple[JointTruth, ...]
    sensors: Sensors
    harness: Harness | None = None
    terms: tuple[Term, ...] = ()
    sign_speed: float = SIGN_SPEED

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def sliding(self) -> tuple[str, ...]:
        """Names of the joints that slide."""
        kinds = [self.model.joints[k].shortname() for k in range(1, self.model.njoints)]
        pairs = zip(self.joint_names, kinds, strict=True)
        return tuple(name for name, kind in pairs if kind.startswith("JointModelP"))

    @property
    def stiffness(self) -> Array:
        """Return the joint stiffnesses (n,), N m/rad (N/m). Zero means that the joint is rigid."""
        return np.array([joint.joint_stiffness for joint in self.joints])

    def held_torque(self, q: Array) -> Array:
        """Return the torques (..., n) that hold the harness, if the robot has one, at positions q (..., n)."""
        if self.harness is None:
            return np.zeros_like(q)
        held = np.array([name in self.harness.joints for name in self.joint_names])
        return np.where(held, self.harness.torque * np.tanh(q / self.harness.angle), 0.0)


def load_virtual_robot(
    path: str | Path, *, ideal_sensors: bool = False, harness: bool = False
) -> VirtualRobot:
    """Return a virtual robot from its plant file (TOML), in which `robot` names a DH table or a URDF in the same
    folder.

    ideal_sensors  True: sensors without noise, quantisation and delay
    harness        True: with the cable harness in the file

    Raises InputError with the faults of either file.
    """
    plant = read_plant(Path(path))
    if harness and plant.harness is None:
        raise InputError(
            f"{path}: no [harness] in this file", "leave --harness out, or add a [harness] to the plant"
        )
    with decoding(str(path), "a robot that Pinocchio takes", "correct the robot's file"):
        if isinstance(plant.robot, PlantUrdf):
            model, tip = _model_of_urdf(plant.robot, plant.joints)
        else:
            model, tip = _pinocchio_model(plant.robot)
    sensors = Sensors(encoders=plant.sensors.encoders) if ideal_sensors else plant.sensors
    held = plant.harness if harness else None
    return VirtualRobot(
        plant.robot.name, model, tip, plant.joints, sensors, held, plant.terms, plant.sign_speed
    )


def _model_of_urdf(robot: PlantUrdf, joints: Sequence[JointTruth]) -> tuple[Any, Any]:
    """Pinocchio's model of a URDF with the plant's joints, and the tip's placement in the last one."""
    names = [JOINT_PREFIX + joint.name for joint in joints]
    model = pinocchio_model(robot.text, robot.name, [joint.name for joint in joints])
    if list(model.names)[1:] != names:
        order = ", ".join(name.removeprefix(JOINT_PREFIX) for name in list(model.names)[1:])
        raise InputError(f"{robot.name}: joints in another order than the plant's", f"list them as {order}")
    model.armature = np.array([joint.drive_inertia for joint in joints])
    frame = model.frames[model.getFrameId(robot.tip, pin.FrameType.BODY)]
    if frame.parentJoint != model.njoints - 1:
        raise InputError(
            f"{robot.name}: link {robot.tip} does not hang on the last joint", "give another tip"
        )
    return model, frame.placement


def _pinocchio_model(robot: PlantRobot) -> tuple[Any, Any]:
    """Pinocchio's model of a standard DH table, and the tip's placement in the last joint."""
    model = pin.Model()
    model.gravity.linear = np.array(robot.gravity)
    parent, placement = 0, pin.SE3.Identity()
    for row in robot.rows:
        turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, row.theta), np.zeros(3))
        rest = pin.SE3(pin.rpy.rpyToMatrix(row.alpha, 0.0, 0.0), np.array([row.a, 0.0, row.d]))
        before, after = (placement * turn, rest) if row.slides else (placement, turn * rest)
        kind = pin.JointModelPZ() if row.slides else pin.JointModelRZ()
        parent = model.addJoint(parent, kind, before, row.name)
        body = pin.Inertia(row.mass, np.array(row.com), np.array(row.inertia_com))
        model.appendBodyToJoint(parent, body, after)
        armature = np.array(model.armature)
        armature[model.joints[parent].idx_v] = row.drive_inertia
        model.armature = armature
        placement = after
    return model, placement


def simulate(
    robot: VirtualRobot, trajectory: Trajectory, *, payload: Payload | None = None, seed: int = 0
) -> Log:
    """Return the log of the robot's sensors while it runs a trajectory from rest: a row per time step."""
    times = np.minimum(trajectory.time + robot.sensors.effort_delay, trajectory.duration)
    motors = _at(trajectory, times)
    rigid, tau, position = _torques(robot, trajectory, _loaded(robot, payload), motors, times)
    tau = tau + _friction(robot, trajectory, motors[0], motors[1], rigid)
    rng = np.random.default_rng(seed)
    current = tau / np.array([joint.torque_constant for joint in robot.joints])
    current = current + robot.sensors.current_noise * rng.standard_normal(current.shape)
    step, both = robot.sensors.position_step, robot.stiffness.any() and robot.sensors.encoders == "both"
    logged = trajectory.q if robot.sensors.encoders == "motor" else position
    return Log(
        name=robot.name,
        joint_names=robot.joint_names,
        time=trajectory.time,
        position=_quantised(logged, step),
        velocity=None,
        effort=_quantised(current, robot.sensors.current_step),
        quantity="current",
        sliding=trajectory.sliding,
        motor_position=_quantised(trajectory.q, step) if both else None,
    )


def _torques(
    robot: VirtualRobot, trajectory: Trajectory, model: Any, motors: tuple[Array, Array, Array], times: Array
) -> tuple[Array, Array, Array]:
    """Torques of bodies and rotors (N, n) at `times`, these with the harness, and link positions at the rows' times."""
    own = robot.stiffness > 0
    if not own.any():
        rigid = _rigid_torque(model, *motors)
        return rigid, rigid + robot.held_torque(motors[0]), trajectory.q
    links, rotors = model.copy(), np.where(own, model.armature, 0.0)
    links.armature = np.where(own, 0.0, model.armature)
    damping = np.array([joint.joint_damping for joint in robot.joints])
    c = _quintic(trajectory.q, trajectory.qd, trajectory.qdd, trajectory.period)
    elastic = Elastic(
        links,
        robot.stiffness,
        damping,
        _motion_function(c, trajectory.period),
        robot.held_torque,
        robot.joint_names,
    )
    every = np.union1d(trajectory.time, times)
    q, qd, qdd = elastic.links(every)
    at, rows = np.searchsorted(every, times), np.searchsorted(every, trajectory.time)
    rigid = _rigid_torque(links, q[at], qd[at], qdd[at]) + rotors * motors[2]
    return rigid, rigid + robot.held_torque(q[at]), np.where(own, q[rows], trajectory.q)


def _quantised(values: Array, step: float) -> Array:
    return np.round(values / step) * step if step > 0 else values


def _loaded(robot: VirtualRobot, payload: Payload | None) -> Any:
    if payload is None:
        return robot.model
    model = robot.model.copy()
    body = pin.Inertia(payload.mass, np.array(payload.com), np.zeros((3, 3)))
    model.appendBodyToJoint(model.njoints - 1, body, robot.tip)
    return model


def _rigid_torque(model: Any, q: Array, qd: Array, qdd: Array) -> Array:
    data = model.createData()
    return np.array([pin.rnea(model, data, a, b, c) for a, b, c in zip(q, qd, qdd, strict=True)])


def _at(trajectory: Trajectory, times: Array) -> tuple[Array, Array, Array]:
    """Position, speed and acceleration between the rows: the quintic that meets all three at both ends."""
    h = trajectory.period
    k = np.clip((times / h + 1e-9).astype(int), 0, len(trajectory.time) - 2)
    s = np.clip(times - trajectory.time[k], 0.0, h)[:, None]
    c = _quintic(trajectory.q, trajectory.qd, trajectory.qdd, h)[:, k]
    q = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    qd = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5])))
    qdd = 2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5]))
    return q, qd, qdd


def _quintic(q: Array, v: Array, a: Array, h: float) -> Array:
    """(6, N-1, ...) coefficients in the time since each row."""
    move = q[1:] - q[:-1] - h * v[:-1] - 0.5 * h**2 * a[:-1]
    rate = v[1:] - v[:-1] - h * a[:-1]
    bend = a[1:] - a[:-1]
    return np.stack(
        [
            q[:-1],
            v[:-1],
            0.5 * a[:-1],
            (10 * move - 4 * h * rate + 0.5 * h**2 * bend) / h**3,
            (-15 * move + 7 * h * rate - h**2 * bend) / h**4,
            (6 * move - 3 * h * rate + 0.5 * h**2 * bend) / h**5,
        ]
    )


def _friction(robot: VirtualRobot, trajectory: Trajectory, q: Array, qd: Array, rigid: Array) -> Array:
    """(N, n) friction of all joints at positions, speeds and rigid torques (N, n) of each row's time plus the delay."""
    found = np.zeros_like(rigid)
    sign = tanh(qd / robot.sign_speed)
    for k, joint in enumerate(robot.joints):
        for term in robot.terms:
            p = [joint.friction[name] for name in term.names]
            if term.law.state is None:
                found[:, k] += term.torque(p, At(q[:, k], qd[:, k], sign[:, k], rigid[:, k]))
            else:
                found[:, k] += _with_state(joint, term, p, trajectory, k, robot.sensors.effort_delay)
    return found


def _with_state(
    joint: JointTruth, term: Term, p: list[float], trajectory: Trajectory, k: int, delay: float
) -> Array:
    """Torque of a law with a state, which is zero at first; nothing where the joint rests."""
    state = term.law.state
    if state is None or not trajectory.qd[:, k].any():
        return np.zeros(len(trajectory.time))
    rate = state.rate
    speed = _speed_function(trajectory, k)
    times = np.minimum(trajectory.time + delay, trajectory.duration)
    grid = times if delay == 0 else np.concatenate([[0.0], times])

    def change(z: Array, t: float) -> float:
        return float(rate(p, speed(t), float(z[0])))

    def jacobian(z: Array, t: float) -> list[list[float]]:
        v = speed(t)
        return [[float(rate(p, v, 1.0) - rate(p, v, 0.0))]]

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ODEintWarning)  # raised below, with the joint's name
        bend, told = odeint(
            change,
            [0.0],
            grid,
            Dfun=jacobian,
            rtol=RELATIVE_ERROR,
            atol=ABSOLUTE_ERROR,
            hmax=LONGEST_STEP,
            mxstep=100_000,
            full_output=True,
        )
    if told["message"] != "Integration successful.":
        raise InputError(
            f"joint {joint.name}: its friction cannot be integrated: {told['message']}",
            "give the joint a friction that changes more slowly",
        )
    torque = [
        float(term.torque(p, At(v=speed(t), z=float(z))))
        for t, z in zip(grid.tolist(), bend[:, 0], strict=True)
    ]
    return np.array(torque[len(grid) - len(times) :])


def _motion_function(coefficients: Array, h: float) -> Callable[[float], tuple[Array, Array, Array]]:
    """Return a fast function of one time that computes what `_at` does, from the coefficients of `_quintic`."""
    pieces = np.ascontiguousarray(coefficients.transpose(1, 0, 2))
    last = len(pieces) - 1

    def motion(t: float) -> tuple[Array, Array, Array]:
        index = min(max(int(t / h), 0), last)
        s = t - index * h
        powers = [
            [1.0, s, s**2, s**3, s**4, s**5],
            [0.0, 1.0, 2 * s, 3 * s**2, 4 * s**3, 5 * s**4],
            [0.0, 0.0, 2.0, 6 * s, 12 * s**2, 20 * s**3],
        ]
        q, qd, qdd = np.array(powers) @ pieces[index]
        return q, qd, qdd

    return motion


def _speed_function(trajectory: Trajectory, k: int) -> Callable[[float], float]:
    h = trajectory.period
    c = _quintic(trajectory.q[:, k], trajectory.qd[:, k], trajectory.qdd[:, k], h)
    rows = np.stack([c[1], 2 * c[2], 3 * c[3], 4 * c[4], 5 * c[5]], axis=1).tolist()
    last = len(rows) - 1

    def speed(t: float) -> float:
        index = min(max(int(t / h), 0), last)
        s = t - index * h
        v, a, b, d, e = rows[index]
        return float(v + s * (a + s * (b + s * (d + s * e))))

    return speed
