"""E and P of robots whose joints follow others: certified against Newton-Euler, and refused where powers are higher."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import psdmc

ROBOTS = Path(__file__).parents[2] / "examples" / "palletiser"


def gripper(joints: str) -> str:
    body = (
        '<link name="{0}"><inertial><origin xyz="0.1 0.02 -0.03"/><mass value="2"/>'
        '<inertia ixx="0.1" ixy="0.01" ixz="0.02" iyy="0.2" iyz="0" izz="0.15"/></inertial></link>'
    )
    links = '<link name="base"/>' + "".join(body.format(name) for name in ("one", "two", "three"))
    return f'<robot name="gripper">{links}{joints}</robot>'


def joint(name: str, kind: str, parent: str, child: str, axis: str, mimic: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0.1 0.2" rpy="0.4 0.3 0.2"/><axis xyz="{axis}"/>'
        f'<limit lower="-1" upper="1" velocity="1" effort="1"/>{mimic}</joint>'
    )


def derived(tmp_path: Path, joints: str) -> psdmc.DynamicsModel:
    (tmp_path / "gripper.urdf").write_text(gripper(joints), encoding="utf-8")
    return psdmc.derive(tmp_path / "gripper.urdf", expand=True)


def test_the_palletiser_has_e_and_p():
    loops = ROBOTS / "palletiser_loops.toml"
    model = psdmc.derive(ROBOTS / "palletiser.urdf", loops=loops, expand=True)
    assert model.E.shape == (20, model.p)
    assert len(model.P) == 4
    assert model.certificate.max() < 1e-14
    plain = psdmc.derive(ROBOTS / "palletiser.urdf", loops=loops, expand=False)
    states = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 10, 4))
    np.testing.assert_allclose(model.regressor(*states), plain.regressor(*states), atol=1e-11)
    # Torque 4 of the flange, a body of revolution on a vertical axis: its inertia and the turn of the column alone.
    assert {str(symbol) for symbol in model.torque_expression("axis_4").free_symbols} >= {"qdd1", "qdd3"}


def fingers(multiplier: int) -> str:
    mimic = f'<mimic joint="a" multiplier="{multiplier}" offset="0.3"/>'
    return (
        joint("a", "revolute", "base", "one", "0 0 1")
        + joint("b", "revolute", "base", "two", "0 1 1", mimic)
        + joint("c", "prismatic", "one", "three", "1 0 0")
    )


def test_fingers_on_two_branches_have_e_and_p(tmp_path):
    assert derived(tmp_path, fingers(-1)).certificate.max() < 1e-13


def test_higher_powers_than_two_are_refused(tmp_path):
    with pytest.raises(psdmc.DerivationError, match="with the power 3"):
        derived(tmp_path, fingers(3))


def test_sliding_fingers_have_e_and_p(tmp_path):
    a, b = (
        joint("a", "prismatic", "one", "two", "0 1 0"),
        joint("b", "prismatic", "one", "three", "0 1 1", '<mimic joint="a" multiplier="-0.7" offset="0.1"/>'),
    )
    model = derived(tmp_path, joint("wrist", "revolute", "base", "one", "0 0 1") + a + b)
    assert model.certificate.max() < 1e-13
    assert model.nv == 2


def test_ratios_that_are_no_whole_number_are_refused(tmp_path):
    a = joint("a", "revolute", "base", "one", "0 0 1")
    b = joint("b", "revolute", "one", "two", "0 0 1", '<mimic joint="a" multiplier="0.5"/>')
    with pytest.raises(psdmc.DerivationError, match=r"ratio 0\.5, no whole number"):
        derived(tmp_path, a + b + joint("c", "revolute", "two", "three", "0 1 0"))
