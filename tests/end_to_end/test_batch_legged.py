"""examples/batch_legged in a short form: the programs run, and what they say of their results holds."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from installed import in_wheel
from unoptimised import without_optimisation

from psdmc.compiler import derive, emit_c

EXAMPLE = Path(__file__).parents[2] / "examples" / "batch_legged"
STATES = 4096


@pytest.fixture(scope="module", autouse=True)
def from_python():
    in_wheel("solo12.urdf")
    spec = importlib.util.spec_from_file_location("from_python", EXAMPLE / "from_python.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_its_states_are_pinocchios(from_python) -> None:
    """Quaternions and rates in Pinocchio's order and frames: the same torques."""
    model = derive(from_python.solo12(), floating=True)
    q, v, a = from_python.random_states(model, 20)
    oracle = pin.buildModelFromUrdf(str(from_python.solo12()), pin.JointModelFreeFlyer())
    data = oracle.createData()
    expected = np.array([pin.rnea(oracle, data, *row) for row in zip(q, v, a, strict=True)])

    assert np.abs(model.inverse_dynamics(q, v, a) - expected).max() <= 1e-5 * np.abs(expected).max()


@pytest.mark.slow
def test_from_numpy_on_one_and_on_two_threads(
    from_python, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not optimised: the times that it prints are not looked at."""
    monkeypatch.setattr(sys, "argv", ["from_python.py", "--states", str(3 * STATES), "--threads", "2"])
    with without_optimisation():
        from_python.main()
    said = capsys.readouterr().out

    assert float(re.search(r"come back to (\S+)", said)[1]) < 1e-8
    rows = re.findall(r"(\w+_\w+) +(\d) threads +(\S+) ns a state", said)
    names = ("inverse_dynamics", "forward_dynamics", "mass_matrix")
    assert [(name, threads) for name, threads, _ in rows] == [(n, k) for k in "12" for n in names]
    assert all(float(ns) > 0.0 for _, _, ns in rows)


@pytest.mark.slow
@pytest.mark.needs("make")
def test_in_c_as_rows_and_lane_by_lane(from_python, tmp_path: Path) -> None:
    model = derive(from_python.solo12(), floating=True)
    emit_c(model, tmp_path / "solo12", functions=from_python.FUNCTIONS, name="robot")
    make = [
        "make",
        "-f",
        str(EXAMPLE / "Makefile"),
        f"PACKAGE={tmp_path / 'solo12'}",
        "CFLAGS=-O0 -march=native",
    ]
    subprocess.run(make, check=True, capture_output=True)
    program = tmp_path / "solo12" / "batch" / "throughput"
    said = subprocess.run([program, str(STATES)], capture_output=True, text=True, check=True).stdout

    differ, back = re.search(r"differ by (\S+), accelerations come back to (\S+)", said).groups()
    assert float(differ) < 1e-13
    assert float(back) < 1e-9
    assert len(re.findall(r"million states a second", said)) == 4
    assert subprocess.run([program], capture_output=True).returncode == 2
