"""The whole demonstration on the virtual Denso, in a short form of `make calibrate-demo`: a campaign of half the length,
its slow motions logged at 250 Hz and its sines a third as many, whose exciting motion is searched for among a fortieth of
the candidates. `make test-demo`: the long one by the same bounds, and imperfect sensors, which `make test` tries on a
smaller arm (test_four_steps.py)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from psdmc.calibration.campaign import CampaignOptions
from psdmc.calibration.motions.excite import ExciteOptions
from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions
from psdmc.calibration.truth import Comparison
from psdmc.report.calibrate_demo import WHOLE, run_demo

ROOT = Path(__file__).resolve().parents[2]
SHORT = CampaignOptions(
    sweep=SweepOptions(seconds=60.0, period=4e-3),
    sines=SineOptions(ratio=8.0),
    excite=ExciteOptions(evaluations=3000, random=200, seconds=600.0),
    gravity_runs=1,
    repeats=3,
    table="npz",
)
"""The search ends by its count, not by the clock: the motion is the same on every machine."""
LONG = os.environ.get("PSDMC_DEMO") == "whole"
PLAN = WHOLE if LONG else SHORT


def found(variant: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Comparison:
    monkeypatch.chdir(ROOT)
    return run_demo(folder, (variant,), workers=1, plan=PLAN)[variant]


@pytest.mark.slow
def test_the_virtual_denso_is_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    ideal = found("ideal", tmp_path, monkeypatch)

    assert ideal.torque_constant < 1e-3
    assert ideal.gravity < 1e-3
    assert ideal.inertial < 1e-3
    assert max(ideal.friction[name] for name in ("coulomb", "viscous", "viscous_exponent")) < 0.02
    assert (
        max(ideal.friction[name] for name in ("static", "stribeck_velocity", "stiffness", "damping")) < 0.10
    )


@pytest.mark.slow
@pytest.mark.skipif(not LONG, reason="make test-demo takes it")
def test_imperfect_sensors_leave_the_truth_within_its_uncertainty(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert found("sensors", tmp_path, monkeypatch).within_three_std >= 0.95
