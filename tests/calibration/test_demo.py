"""The whole demonstration on the virtual Denso, as `make calibrate-demo` runs it: `make test-demo`. `make test` tries the
same steps by the same comparison on an arm of two joints (test_four_steps.py)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from psdmc.report.calibrate_demo import run_demo
from psdmc.report.truth import Comparison

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(os.environ.get("PSDMC_DEMO") != "whole", reason="make test-demo takes it")


def found(variant: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Comparison:
    monkeypatch.chdir(ROOT)
    return run_demo(folder, (variant,), workers=1)[variant]


def test_the_virtual_denso_is_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    ideal = found("ideal", tmp_path, monkeypatch)

    assert ideal.torque_constant < 1e-3
    assert ideal.gravity < 1e-3
    assert ideal.inertial < 1e-3
    assert max(ideal.friction[name] for name in ("coulomb", "viscous", "viscous_exponent")) < 0.02
    assert (
        max(ideal.friction[name] for name in ("static", "stribeck_velocity", "stiffness", "damping")) < 0.10
    )


def test_imperfect_sensors_leave_the_truth_within_its_uncertainty(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert found("sensors", tmp_path, monkeypatch).within_three_std >= 0.95
