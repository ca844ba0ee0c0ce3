"""What the command line calls: a model file in, a campaign, its logs, and a calibrated model file out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.campaign import CampaignOptions
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.motions.excite import ExciteOptions
from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions
from psdmc.calibration.simulate_campaign import SimulateOptions
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.load import load
from psdmc.model.store import save
from psdmc.report.calibrate_commands import (
    calibrate_command,
    excite_command,
    simulate_command,
    write_actuators,
)
from psdmc.robot.load import load_robot

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
QUICK = CampaignOptions(
    sweep=SweepOptions(speed=0.25, seconds=20.0, range=0.8, period=4e-3),
    sines=SineOptions(smallest=1e-4, ratio=8.0, frequencies=(2.0,), cycles=1, period=2e-3),
    excite=ExciteOptions(evaluations=100, random=50),
    load=Load(3.5, (0.08, 0.0, 0.06)),
    gravity_runs=1,
    repeats=1,
    table="npz",
)


def test_from_a_model_without_parameters_to_one_with_them(tmp_path: Path):
    model = derive_model(load_robot(EXAMPLES / "robots" / "denso_wall.toml", drive_inertia=True).chain)
    save(replace(model, theta_b=None), tmp_path / "unknown.npz")
    folder = tmp_path / "campaign"

    found = excite_command(tmp_path / "unknown.npz", folder, QUICK).found
    plant = EXAMPLES / "plants" / "denso_virtual.toml"
    count = simulate_command(plant, folder, SimulateOptions(ideal_sensors=True))
    record = calibrate_command(
        tmp_path / "unknown.npz",
        [folder],
        tmp_path / "calibrated.npz",
        tmp_path / "page.html",
        actuators=tmp_path / "c",
    )

    assert found.condition < found.random_conditions[0]
    assert count == 6 + 6 + 1 + 6 + 1
    assert (folder / "excitation.csv").exists()
    assert (folder / "excitation.svg").read_text(encoding="utf-8").startswith("<svg")
    calibrated = load(tmp_path / "calibrated.npz")
    assert calibrated.theta_b is not None
    assert np.abs(calibrated.theta_b - model.theta_b).max() < 0.05
    assert "denso_wall" in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert (tmp_path / "page.json").exists()
    assert sorted(path.name for path in (tmp_path / "c").rglob("*.*")) == [
        "denso_wall_actuators.c",
        "denso_wall_actuators.h",
    ]
    assert len(record.friction) == 42


def test_actuators_need_a_calibration(tmp_path: Path):
    model = derive_model(load_robot(EXAMPLES / "robots" / "two_link.toml").chain)

    with pytest.raises(InputError, match="two_link: not calibrated"):
        write_actuators(model, tmp_path)
