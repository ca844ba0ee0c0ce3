"""The verdict on good logs and on logs made wrong on purpose: the table of docs/calibration.md.

python docs/verdicts.py logs [UR10.csv]     plain logs: the virtual Denso's, and a real UR10's where its log is at hand
python docs/verdicts.py timing [UR10.csv]   twenty good logs of four virtual robots, the same clipped and late (minutes)
python docs/verdicts.py campaigns           the virtual Denso's campaign: ideal sensors, real ones, a cable harness (minutes)

Columns: exit status of `psdmc calibrate`, verdict, and the first line that speaks against the log.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_campaign, calibrate_logs
from psdmc.calibration.campaign import CampaignOptions, plan_campaign, write_campaign
from psdmc.calibration.campaign_file import read_campaign
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import read_log
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.calibration.plant.spoiled import (
    ALL,
    MOVED,
    clipped,
    decimated,
    late,
    noise_only,
    scaled,
    swapped,
    turned,
)
from psdmc.calibration.plant.virtual_robot import VirtualRobot, load_virtual_robot, simulate
from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign
from psdmc.calibration.verdict.record import Calibration
from psdmc.compiler import compile as compile_model
from psdmc.compiler import derive
from psdmc.model.dynamics_model import DynamicsModel

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
ROBOT = EXAMPLES / "robots" / "denso_wall.toml"
PLANT = EXAMPLES / "plants" / "denso_virtual.toml"
UR10_GAINS = (13.58, 14.30, 11.37, 11.24, 11.77, 11.77)
"""N m/A, as the log's publishers state them."""


def wrong_logs(log: Log, constants: np.ndarray) -> Iterator[tuple[str, Log]]:
    """The log as it is, then wrong in one way each. Joints are counted from 1, as a user does."""
    yield "as recorded", log
    yield "torques negated", scaled(log, -1.0)
    yield "torques in kN m", scaled(log, 1e-3)
    yield "amperes in the effort columns", scaled(log, list(1.0 / constants))
    yield "effort of joint 3 turned", turned(log, 2, ["effort"])
    yield "effort of joint 6 turned", turned(log, 5, ["effort"])
    yield "position of joint 2 turned", turned(log, 1, MOVED)
    yield "position and effort of joint 2 turned", turned(log, 1, ALL)
    yield "efforts of joints 2 and 3 swapped", swapped(log, 1, 2, ["effort"])
    yield "efforts of joints 5 and 6 swapped", swapped(log, 4, 5, ["effort"])
    yield "positions of joints 2 and 5 swapped", swapped(log, 1, 4, MOVED)
    yield "joints 2 and 3 swapped", swapped(log, 1, 2, ALL)
    yield "every third row", decimated(log, 3)
    yield "the first 3 s", log.between(0.0, 3.0)
    yield "the first 6 s", log.between(0.0, 6.0)
    yield "noise in the effort columns", noise_only(log)


def denso_log(
    seconds: float = 25.0, rate: float = 125.0, seed: int | None = None
) -> tuple[DynamicsModel, Log, np.ndarray]:
    """The virtual Denso through sums of sines; its currents times the true torque constants."""
    model = derive(ROBOT, drive_inertia=True)
    robot = load_virtual_robot(PLANT)
    constants = np.array([joint.torque_constant for joint in robot.joints])
    log = simulate(robot, sines(model, seconds, rate, seed), seed=seed or 0)
    return model, replace(log, effort=log.effort * constants, quantity="motor_torque"), constants


PLANTS = {"ur10_robot.urdf": UR10_GAINS, "panda.urdf": (20.0,) * 7, "ur3_robot.urdf": (5.0,) * 6}
"""URDFs of the wheel example-robot-data, and torque constants (N m/A) for virtual robots of them."""
REACH = 3.4
"""rad either way, of joints without limits or with wider ones."""


def urdf_plant(
    urdf: Path, constants: tuple[float, ...], noise: float, more: str = ""
) -> tuple[DynamicsModel, VirtualRobot]:
    """A URDF as a virtual robot: friction a tenth of each joint's largest weight torque, noise (A) as a share of it.

    more  lines of each joint in the plant file
    """
    tip = "panda_link7" if urdf.name == "panda.urdf" else None
    model = derive(urdf, drive_inertia=True, expand=False, tip=tip)
    poses = np.random.default_rng(0).uniform(-1.5, 1.5, (200, model.n))
    weight = np.abs(model.inverse_dynamics(poses, 0 * poses, 0 * poses)).max(axis=0)
    lines = [f'robot = "{urdf}"', *([] if tip is None else [f'tip = "{tip}"'])]
    lines += ["[sensors]", "position_step = 5e-6", "current_step = 1e-4", "effort_delay = 1e-3"]
    lines += [f"current_noise = {noise * float(np.median(weight / constants))}"]
    for name, constant, most in zip(model.joint_names, constants, weight, strict=True):
        rub = 0.1 * max(most, 0.1 * weight.max())
        lines += [
            "[[joint]]",
            f'name = "{name}"',
            f"torque_constant = {constant}",
        ]
        if urdf.suffix == ".urdf":  # a DH table states its own
            lines.append(f"drive_inertia = {0.1 * rub}")
        lines += [
            f"coulomb = {rub}",
            f"static = {1.3 * rub}",
            "stribeck_velocity = 0.03",
            f"viscous = {1.2 * rub}",
        ]
        lines += [more, "viscous_exponent = 0.8", f"stiffness = {2e3 * rub}", f"damping = {2 * rub}"]
    with tempfile.TemporaryDirectory() as folder:
        plant = Path(folder) / "plant.toml"
        plant.write_text("\n".join(lines), encoding="utf-8")
        return model, load_virtual_robot(plant)


def good_logs(ur10: Path | None) -> Iterator[tuple[str, DynamicsModel, Log]]:
    """Twenty good logs of four virtual robots, with several seeds, rates and noises, and a real UR10's."""
    for seed, rate in enumerate((125.0, 200.0, 250.0, 500.0, 1000.0)):
        model, log, _ = denso_log(25.0, rate, seed)
        yield f"virtual Denso, {rate:g} Hz", model, log
    for urdf, constants in PLANTS.items():
        for seed, (rate, noise) in enumerate(
            ((125.0, 1e-3), (125.0, 1e-2), (200.0, 3e-3), (250.0, 3e-2), (500.0, 1e-3))
        ):
            model, robot = urdf_plant(example_urdf(urdf), constants, noise)
            log = simulate(robot, sines(model, 25.0, rate, seed), seed=seed)
            log = replace(log, effort=log.effort * np.array(constants), quantity="motor_torque")
            yield f"virtual {urdf.partition('.')[0]}, {rate:g} Hz, noise {noise:.1%}", model, log
    if ur10 is not None:
        model = derive(example_urdf("ur10_robot.urdf"), drive_inertia=True, expand=False)
        yield "real UR10", model, read_log(ur10).ordered(model.joint_names)


def timing(ur10: Path | None) -> Iterator[tuple[str, Calibration | str]]:
    """Good logs, and each of them clipped and late."""
    for what, model, log in good_logs(ur10):
        for how, made in (
            ("", log),
            (", clipped at 40 %", clipped(log, 0.4)),
            (", 25 rows late", late(log, 25)),
        ):
            yield f"{what}{how}", _calibrated(lambda: _of_log(model, made, ChainRegressor(model)))  # noqa: B023


def sines(model: DynamicsModel, seconds: float, rate: float, seed: int | None = None) -> Trajectory:
    """Two sines per joint about the middle of its range, of frequencies that no two joints share; a seed draws phases."""
    time = np.arange(round(seconds * rate)) / rate
    n = model.n
    limits = [joint.limits for joint in model.mechanism.joints]
    low_end, high_end = np.clip([(limit.lower, limit.upper) for limit in limits], -REACH, REACH).T
    middle, reach = 0.5 * (low_end + high_end), 0.25 * (high_end - low_end)
    start = np.arange(n) if seed is None else np.random.default_rng(seed).uniform(0, 2 * np.pi, n)
    q = np.tile(middle, (len(time), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    for share, low in ((0.6, 0.1), (0.3, 0.25)):
        w = 2 * np.pi * (low + 0.11 * low * np.arange(n))
        phase = w * time[:, None] + start
        q += share * reach * np.sin(phase)
        qd += share * reach * w * np.cos(phase)
        qdd -= share * reach * w**2 * np.sin(phase)
    return Trajectory(model.joint_names, time, q, qd, qdd)


def logs(ur10: Path | None) -> Iterator[tuple[str, Calibration | str]]:
    """Every wrong log of every robot."""
    sources: list[tuple[str, DynamicsModel, Log, np.ndarray]] = [("virtual Denso", *denso_log())]
    if ur10 is not None:
        model = derive(example_urdf("ur10_robot.urdf"), drive_inertia=True, expand=False)
        sources.append(("UR10", model, read_log(ur10).ordered(model.joint_names), np.array(UR10_GAINS)))
    for robot, model, log, constants in sources:
        regressor = ChainRegressor(model)
        for what, wrong in wrong_logs(log, constants):
            yield f"{robot}: {what}", _calibrated(lambda: _of_log(model, wrong, regressor))  # noqa: B023


def _of_log(model: DynamicsModel, log: Log, regressor: ChainRegressor) -> Calibration:
    return calibrate_logs(model, [log], CalibrateOptions(), regressor, None, lambda step: None)


def _calibrated(run: Callable[[], Calibration]) -> Calibration | str:
    from psdmc.errors import InputError

    try:
        return run()
    except InputError as error:
        return str(error)


def example_urdf(name: str) -> Path:
    """From the wheel example-robot-data."""
    import cmeel

    prefix = Path(cmeel.__path__[0]).parent / "cmeel.prefix"
    return sorted(prefix.rglob(name))[0]


def campaigns(_: Path | None) -> Iterator[tuple[str, Calibration | str]]:
    """The demonstration's three variants, parameters unknown beforehand."""
    model = replace(derive(ROBOT, drive_inertia=True), theta_b=None)
    robot = compile_model(model, functions=["regressor"])
    plan = plan_campaign(model, robot, CampaignOptions(table="npz"))
    variants = {
        "ideal sensors": SimulateOptions(ideal_sensors=True, workers=2),
        "sensors as in its file": SimulateOptions(workers=2),
        "with a cable harness": SimulateOptions(harness=True, workers=2),
    }
    for name, options in variants.items():
        with tempfile.TemporaryDirectory() as folder:
            write_campaign(folder, plan.runs, plan.found, "npz")
            simulate_campaign(PLANT, folder, options)
            campaign = read_campaign(folder)
            record = calibrate_campaign(model, campaign, CalibrateOptions(), robot, None, lambda step: None)
        yield f"virtual Denso's campaign: {name}", record


TABLES: dict[str, Callable[[Path | None], Iterator[tuple[str, Calibration | str]]]] = {
    "logs": logs,
    "timing": timing,
    "campaigns": campaigns,
}


def row(what: str, found: Calibration | str) -> str:
    """One line of the table."""
    if isinstance(found, str):
        return f"{what:<62} 2  refused               {found}"
    verdict = found.verdict
    assert verdict is not None
    why = next(iter((*verdict.suspects, *verdict.reasons, *verdict.doubts)), "")
    return f"{what:<62} {verdict.exit_status}  {verdict.word:<20}  {why}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", choices=TABLES)
    parser.add_argument(
        "ur10", nargs="?", type=Path, help="a UR10's log, positions and efforts by joint name"
    )
    options = parser.parse_args()
    for what, found in TABLES[options.table](options.ur10):
        print(row(what, found), flush=True)


if __name__ == "__main__":
    main()
