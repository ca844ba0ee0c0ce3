"""Odd robot files at the command line: two lines of psdmc's own where they are refused, none of urdfdom's where read."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from bundled import robot_path
from command_line import status, typed
from urdf_text import inertial, joint, link, urdf

STRONG = '<limit lower="-1" upper="1" effort="240" velocity="1"/>'
PLAIN = urdf(
    link("base_link", ""),
    link("tool0", inertial(9.4, "0.1 0 0", "0 0 0", "0.02 0.03 0.025")),
    joint("j", "base_link", "tool0", xyz="0 0 0", rpy="1.5 0 0", extra=STRONG),
)


def test_white_space_leaves_mass_and_stderr_alone(tmp_path: Path):
    (tmp_path / "arm.urdf").write_text(PLAIN.replace('"9.4"', '"9.4 "').replace('"240"', '"240 "'))

    derived = typed("derive", tmp_path / "arm.urdf", "-o", tmp_path / "arm.npz")
    checked = typed("check", tmp_path / "arm.npz")

    assert derived.returncode == checked.returncode == 0
    assert [line.split(":")[0] for line in (derived.stderr + checked.stderr).splitlines()] == ["next", "next"]
    assert "no inertia" not in derived.stdout
    with np.load(tmp_path / "arm.npz") as file:
        assert np.abs(file["theta_b"]).max() == pytest.approx(0.94)


@pytest.mark.parametrize(
    ("plain", "changed", "said"),
    [
        ('"9.4"', '"9.4\u00a0"', r"arm.urdf: link 'tool0': <mass> value='9.4\xa0', expected a finite number"),
        ('name="arm"', 'name="arm" version="2.0"', "arm.urdf: version '2.0' is not supported"),
        ('"9.4"', '"1e300"', "arm.urdf: link 'tool0': <mass> value='1e300' is out of range"),
        ("inertial>", "inertail>", "arm.urdf: link 'tool0': unknown element <inertail> in <link>"),
        (
            'rpy="1.5 0 0"',
            'quat_xyzw="1 1 0 0"',
            "arm.urdf: joint 'j': <origin> quat_xyzw has length 1.41421",
        ),
    ],
)
def test_refusals_are_two_lines(
    plain: str, changed: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "arm.urdf").write_text(PLAIN.replace(plain, changed), encoding="utf-8")

    assert status("derive", tmp_path / "arm.urdf", "-o", tmp_path / "arm.npz") == 2

    printed = capsys.readouterr()
    assert printed.out == ""
    assert re.fullmatch(r"error: .*\nhint: .+\n", printed.err)
    assert said in printed.err
    assert not (tmp_path / "arm.npz").exists()


def test_base_and_tip_exchanged(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "arm.urdf").write_text(PLAIN)

    assert status("derive", tmp_path / "arm.urdf", "--base", "tool0", "--tip", "base_link") == 2

    assert capsys.readouterr().err.splitlines() == [
        "error: arm.urdf: tip link 'base_link' is not below base link 'tool0' but above it",
        "hint: a chain runs from its base to its tip: swap them, --base 'base_link' --tip 'tool0'",
    ]


def test_ten_thousand_fixed_links_end_no_process(tmp_path: Path):
    links = "".join(f'<link name="l{k}"/>' for k in range(10_001))
    joints = "".join(
        f'<joint name="j{k}" type="{"fixed" if k else "revolute"}"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(10_000)
    )
    (tmp_path / "long.urdf").write_text(f'<robot name="long">{links}{joints}</robot>')

    done = typed("derive", tmp_path / "long.urdf")

    assert done.returncode == 2
    assert "10001 links, psdmc reads at most 1000" in done.stderr


def test_check_says_what_it_read(tmp_path: Path):
    assert status("derive", robot_path("rounded_arm"), "--no-expand", "-o", tmp_path / "m.npz") == 0

    done = typed("check", tmp_path / "m.npz")

    assert done.returncode == 0
    assert "placements of links and tip" in done.stdout
    assert re.search(r"compared with Pinocchio [\d.]+'s reading of the source", done.stdout)
    assert "MuJoCo's mj_inverse" in done.stdout
