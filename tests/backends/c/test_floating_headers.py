"""What headers call the frame of gravity, positions and velocities: the base's, or of a floating base the world's."""

from __future__ import annotations

from pathlib import Path

import pytest
from bundled import bundled_model

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.functions import SIGNATURES
from psdmc.robot.load import load_robot_text
from psdmc.robot.mechanism import BASE_FRAME

ROCK = (
    '<robot name="rock"><link name="rock"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
)
NAMED = [name for name, function in SIGNATURES.items() if BASE_FRAME in function.meaning]


def comments(path: Path) -> str:
    return " ".join(file.read_text() for file in sorted(path.rglob("*.h*")))


def test_a_floating_base_is_in_the_world(tmp_path: Path) -> None:
    """Every function whose meaning names the frame; the header and C++ class, and Python's words."""
    robot = load_robot_text(ROCK, "urdf", source_name="rock.urdf", floating=True)
    model = derive_model(robot.mechanism)
    psdmc.emit_c(model, tmp_path, functions=NAMED, name="rock", bodies=True, payload=True)
    said = comments(tmp_path / "include")
    assert said.count("world frame") == 1 + sum(SIGNATURES[name].meaning.count(BASE_FRAME) for name in NAMED)
    for text in (said, (tmp_path / "manifest.json").read_text(), (tmp_path / "README.md").read_text()):
        assert BASE_FRAME not in text
    assert "m/s^2 in the world frame" in repr(model)
    assert "named frame in the world frame." in model.forward_kinematics.__doc__


@pytest.mark.parametrize("name", ["scara", "two_link"])
def test_a_fixed_base_is_the_base(name: str, tmp_path: Path) -> None:
    model = bundled_model(name)
    psdmc.emit_c(model, tmp_path, functions=["forward_kinematics", "jacobian"], name="arm")
    said = comments(tmp_path / "include")
    assert said.count(BASE_FRAME) == 3
    assert "world frame" not in said
