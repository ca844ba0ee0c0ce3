"""Logs and trajectories: read and looked through; now and then fitted."""

from __future__ import annotations

import shutil
from pathlib import Path

from fixtures import two_link_model

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.log_files import read_log
from psdmc.calibration.motions.trajectory import read_trajectory
from psdmc.progress import silent

CUTOFF = 5.0
"""Hz"""


def csv(data: bytes, folder: Path, deep: bool) -> None:
    _log(data, folder / "run.csv", deep)


def npz(data: bytes, folder: Path, deep: bool) -> None:
    _log(data, folder / "run.npz", deep)


def parquet(data: bytes, folder: Path, deep: bool) -> None:
    _log(data, folder / "run.parquet", deep)


def db3(data: bytes, folder: Path, deep: bool) -> None:
    _log(data, folder / "run.db3", deep)


def mcap(data: bytes, folder: Path, deep: bool) -> None:
    _log(data, folder / "run.mcap", deep)


def bag(data: bytes, folder: Path, deep: bool) -> None:
    """A bag's folder whose metadata.yaml is given."""
    file = folder / "bag" / "metadata.yaml"
    file.write_bytes(data)
    _used(read_log(folder / "bag"), deep)


def set_up_bag(folder: Path) -> None:
    shutil.copytree(folder / "seed" / "bag", folder / "bag")


def trajectory(data: bytes, folder: Path, deep: bool) -> None:
    file = folder / "motion.csv"
    file.write_bytes(data)
    read_trajectory(file)


def _log(data: bytes, file: Path, deep: bool) -> None:
    file.write_bytes(data)
    _used(read_log(file), deep)


def _used(log: Log, deep: bool) -> None:
    model = two_link_model()
    checked(log, model.chain, CUTOFF)
    if deep:
        constants = dict.fromkeys(model.joint_names, 2.0)
        calibrate_logs(model, [log], CalibrateOptions(), ChainRegressor(model), constants, silent)
