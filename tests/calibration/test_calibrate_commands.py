"""What the command line calls: a model file in, a campaign, its logs, and a calibrated model file out."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from quick_campaign import QUICK

from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign, torque_constants_for
from psdmc.errors import InputError
from psdmc.model.load import load
from psdmc.model.store import save
from psdmc.report.calibrate_commands import (
    calibrate_command,
    excite_command,
    write_actuators,
)


def test_from_a_model_without_parameters_to_one_with_them(arm, tmp_path: Path):
    """Of the arm of two joints; `make test-demo` and `make calibrate-demo` take the virtual Denso."""
    save(arm.unknown, tmp_path / "unknown.npz")
    folder = tmp_path / "campaign"

    found = excite_command(tmp_path / "unknown.npz", folder, replace(QUICK, repeats=1)).found
    count = simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True))
    record = calibrate_command(
        tmp_path / "unknown.npz",
        [folder],
        tmp_path / "calibrated.npz",
        tmp_path / "page.html",
        actuators=tmp_path / "c",
    )

    assert found.times > 1.0
    assert count == 2 + 2 + 1 + 2 + 1
    assert (folder / "excitation.csv").exists()
    assert "<svg" in (folder / "excitation.svg").read_text(encoding="utf-8")
    calibrated = load(tmp_path / "calibrated.npz")
    assert calibrated.theta_b is not None
    assert np.abs(calibrated.theta_b - arm.model.theta_b).max() < 0.05
    assert "two_link" in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert (tmp_path / "page.json").exists()
    assert sorted(path.name for path in (tmp_path / "c").rglob("*.*")) == [
        "two_link_actuators.c",
        "two_link_actuators.h",
    ]
    assert len(record.friction) == 14


def test_torque_constants_are_asked_for_if_no_run_has_a_load(arm, tmp_path: Path):
    """`psdmc simulate` prints them in its next line, so that the line works as it is printed."""
    save(arm.unknown, tmp_path / "unknown.npz")
    for name, one_log in (("steps", False), ("log", True)):
        excite_command(tmp_path / "unknown.npz", tmp_path / name, replace(QUICK, repeats=1, one_log=one_log))

    assert torque_constants_for(arm.plant, tmp_path / "steps") == []
    true = tomllib.loads(arm.plant.read_text(encoding="utf-8"))["joint"]
    asked = torque_constants_for(arm.plant, tmp_path / "log")
    assert [float(each.split("=")[1]) for each in asked] == [joint["torque_constant"] for joint in true]
    assert [each.split("=")[0] for each in asked] == list(arm.unknown.joint_names)


def test_actuators_keep_out_of_folders_of_others(arm, tmp_path: Path):
    """Before the fit: there is no log to read."""
    arm.model.save(tmp_path / "arm.npz")
    with pytest.raises(InputError, match=r"psdmc did not write the files in this folder: arm.npz"):
        calibrate_command(tmp_path / "arm.npz", [tmp_path / "no.csv"], tmp_path / "o.npz", actuators=tmp_path)


def test_actuators_need_a_calibration(tmp_path: Path):
    with pytest.raises(InputError, match="two_link: not calibrated"):
        write_actuators(bundled_model("two_link"), tmp_path)
