"""PROGRAMs of chains with nearly parallel axes, by both lowerings, against Pinocchio."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from nearly_parallel import tilted_chain
from random_chains import Oracle, relative_error, states

from psdmc.derivation.derive import derive_model
from psdmc.lower import kernels, search
from psdmc.lower.kernels import lower
from psdmc.lower.link_parameters import carrier_space
from psdmc.lower.reframe import reframe
from psdmc.program.interpret import interpret
from psdmc.robot.mechanism import Placement

ACCURACY = 1e-11
BUDGET = 12
"""Programs that the search may trace: whichever it takes must be right."""


@pytest.mark.parametrize("tilt", [1e-7, 1e-6, 1e-5, 1e-4, 1e-2])
@pytest.mark.parametrize(
    ("seed", "kinds", "lowering"), [(3, "RRR", "factored"), (1, "RRRP", "factored"), (3, "RR", "expanded")]
)
def test_programs_at_any_tilt(
    seed: int, kinds: str, tilt: float, lowering: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernels, "Search", partial(search.Search, budget=BUDGET))
    chain = tilted_chain(seed, kinds, tilt)
    model = derive_model(chain)
    q, qd, qdd = states(len(kinds), 100)
    expected = Oracle(chain).rnea(q, qd, qdd)
    given = {"q": q, "qd": qd, "qdd": qdd, "theta_b": model.theta_b}
    for kernel in lower(model, lowering, ["inverse_dynamics"]).values():
        for form in (kernel.single, kernel.batch):
            found = interpret(form, given, {"tau": model.n})["tau"]
            assert relative_error(found, expected) < ACCURACY


def test_carriers_are_no_large_multiples_of_theta_b() -> None:
    """Chosen by weight with each column measured by itself, they were a million times as large."""
    model = derive_model(tilted_chain(0, "RRR", 1e-5), expand=False)
    space = carrier_space(reframe(model.chain, ("previous",) * 3), model.representative)
    carriers = space.lightest([1.0] * space.count)
    assert space.careful is not None
    assert np.abs(space.transfer(carriers)).max() < 100.0


@pytest.mark.parametrize("tilt", [1e-9, 1e-7, 1e-5, 1e-3])
def test_frames_stay_orthonormal_where_gravity_is_nearly_along_the_first_axis(tilt: float) -> None:
    """x goes along gravity's part across the axis, which is the small rest of a difference."""
    c, s = np.cos(tilt), np.sin(tilt)
    chain = tilted_chain(0, "RR", tilt)
    place = Placement(np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), np.zeros(3))
    first, second = chain.joints
    chain = replace(chain, joints=(replace(first, placement=place), second))
    axes = np.array(reframe(chain, ("previous", "previous")).base_axes)
    assert np.abs(axes.T @ axes - np.eye(3)).max() < 1e-15
