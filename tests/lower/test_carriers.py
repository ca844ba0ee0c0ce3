"""Carriers' parts: values with exact zeros and ones, the rank of columns, and a choice that no unit of length changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from nearly_parallel import tilted_chain
from random_chains import random_chain

from psdmc.derivation.derive import derive_model
from psdmc.derivation.scaled import in_unit, parameter_units
from psdmc.lower.carriers import CarrierSpace, Tableau
from psdmc.lower.link_parameters import carrier_space
from psdmc.lower.reframe import reframe
from psdmc.robot.mechanism import Mechanism


def space_of(chain: Mechanism) -> tuple[CarrierSpace, int]:
    """The space of a chain's model, and the count of its base parameters."""
    model = derive_model(chain, expand=False)
    return carrier_space(reframe(model.chain, ("previous",) * model.n), model.representative), model.l


def larger(chain: Mechanism, times: float) -> Mechanism:
    """The same chain with all lengths multiplied."""
    joints = tuple(
        replace(
            joint,
            placement=in_unit(joint.placement, 1.0 / times),
            link_frame=in_unit(joint.link_frame, 1.0 / times),
        )
        for joint in chain.joints
    )
    units = parameter_units(chain.types, times).reshape(chain.parameters.shape)
    return replace(
        chain, joints=joints, parameters=chain.parameters * units, tip=in_unit(chain.tip, 1.0 / times)
    )


def test_what_is_zero_or_one_but_for_rounding_is_so_exactly_and_nothing_else_is() -> None:
    rounding = 2e-15
    given = [[1.0 + rounding, 2.0 + rounding], [-1.0 - rounding, rounding], [0.5, 1.0 + 1e-12]]
    tableau = Tableau((0, 1, 2), np.hstack([np.eye(3), given]).astype(np.longdouble))
    space = CarrierSpace(np.eye(3), tableau, whole=np.ones(2))

    found = space.transfer((0, 1, 2))

    assert found.tolist() == [[1.0, 2.0 + rounding], [-1.0, 0.0], [0.5, 1.0 + 1e-12]]


@pytest.mark.parametrize("kinds", ["R", "RR", "RPR", "RRRR"])
def test_columns_have_the_rank_of_the_base_parameters(kinds: str) -> None:
    """Rounding makes no further directions of its own."""
    space, count = space_of(random_chain(5, kinds))

    assert len(space.columns) == len(space.tableau.basis) == count


@pytest.mark.parametrize("times", [2.0**-7, 1.0, 2.0**7])
def test_no_unit_of_length_decides_how_carriers_are_chosen(times: float) -> None:
    """A chain of a hundred times the size, or a hundredth, has values that are as fair."""
    assert space_of(larger(random_chain(5, "RRR"), times))[0].careful is None
    assert space_of(larger(tilted_chain(0, "RRR", 1e-5), times))[0].careful is not None
