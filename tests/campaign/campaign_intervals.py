"""Whether printed standard deviations are right: simulated logs with known truth, and how often three of them hold it.

python tests/campaign/campaign_intervals.py                   200 logs of each kind of error, minutes
python tests/campaign/campaign_intervals.py --logs 20 --cases coloured

The robot is the first three joints of the virtual Denso. Each log has a motion of its own. The columns of the table:

- kind of error
- group of parameters: all that the log determines, those that the report calls identified (the value is at least twice the
  standard deviation), or those whose true value is at least twice the standard deviation
- number of estimates
- share of estimates within three standard deviations of the true value
- RMS of error over standard deviation, which is 1 where standard deviations are those of the errors
"""

from __future__ import annotations

import argparse
import tempfile
import time as clock
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy import signal

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.plant.virtual_robot import VirtualRobot, load_virtual_robot
from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
JOINTS, RATE, SECONDS = 3, 250.0, 40.0
TONES = 5
"""Sines of each joint's motion."""
REACH = 2.0
"""rad either way, within the robot's limits."""
FASTEST = 2.5
"""rad/s, within them too."""
SIGN_SPEED = 0.03
"""rad/s over which Coulomb friction changes sign, in the robot and in the fit."""
COULOMB, VISCOUS, OFFSET = np.array([[9.6, 8.9, 6.2], [24.0, 29.0, 11.0], [2.0, -1.5, 0.7]])
NOISE = np.array([3.0, 3.0, 2.0])
"""N m RMS at each joint, before the filter."""


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """A robot with known truth: psdmc's model of its file with the true theta_b, and Pinocchio's for its torques."""

    model: DynamicsModel
    plant: VirtualRobot


def _first(path: Path, joints: int) -> str:
    """The text of a robot's or plant's file, up to its first joints."""
    return "[[joint]]".join(path.read_text(encoding="utf-8").split("[[joint]]")[: joints + 1])


@cache
def robot() -> Robot:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "robot.toml").write_text(_first(EXAMPLES / "robots" / "denso_wall.toml", JOINTS))
        plant = _first(EXAMPLES / "plants" / "denso_virtual.toml", JOINTS)
        of = (
            f'robot = "{folder / "robot.toml"}"\n'  # and no harness, which holds joints that this robot lacks
        )
        (folder / "plant.toml").write_text(of + plant[plant.index("[[joint]]") :])
        chain = load_robot(folder / "robot.toml", drive_inertia=True).chain
        return Robot(derive_model(chain), load_virtual_robot(folder / "plant.toml", ideal_sensors=True))


def motion(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Time and a motion with q, qd, qdd: five sines for each joint, with random frequencies, sizes and phases."""
    time = np.arange(int(SECONDS * RATE)) / RATE
    q, qd, qdd = np.zeros((3, len(time), JOINTS))
    for _ in range(TONES):
        w = 2 * np.pi * rng.uniform(0.05, 0.9, JOINTS)
        size, phase = rng.uniform(0.3, 1.0, JOINTS) / np.maximum(w, 0.8), rng.uniform(0, 2 * np.pi, JOINTS)
        angle = w * time[:, None] + phase
        q += size * np.sin(angle)
        qd += size * w * np.cos(angle)
        qdd -= size * w**2 * np.sin(angle)
    less = np.minimum(1.0, np.minimum(REACH / np.abs(q).max(axis=0), FASTEST / np.abs(qd).max(axis=0)))
    return time, less * q, less * qd, less * qdd


# Errors


def white(rng: np.random.Generator, count: int) -> Array:
    return rng.standard_normal((count, JOINTS))


def coloured(rng: np.random.Generator, count: int, memory: float = 0.3) -> Array:
    """AR(1) of unit variance, which forgets within 0.3 s."""
    keep = np.exp(-1.0 / (memory * RATE))
    settle = int(10 * memory * RATE)
    drawn = rng.standard_normal((count + settle, JOINTS)) * np.sqrt(1.0 - keep**2)
    return np.asarray(signal.lfilter([1.0], [1.0, -keep], drawn, axis=0)[settle:])


def heavy(rng: np.random.Generator, count: int) -> Array:
    """Student's t with three degrees of freedom, ten times as large for a tenth of the time, in pieces of 0.2 s."""
    piece = int(0.2 * RATE)
    rough = rng.random((count // piece + 1, JOINTS)) < 0.1
    drawn = rng.standard_t(3, (count, JOINTS)) / np.sqrt(3.0)
    return np.asarray(drawn * np.where(np.repeat(rough, piece, axis=0)[:count], 10.0, 1.0))


def fitted_friction(q: Array, qd: Array) -> Array:
    """(N, n) friction as the fit has it."""
    return COULOMB * np.tanh(qd / SIGN_SPEED) + VISCOUS * qd + OFFSET


def real_friction(q: Array, qd: Array, slow: float = 0.05) -> Array:
    """(N, n) friction that the fit has no columns for: static friction, a viscous exponent, and a gear's ripple. `slow` is
    the share of the Coulomb friction of a ripple with a period of 1.6 rad, which resembles the torques of masses."""
    stribeck = COULOMB + 0.3 * COULOMB * np.exp(-((qd / 0.05) ** 2))
    power = VISCOUS * np.abs(qd) ** 0.65 * np.sign(qd)
    ripple = 0.05 * COULOMB * np.sin(100.0 * q) + slow * COULOMB * np.sin(4.0 * q)
    return stribeck * np.tanh(qd / SIGN_SPEED) + power + OFFSET + ripple


Noise = Callable[[np.random.Generator, int], Array]
Friction = Callable[[Array, Array], Array]
CASES: Mapping[str, tuple[Noise, Friction]] = {
    "white": (white, fitted_friction),
    "coloured": (coloured, fitted_friction),
    "heavy-tailed": (heavy, fitted_friction),
    "friction misfit": (white, real_friction),
    "friction misfit, coloured": (coloured, real_friction),
    "without slow ripple": (white, partial(real_friction, slow=0.0)),
}


def pseudo_true(friction: Friction, q: Array, qd: Array) -> dict[str, Array]:
    """The values of the fit's friction law that are nearest to the real friction in a motion, by least squares. These are
    the true ones where the law is the real one."""
    real, rows = friction(q, qd), {}
    for k in range(JOINTS):
        law = np.column_stack([np.tanh(qd[:, k] / SIGN_SPEED), qd[:, k], np.ones(len(qd))])
        rows[k] = np.linalg.lstsq(law, real[:, k], rcond=None)[0]
    return {
        name: np.array([rows[k][i] for k in range(JOINTS)])
        for i, name in enumerate(("coulomb", "viscous", "offset"))
    }


# Estimates


def ratios(case: str, physical: bool, seed: int) -> dict[str, list[float]]:
    """Error over standard deviation of everything that one log determines, by group."""
    noise, friction = CASES[case]
    of, rng = robot(), np.random.default_rng([seed, sorted(CASES).index(case)])
    time, q, qd, qdd = motion(rng)
    model, data = of.plant.model, of.plant.model.createData()
    torque = np.array([pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)])
    torque += friction(q, qd) + NOISE * noise(rng, len(time))
    names = of.model.joint_names
    log = Log(f"{case} {seed}", names, time, q, None, torque, "motor_torque")
    unknown, options = replace(of.model, theta_b=None), CalibrateOptions(physical=physical)
    found = calibrate_logs(unknown, [log], options, ChainRegressor(unknown), None, lambda _: None)
    truth, near = of.model.theta_b, pseudo_true(friction, q, qd)
    assert truth is not None
    base = [
        ((row.value - true) / row.std, row.identifiable, abs(true) > 2.0 * row.std)
        for row, true in zip(found.parameters, truth, strict=True)
        if np.isfinite(row.std)
    ]
    rubbing = [
        ((row.value - true) / row.std, row.seen, abs(true) > 2.0 * row.std)
        for row in found.friction
        for true in (near[row.name][names.index(row.joint)],)
        if np.isfinite(row.std)
    ]
    counted: dict[str, list[float]] = {}
    for group, rows in {"base parameters": base, "friction": rubbing}.items():
        counted[group] = [z for z, _, _ in rows]
        counted[f"{group}, identified"] = [z for z, seen, _ in rows if seen]
        counted[f"{group}, truly large"] = [z for z, _, large in rows if large]
    return counted


def table(cases: list[str], seeds: range, physical: bool, workers: int) -> Iterator[str]:
    """Lines of the table, and the time that each kind of error took."""
    for case in cases:
        start = clock.perf_counter()
        with ProcessPoolExecutor(workers) as pool:
            each = list(pool.map(partial(ratios, case, physical), seeds))
        for group in each[0]:
            z = np.array([value for one in each for value in one[group]])
            within, rms = np.mean(np.abs(z) < 3.0), np.sqrt(np.mean(z**2))
            yield f"| {case} | {group} | {len(z)} | {within:.2%} | {rms:.2f} |"
        yield f"  ({clock.perf_counter() - start:.0f} s)"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first log")
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--physical", action="store_true", help="with the step for physical consistency")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.logs)
    for line in table(options.cases, seeds, options.physical, options.workers):
        print(line, flush=True)


if __name__ == "__main__":
    main()
