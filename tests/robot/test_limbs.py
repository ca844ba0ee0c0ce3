"""Which branches of a tree are limbs of equal structure."""

from __future__ import annotations

import pytest

from psdmc.robot.limbs import limb_groups
from psdmc.robot.mechanism import BASE


@pytest.mark.parametrize(
    ("parents", "labels", "groups"),
    [
        ((BASE, 0, 1, 2), "RRRR", ()),
        ((BASE, 0, 1, 0, 3), "FRRRR", (((1, 2), (3, 4)),)),
        ((BASE, 0, 1, 0, 3), "FRRRP", ()),
        ((BASE, BASE, 0, 1), "RRRR", (((0, 2), (1, 3)),)),
        # a trunk with two arms on two legs' pelvis
        ((BASE, 0, 0, 0, 3, 3), "FRRPRR", (((1,), (2,)), ((4,), (5,)))),
        # two hands of two fingers: the arms are the limbs
        ((BASE, 0, 1, 1, 0, 4, 4), "FRRPRPR", (((1, 2, 3), (4, 6, 5)),)),
        # three alike and one that is not
        ((BASE, 0, 0, 0, 0), "FRRPR", (((1,), (2,), (4,)),)),
    ],
)
def test_branches_on_one_body_whose_joints_are_alike(parents, labels, groups):
    assert limb_groups(parents, labels) == groups
