"""examples/cassie: accelerations of Cassie with its closed loops, beside Pinocchio's and MuJoCo's."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from pinocchio_robots import path_of

EXAMPLE = Path(__file__).parents[2] / "examples" / "cassie" / "cassie.py"


def test_cassie_moves_as_in_pinocchio_and_in_stiff_mujoco(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots = Path(path_of("hyq")).parents[2]
    sdf = robots / "cassie_description" / "robots" / "cassie.sdf"
    if not sdf.exists():
        pytest.skip("example-robot-data has no cassie.sdf")
    spec = importlib.util.spec_from_file_location("cassie", EXAMPLE)
    cassie = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(cassie)
    monkeypatch.setattr(cassie, "STATES", 3)
    mjcf = tmp_path / "cassie.xml"
    mjcf.write_text(cassie.mjcf_of(sdf), encoding="utf-8")

    robot = cassie.loaded(mjcf)
    found = cassie.largest_differences(robot, mjcf)

    assert len(robot.loops) == 4
    assert found["Pinocchio, in motion"] < 1e-9
    assert found["MuJoCo, at rest"] < 1e-6
    assert found["gap of the loops (m)"] < 1e-14
    monkeypatch.setattr(cassie, "SOFTNESS", 1e-4)
    softer = cassie.largest_differences(robot, mjcf)["MuJoCo, at rest"]
    assert 10.0 < softer / found["MuJoCo, at rest"] < 1000.0  # what is left is MuJoCo's softness
