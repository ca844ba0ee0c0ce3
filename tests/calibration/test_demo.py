"""The whole demonstration on the virtual Denso, as `make calibrate-demo` runs it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_virtual_denso_is_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from psdmc.report.calibrate_demo import run_demo

    monkeypatch.chdir(ROOT)
    found = run_demo(tmp_path, ("ideal", "sensors"), workers=min(2, os.cpu_count() or 1))

    ideal, sensors = found["ideal"], found["sensors"]
    assert ideal.torque_constant < 1e-3
    assert ideal.gravity < 1e-3
    assert ideal.inertial < 1e-3
    assert max(ideal.friction[name] for name in ("coulomb", "viscous", "viscous_exponent")) < 0.02
    assert (
        max(ideal.friction[name] for name in ("static", "stribeck_velocity", "stiffness", "damping")) < 0.10
    )
    assert sensors.within_three_std >= 0.95
