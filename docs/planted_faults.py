"""Faults planted in good logs, and what `psdmc calibrate` does: the table of docs/verdict.md.

python docs/planted_faults.py [UR10.csv]   three virtual robots, and a real UR10 if its log is given (six minutes)

Columns: robot, fault, verdict, effect, what psdmc says. The effect is the RMSE of the calibrated model on the held-out
part of the good log, divided by the RMSE of the model that the good log gives; of the joint where it is largest. For the
elastic arm, it is the change of a joint's stiffness: a factor above one.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from verdicts import EXAMPLES, denso_log, example_urdf, sines, urdf_plant

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.filter import filtered
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.logs.log_checks import CheckOptions, checked
from psdmc.calibration.logs.log_files import read_log
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.plant.spoiled import (
    ALL,
    backwards,
    borrowed,
    bridged,
    clipped,
    drifting,
    geared,
    late,
    offset,
    quantised,
    rough,
    scaled,
    stuck,
    swapped,
    turned,
    undivided,
)
from psdmc.calibration.plant.virtual_robot import simulate
from psdmc.calibration.verdict.delivered import log_parts
from psdmc.calibration.verdict.record import Calibration
from psdmc.compiler import derive
from psdmc.errors import InputError
from psdmc.model import evaluate
from psdmc.model.bodies import body_parameters, load_parameters
from psdmc.model.calibrated import code_of
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

TWO_LINK_GAINS = (12.0, 5.0)
"""N m/A of the virtual two-link arm."""
TWO_LINK = EXAMPLES / "robots" / "two_link_full.toml"
ELASTIC = "joint_stiffness = 8e3\njoint_damping = 5.0"
"""N m/rad and N m s/rad of each elastic joint."""
ROTOR = 0.3
"""kg m^2, drive inertia of each elastic joint."""
HARMLESS = 1.5
"""Ratio of RMSEs up to which a fault is harmless: a good log of another motion does as much."""
TOOL = (0.0, 0.03, 0.08)
"""m in the tip frame, centre of mass of the forgotten tool."""
TILT = np.radians(5.0)
ZERO = np.radians(2.0)


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot with a good log, and the joint (from 0) whose columns are spoiled.

    model   with the file's parameters
    tool    kg, mass of the forgotten tool
    other   function that returns a good log of another robot, whose first joint's columns replace the spoiled joint's
    derive  function from gravity to the model
    faults  names of the faults that are planted
    """

    name: str
    model: DynamicsModel
    log: Log
    joint: int
    tool: float
    other: Callable[[], Log]
    derive: Callable[[Array], DynamicsModel]
    faults: Sequence[str]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What psdmc made of a log: whether it refused the log, the sentences by their codes, and the calibration where there
    is one."""

    refused: bool
    said: Mapping[str, str]
    record: Calibration | None


def with_tool(robot: Robot) -> Log:
    """The log with the torques of a point mass at the robot's tip, which the model does not know."""
    model, log = robot.model, robot.log
    states = filtered(log, FilterOptions(cutoff=8.0))
    chain = model.mechanism
    x = np.zeros(PARAMETERS_PER_LINK * len(chain.joints))
    x[body_parameters(chain.tip_frame.joint)] = load_parameters(chain, robot.tool, TOOL)
    torque = evaluate.torques(chain, x, [states.q, states.qd, states.qdd])
    when = log.time - log.time[0]
    more = np.stack([np.interp(when, states.time, column) for column in torque.T], axis=1)
    return replace(log, effort=log.effort + more)


def tilted(gravity: Array) -> Array:
    """Gravity turned by five degrees about an axis that is level, and not one of the base's where possible."""
    g = np.asarray(gravity, dtype=np.float64)
    level = np.cross(g, [0.3, 0.5, 1.0] if abs(g[2]) < abs(g).max() else [1.0, 0.6, 0.0])
    level /= np.linalg.norm(level)
    return np.asarray(g * np.cos(TILT) + np.linalg.norm(g) * level * np.sin(TILT))


SYMPTOMS = {
    "low_r2",
    "lacking_effect",
    "not_carried_over",
    "known_badly",
    "open_parameters",
    "few_samples",
    "odd_gains",
    "wrong_gains",
    "wrong_file",
    "unjudged_scale",
    "friction_gives_power",
    "no_stiffness",
}
"""Codes that say that something is wrong, but not what."""
TOOL_FORGOTTEN = "tool forgotten"
TILTED = "gravity tilted by 5 degrees"
"""A fault of the model, not of the log."""

FAULTS: Mapping[str, Callable[[Robot], Log]] = {
    "two joints swapped": lambda of: swapped(of.log, of.joint - 1, of.joint, ALL),
    "efforts of two joints swapped": lambda of: swapped(of.log, of.joint - 1, of.joint, ["effort"]),
    "one joint of another robot": lambda of: borrowed(of.log, of.joint, of.other(), 0),
    "effort clock drifts by 0.4 %": lambda of: drifting(of.log, 0.004),
    "ten gaps of 0.4 s interpolated": lambda of: bridged(of.log, 10, 0.4),
    "torque in steps of 5 % of its range": lambda of: quantised(of.log, 0.05),
    "reduction ratio 10 % wrong": lambda of: geared(of.log, of.joint, 1.1),
    "zero position off by 2 degrees": lambda of: offset(of.log, of.joint, ZERO),
    TILTED: lambda of: of.log,
    TOOL_FORGOTTEN: with_tool,
    "torque of one joint negated": lambda of: turned(of.log, of.joint, ["effort"]),
    "torque of one joint 30 % too large": lambda of: scaled(
        of.log, [1.3 if k == of.joint else 1.0 for k in range(of.model.n)]
    ),
    "positions in degrees": lambda of: replace(of.log, position=np.degrees(of.log.position), velocity=None),
    "torques in mN m": lambda of: scaled(of.log, 1e3),
    "torque 0.1 s late": lambda of: late(of.log, round(0.1 / of.log.period)),
    "noise of 20 % on the torques": lambda of: rough(of.log, 0.2),
    "torque cut off at 60 % of its peak": lambda of: clipped(of.log, 0.6),
    "encoder stuck for 2 s": lambda of: stuck(of.log, of.joint, 5.0, 2.0),
    "time goes back by 1 s": lambda of: backwards(of.log, len(of.log) // 2, 1.0),
}
MOTOR = ["motor_position"]
MOTOR_FAULTS: Mapping[str, Callable[[Robot], Log]] = {
    "motor positions of two joints swapped": lambda of: swapped(of.log, of.joint - 1, of.joint, MOTOR),
    "motor position not divided by the gear ratio": lambda of: undivided(of.log, of.joint, 100.0),
    "gear ratio of the motor position 1 % wrong": lambda of: undivided(of.log, of.joint, 1.01),
    "motor position negated": lambda of: turned(of.log, of.joint, MOTOR),
    "motor encoder stuck": lambda of: stuck(of.log, of.joint, 0.0, np.inf, "motor_position"),
    "motor encoder stuck for 2 s": lambda of: stuck(of.log, of.joint, 5.0, 2.0, "motor_position"),
}
"""Faults of joints with two encoders."""


def calibrated(model: DynamicsModel, log: Log) -> Outcome:
    """The calibration of a log. Sentences that accuse the log come before others."""
    try:
        record = calibrate_logs(model, [log], CalibrateOptions(), ChainRegressor(model), None, lambda _: None)
    except InputError as error:
        return Outcome(True, {"error": error.message}, None)
    verdict = record.verdict
    assert verdict is not None
    grounds = (*verdict.suspected, *verdict.against, *verdict.doubted)
    said = {ground.code: ground.words for ground in grounds}
    said |= {"no_stiffness": str(note) for note in record.notes if "stiffness of joint" in note}  # noqa: B035
    said |= {code_of(note) or "note": str(note) for note in checked(log, model.mechanism, 8.0).notes}
    ranked = sorted(said, key=lambda code: code in SYMPTOMS)
    return Outcome(not verdict.usable, {code: said[code] for code in ranked}, record)


def held_out_rmse(record: Calibration, log: Log) -> Array:
    """(n,) RMSE of the calibrated model's torque on the held-out part of a log."""
    _, measured, predicted, out = log_parts(record.model, log, CheckOptions())
    return np.asarray(np.sqrt(np.mean((measured - predicted)[out] ** 2, axis=0)))


def planted(robot: Robot, fault: str) -> Outcome:
    """The calibration of a robot's log with one fault."""
    model = robot.model
    if fault == TILTED:
        model = robot.derive(tilted(model.mechanism.gravity))
    return calibrated(model, {**FAULTS, **MOTOR_FAULTS}[fault](robot))


def effect(found: Outcome, log: Log, base: Outcome, good: Array) -> float:
    """How many times the fault raises the error on the held-out part of a log, or changes the stiffness of a joint; NaN
    without a calibration."""
    if found.record is None or base.record is None:
        return float("nan")
    if log.motor_position is not None:
        wrong, right = stiffness(found.record), stiffness(base.record)
        return float(np.exp(max(abs(np.log(wrong[name] / right[name])) for name in wrong)))
    return float(np.max(held_out_rmse(found.record, log) / good))


def stiffness(record: Calibration) -> dict[str, float]:
    """The identified stiffnesses by joint, N m/rad."""
    rows = record.model.calibrated.elasticity if record.model.calibrated else ()
    return {row.joint: row.value for row in rows if row.name == "joint_stiffness" and row.seen}


@cache
def denso() -> tuple[DynamicsModel, Log]:
    model, log, _ = denso_log()
    return model, replace(log, name="denso")


def virtual_denso(other: Log) -> Robot:
    model, log = denso()
    return Robot(
        "virtual Denso", model, log, 2, 2.0, lambda: other, lambda g: _turned_base(model, g), list(FAULTS)
    )


def two_link() -> Robot:
    """A virtual arm of two links in one plane."""
    return _arm("virtual two-link arm", TWO_LINK, "", list(FAULTS))


def elastic() -> Robot:
    """The same arm with heavy rotors, elastic joints and two encoders for each joint."""
    text = TWO_LINK.read_text(encoding="utf-8").replace("limits", f"drive_inertia = {ROTOR}\nlimits")
    with tempfile.TemporaryDirectory() as folder:
        robot = Path(folder) / TWO_LINK.name
        robot.write_text(text, encoding="utf-8")
        return _arm("virtual elastic arm", robot, ELASTIC, list(MOTOR_FAULTS))


def _arm(name: str, robot: Path, more: str, faults: Sequence[str]) -> Robot:
    model, plant = urdf_plant(robot, TWO_LINK_GAINS, 1e-3, more)
    log = simulate(plant, sines(model, 25.0, 125.0))
    effort = log.effort * np.array(TWO_LINK_GAINS)
    log = replace(log, name="two-link", effort=effort, quantity="motor_torque")
    other = lambda: denso()[1]  # noqa: E731
    return Robot(name, model, log, 1, 0.5, other, lambda g: _turned_base(model, g), faults)


def _turned_base(model: DynamicsModel, gravity: Array) -> DynamicsModel:
    """The model of the same robot under another gravity."""
    from psdmc.derivation.derive import derive_model

    return derive_model(replace(model.mechanism, gravity=gravity), expand=False)


def robots(ur10: Path | None) -> Iterator[Robot]:
    """The robots, from the smallest."""
    arm = two_link()
    yield arm
    yield elastic()
    yield virtual_denso(arm.log)
    if ur10 is not None:
        model = derive(example_urdf("ur10_robot.urdf"), drive_inertia=True, expand=False)
        log = replace(read_log(ur10).ordered(model.joint_names), name="ur10")
        base = lambda g: _turned_base(model, g)  # noqa: E731
        yield Robot("real UR10", model, log, 2, 2.0, lambda: denso()[1], base, list(FAULTS))


def judged(found: Outcome, fault: str, times: float, new: Mapping[str, str]) -> str:
    """One word for what became of a fault. It is named if psdmc says what is wrong, and not only that something is."""
    if found.refused:
        return "refused"
    # only a tool is missing in the robot file; a sentence about the file names no other fault
    if set(new) - SYMPTOMS or (fault == TOOL_FORGOTTEN and "wrong_file" in new):
        return "named"
    if times <= HARMLESS:
        return "harmless"
    return "doubt" if new else "silent"


def rows(robot: Robot, faults: Sequence[str]) -> Iterator[str]:
    """Lines of the table, the good log's first."""
    base = calibrated(robot.model, robot.log)
    assert base.record is not None, base.said
    good = held_out_rmse(base.record, robot.log)
    yield f"| {robot.name} | none | {'refused' if base.refused else 'usable'} | 1.00 | {', '.join(base.said)} |"
    for fault in faults:
        word, times, words = tried(robot, fault, base, good)
        number = "" if np.isnan(times) else f"{times:.2f}"
        yield f"| {robot.name} | {fault} | {word} | {number} | {words} |"


def tried(robot: Robot, fault: str, base: Outcome, good: Array) -> tuple[str, float, str]:
    """The word for a fault, its effect, and the first sentence that the good log does not have.

    base  outcome of the good log
    good  (n,) RMSE of its calibration on held-out samples
    """
    found = planted(robot, fault)
    # a forgotten tool is no error of the log: the robot carries it
    log = with_tool(robot) if fault == TOOL_FORGOTTEN else robot.log
    times = effect(found, log, base, good)
    new = {code: text for code, text in found.said.items() if code not in base.said}
    return judged(found, fault, times, new), times, next(iter(new.values()), "")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "ur10", nargs="?", type=Path, help="a UR10's log, positions and efforts by joint name"
    )
    every = [*FAULTS, *MOTOR_FAULTS]
    parser.add_argument("--faults", nargs="*", choices=every, default=every)
    parser.add_argument("--robots", nargs="*", help="names of robots; all if left out")
    options = parser.parse_args()
    for robot in robots(options.ur10):
        if options.robots and robot.name not in options.robots:
            continue
        for line in rows(robot, [fault for fault in robot.faults if fault in options.faults]):
            print(line, flush=True)


if __name__ == "__main__":
    main()
