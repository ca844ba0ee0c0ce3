"""`psdmc show` of a robot file: the whole tree, what is derived of it, and which chains there are."""

from __future__ import annotations

from pathlib import Path

import pytest
from bundled import robot_path
from command_line import typed

HAND = """<robot name="hand">
<link name="base"/><link name="palm"><inertial><mass value="0.5"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="left finger"/><link name="right"/>
<joint name="wrist" type="continuous"><parent link="base"/><child link="palm"/></joint>
<joint name="a" type="prismatic"><parent link="palm"/><child link="left finger"/><limit lower="0" upper="0.04"/></joint>
<joint name="b" type="prismatic"><parent link="palm"/><child link="right"/><mimic joint="a" multiplier="-1" offset="0.01"/>
</joint>
</robot>"""


@pytest.fixture
def hand(tmp_path: Path) -> Path:
    path = tmp_path / "hand.urdf"
    path.write_text(HAND, encoding="utf-8")
    return path


def test_a_tree_is_shown_whole_with_the_chains_to_choose(hand: Path) -> None:
    run = typed("show", hand)
    assert run.returncode == 0, run.stderr
    assert "a tree with 2 ends of 3 joints with 2 coordinates, from base" in run.stdout
    rows = [line.split() for line in run.stdout.splitlines()]
    assert any("b" in row and "-1" in row and "a" in row and "0.01" in row for row in rows)
    assert "not derived" not in run.stdout
    assert "--tip 'left finger': 2 joints" in run.stdout


def test_the_chain_that_it_names_is_derived(hand: Path, tmp_path: Path) -> None:
    run = typed("derive", hand, "--tip", "left finger", "-o", tmp_path / "hand.npz")
    assert run.returncode == 0, run.stderr
    assert typed("show", tmp_path / "hand.npz").returncode == 0


def test_a_chain_is_shown_as_one() -> None:
    run = typed("show", robot_path("scara"))
    assert run.returncode == 0, run.stderr
    assert "a serial chain of 4 joints with 4 coordinates" in run.stdout
    assert "not derived" not in run.stdout


def test_a_planar_joint_has_three_coordinates(tmp_path: Path) -> None:
    slider = tmp_path / "slider.urdf"
    slider.write_text(
        HAND.replace('type="continuous">', 'type="planar"><axis xyz="0 0 1"/>'), encoding="utf-8"
    )
    run = typed("show", slider)
    assert run.returncode == 0, run.stderr
    assert "of 3 joints with 4 coordinates" in run.stdout


def test_what_needs_a_model_is_refused_of_a_robot(hand: Path) -> None:
    run = typed("show", hand, "--cost")
    assert run.returncode == 2
    assert "derive one first" in run.stderr
    assert "Traceback" not in run.stderr
