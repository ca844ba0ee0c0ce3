"""Robots of more joints than are sampled as a whole: the PROGRAM's torques are Pinocchio's, sliding joints in between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from random_trees import RandomTree

from psdmc.derivation.derive import derive_model
from psdmc.errors import InternalError
from psdmc.functions import RECIPES
from psdmc.lower import search
from psdmc.lower.kernels import lower
from psdmc.lower.link_parameters import SAMPLED_JOINTS
from psdmc.lower.search import Search
from psdmc.program.cost import SINGLE
from psdmc.program.interpret import interpret
from psdmc.robot.coordinates import Coordinate, own_coordinates

SERIAL = tuple(range(-1, 11))
BUDGET = 40
"""Programs that a search traces here: what it takes must be right, not cheap."""

LARGE = [
    RandomTree(1, SERIAL, "RPRRPRRPRRPR", 0.5),
    RandomTree(2, SERIAL, "PRRPPRRRPRRR", 0.0),
    RandomTree(3, (-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11), "F" + "RPR" * 4, 0.5),
]


NAMES = ["serial", "oblique", "four sliding legs"]


@pytest.mark.parametrize(
    "tree",
    [
        pytest.param(tree, id=name, marks=[pytest.mark.slow] if name == "oblique" else [])
        for tree, name in zip(LARGE, NAMES, strict=True)
    ],
)
def test_the_program_s_torques_are_pinocchio_s(tree: RandomTree, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(search, "BUDGET", BUDGET)
    model = derive_model(tree.mechanism(), expand=False)
    assert len(model.mechanism) > SAMPLED_JOINTS
    states = tree.motion(20)
    kernel = lower(model, "factored", ["inverse_dynamics"], theta_variants=False)["inverse_dynamics"]

    found = interpret(kernel.single, dict(zip(("q", "qd", "qdd"), states, strict=True)), {"tau": model.nv})[
        "tau"
    ]
    expected = tree.each(pin.rnea, *states)

    assert np.abs(found - expected).max() <= 1e-11 * np.abs(expected).max()


def test_the_program_s_torques_are_summed_where_joints_follow_others(monkeypatch: pytest.MonkeyPatch):
    """Campaign tree 1000000 was lowered with one state for each joint, of which it has fewer: a traceback."""
    monkeypatch.setattr(search, "BUDGET", BUDGET)
    ratios = np.eye(12)[:, :10]
    ratios[10, 8], ratios[11, 2] = -0.5, 2.0
    shift = 0.25 * (np.arange(12) == 10)
    follows = (Coordinate(8, -0.5, 0.25), Coordinate(2, 2.0))
    tree = LARGE[0]
    model = derive_model(
        replace(tree.mechanism(), coordinates=(*own_coordinates(10), *follows)), expand=False
    )
    q, qd, qdd = (vector[:, :10] for vector in tree.motion(20))
    given = {"q": q, "qd": qd, "qdd": qdd, "theta_b": model.theta_b}

    expected = tree.each(pin.rnea, q @ ratios.T + shift, qd @ ratios.T, qdd @ ratios.T) @ ratios

    for kernel in lower(model, "factored", ["inverse_dynamics"]).values():
        found = interpret(kernel.single, given, {"tau": model.nv})["tau"]
        assert np.abs(found - expected).max() <= 1e-11 * np.abs(expected).max()


def test_an_arrangement_that_gives_other_torques_is_a_bug_and_no_code(monkeypatch: pytest.MonkeyPatch):
    """Carriers of one robot with the values of another, and no way round them."""
    model = derive_model(LARGE[0].mechanism(), expand=False)
    starts = Search.starts

    def spoilt(self: Search, feet: object):
        return (replace(each, transfer=1.01 * each.transfer) for each in starts(self, feet))

    monkeypatch.setattr(Search, "starts", spoilt)
    monkeypatch.setattr(Search, "_exchanges", lambda self, found: iter(()))
    monkeypatch.setattr(Search, "uncarried", lambda self, _: next(self.starts(self.geometry.feet[0])))
    found = Search(model.mechanism, model.representative, model.theta_b, BUDGET)

    with pytest.raises(InternalError, match="inverse_dynamics"):
        found.best(RECIPES["inverse_dynamics"], SINGLE)
