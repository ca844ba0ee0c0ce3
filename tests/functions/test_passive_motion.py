"""Passive joints: declared, chosen, refused, and in a dead point; test_closed_loops.py compares their motion."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from test_closed_loops import GROUND, four_bar

import psdmc
from psdmc.errors import InputError


def test_passive_joints_are_chosen_or_declared(tmp_path: Path) -> None:
    model = four_bar(tmp_path)
    assert model.mechanism.notes[-1].startswith("passive joints, chosen: coupler_pin, rocker_pin; ")
    assert model.mechanism.passive_rates == (1, 2)
    assert four_bar(tmp_path, passive=["crank_pin", "coupler_pin"]).mechanism.passive_rates == (0, 1)
    with pytest.raises(InputError, match="passive joints crank_pin have 1 rates, expected 2") as error:
        four_bar(tmp_path, passive=["crank_pin"])
    assert error.value.hint == 'for example passive = ["coupler_pin", "rocker_pin"]'
    with pytest.raises(
        InputError, match=r"passive: found \['crank'\], expected a list of joints: 'crank_pin', "
    ):
        four_bar(tmp_path, passive=["crank"])
    with pytest.raises(InputError, match="no passive_motion: the robot has no closed loops"):
        psdmc.compile(psdmc.derive("examples/robots/scara.toml", expand=False), functions=["passive_motion"])


def test_a_dead_point_of_passive_joints_names_the_row(tmp_path: Path) -> None:
    """Crank and coupler are in one line: the rocker has stopped, and says nothing about them."""
    model = four_bar(tmp_path, passive=["crank_pin", "coupler_pin"])
    crank = math.acos((0.7**2 + GROUND**2 - 0.4**2) / (2 * 0.7 * GROUND))
    q = np.array([crank, 0.0, math.atan2(0.7 * math.sin(crank), 0.7 * math.cos(crank) - GROUND)])
    assert np.abs(model.loop_error(q)).max() < 1e-15
    for each in (model, psdmc.compile(model, functions=["passive_motion", "loop_inverse_dynamics"])):
        for name in ("passive_motion", "loop_inverse_dynamics"):
            with pytest.raises(InputError, match=rf"{name}: pin\.[xz]: the passive joints do not follow"):
                getattr(each, name)(q, np.ones(3), np.ones(3))
            assert np.isnan(getattr(each, name)(np.nan * q, np.ones(3), np.ones(3))[0]).all()


def test_a_dead_point_warns_of_no_division(tmp_path: Path) -> None:
    """Bars that are all in one line: the row along them is zero, and so is its pivot."""
    model = four_bar(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match="passive joints do not follow from the others here"):
            model.passive_motion(np.zeros(3), np.ones(3), np.zeros(3))
