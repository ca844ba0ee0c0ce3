"""Log descriptions and the tables that they describe: read, drafted, and now and then fitted."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from fixtures import FIT_TO_USE, log, two_link_model, write_bag

from psdmc.calibration.calibrate import CalibrateOptions, calibrate
from psdmc.calibration.description.description import is_description, read_description
from psdmc.calibration.description.draft import drafted
from psdmc.calibration.description.read_described import described_logs
from psdmc.calibration.identify.knowledge import knowledge_of
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log_files import write_columns


def write_described(folder: Path) -> None:
    """Logs in a user's units: run.csv, run.npz with arrays of two dimensions, run.txt without names, a bag."""
    folder.mkdir()
    run = log(*FIT_TO_USE)
    assert run.velocity is not None
    columns = {"ms": 1000.0 * run.time}
    for k in range(2):
        columns[f"a{k + 1}"] = np.round(np.degrees(run.position[:, k]), 4)
    for k in range(2):
        columns[f"n{k + 1}"] = np.round(run.velocity[:, k] * 30.0 / np.pi, 4)
        columns[f"i{k + 1}"] = np.round(run.effort[:, k], 4)
    write_columns(columns, folder / "run.csv")
    np.savez(folder / "run.npz", q=np.round(run.position * 4096 / (2 * np.pi)), note=np.array("ticks"))
    np.savetxt(folder / "run.txt", 1000.0 * run.effort, "%.2f")
    write_bag(folder / "bag", FIT_TO_USE, mcap=False)


def set_up(folder: Path) -> None:
    shutil.copytree(folder / "seed" / "described", folder / "described")


def description(data: bytes, folder: Path, deep: bool) -> None:
    """log.toml is given; its logs stand where the seeds have them."""
    file = folder / "described" / "log.toml"
    file.write_bytes(data)
    model = two_link_model()
    found = read_description(file, model.joint_names)
    linear = found.options(LinearOptions()).for_robot(model.mechanism)
    knowledge_of(model, linear.tables, linear.tables_from)
    described_logs(found, model.joint_names)
    if deep and is_description(file):
        calibrate(model, file, CalibrateOptions(), regressor=ChainRegressor(model))


def described_csv(data: bytes, folder: Path, deep: bool) -> None:
    """A text table is given: a description is drafted from it, and reads it."""
    names = two_link_model().joint_names
    (folder / "any.csv").write_bytes(data)
    if deep:
        drafted([folder / "any.csv"], folder / "any.toml", None)
    draft = drafted([folder / "any.csv"], folder / "any.toml", names)
    (folder / "any.toml").write_text(draft.text, encoding="utf-8")
    described_logs(read_description(folder / "any.toml", names), names)
