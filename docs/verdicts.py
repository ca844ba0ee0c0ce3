"""The verdict on good logs and on logs made wrong on purpose: the table of docs/calibration.md.

python docs/verdicts.py logs [UR10.csv]     plain logs: the virtual Denso's, and a real UR10's where its log is at hand
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
from psdmc.calibration.plant.spoiled import ALL, MOVED, decimated, noise_only, scaled, swapped, turned
from psdmc.calibration.plant.virtual_robot import load_virtual_robot, simulate
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


def denso_log(seconds: float = 25.0, rate: float = 125.0) -> tuple[DynamicsModel, Log, np.ndarray]:
    """The virtual Denso through sums of sines; its currents times the true torque constants."""
    model = derive(ROBOT, drive_inertia=True)
    robot = load_virtual_robot(PLANT)
    constants = np.array([joint.torque_constant for joint in robot.joints])
    log = simulate(robot, sines(model, seconds, rate))
    return model, replace(log, effort=log.effort * constants, quantity="motor_torque"), constants


def sines(model: DynamicsModel, seconds: float, rate: float) -> Trajectory:
    """Two sines per joint about the middle of its range, of frequencies that no two joints share."""
    time = np.arange(round(seconds * rate)) / rate
    n = model.n
    limits = [joint.limits for joint in model.mechanism.joints]
    middle = np.array([0.5 * (limit.lower + limit.upper) for limit in limits])
    reach = np.array([0.25 * (limit.upper - limit.lower) for limit in limits])
    q = np.tile(middle, (len(time), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    for share, low in ((0.6, 0.1), (0.3, 0.25)):
        w = 2 * np.pi * (low + 0.11 * low * np.arange(n))
        phase = w * time[:, None] + np.arange(n)
        q += share * reach * np.sin(phase)
        qd += share * reach * w * np.cos(phase)
        qdd -= share * reach * w**2 * np.sin(phase)
    return Trajectory(model.joint_names, time, q, qd, qdd)


def logs(ur10: Path | None) -> Iterator[tuple[str, Calibration | str]]:
    """Every wrong log of every robot."""
    sources: list[tuple[str, DynamicsModel, Log, np.ndarray]] = [("virtual Denso", *denso_log())]
    if ur10 is not None:
        model = derive(ur10_urdf(), drive_inertia=True, expand=False)
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


def ur10_urdf() -> Path:
    """From the wheel example-robot-data."""
    import cmeel

    prefix = Path(cmeel.__path__[0]).parent / "cmeel.prefix"
    return sorted(prefix.rglob("ur10_robot.urdf"))[0]


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
    "campaigns": campaigns,
}


def row(what: str, found: Calibration | str) -> str:
    """One line of the table."""
    if isinstance(found, str):
        return f"{what:<58} 2  refused               {found}"
    verdict = found.verdict
    assert verdict is not None
    why = next(iter((*verdict.suspects, *verdict.reasons, *verdict.doubts)), "")
    return f"{what:<58} {verdict.exit_status}  {verdict.word:<20}  {why}"


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
