"""Tests of gradients, and of derivatives along a direction: products with dense systems of Pinocchio's numbers."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from against_pinocchio import INTERPRETED, matches_pinocchio, program_matches_pinocchio
from wide_robots import is_pinocchios


def made_for(function: str) -> tuple[Callable[[], None], Callable[[str], None], Callable[[], None]]:
    """Tests of the C code in all layouts, of the PROGRAMs, and with joints of several coordinates. Trees with every mask
    are in test_constrained_forward_dynamics.py."""

    @pytest.mark.parametrize("robot", INTERPRETED)
    def of_programs(robot: str) -> None:
        program_matches_pinocchio(function, robot)

    return (
        lambda: matches_pinocchio(function, "sliding"),
        of_programs,
        lambda: is_pinocchios(function, "small", 1e-8, in_c=False),
    )
