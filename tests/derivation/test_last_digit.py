"""What the last digits of a robot's numbers change: against closed forms and Pinocchio; and what becomes of the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_robot
from nearly_parallel import tilted_chain
from random_chains import Oracle, random_chain, relative_error

from psdmc.derivation import derive
from psdmc.derivation.certify import (
    DOUBTFUL,
    LAST,
    PROMISED,
    Measured,
    extended_torques,
    judged,
    last_digit_effect,
    measured,
)
from psdmc.derivation.derive import derive_model
from psdmc.errors import DerivationError
from psdmc.model.random_states import RANGES
from psdmc.robot.mechanism import Mechanism, Placement

MASS, INERTIA, GRAVITY = 100.0, 1e-8, 9.81
ACROSS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""z along the base's x."""
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""A quarter turn about z."""


def spindle(inertia: float = INERTIA, turned: bool = True) -> Mechanism:
    """A level axis that turns next to nothing, and along it a slide with 100 kg, metres away and right on the axis: its
    weight has no moment about the axis, but would have with the slide a little askew. The slide's frame is a quarter turn
    further, or not turned at all."""
    chain = random_chain(1, "RP")
    parameters = np.zeros_like(chain.parameters)
    parameters[0, 0], parameters[0, 9], parameters[1, 0] = 1.0, inertia, MASS
    places = (Placement(ACROSS, np.zeros(3)), Placement(QUARTER if turned else np.eye(3), np.zeros(3)))
    joints = tuple(
        replace(joint, placement=place, link_frame=Placement.identity())
        for joint, place in zip(chain.joints, places, strict=True)
    )
    return replace(chain, joints=joints, parameters=parameters, gravity=np.array([0.0, 0.0, -GRAVITY]))


def drawn(n: int) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    rng = np.random.default_rng(5)
    q, qd, qdd = (list(limit * rng.uniform(-1.0, 1.0, (n, 200))) for limit in RANGES)
    return q, qd, qdd


def effect(chain: Mechanism) -> np.ndarray:
    return last_digit_effect(chain, chain.parameters.reshape(-1), drawn(len(chain)))


def test_the_effect_is_the_moment_of_a_weight_askew() -> None:
    """The slide askew by LAST about each axis: at most sqrt(2) LAST q m g of a largest torque of I qdd."""
    turning, sliding = effect(spindle())
    largest = LAST * RANGES[0] * MASS * GRAVITY / (INERTIA * RANGES[2])
    assert 0.3 * largest < turning < 2.0 * largest
    assert sliding < 1e-15


def test_a_frame_that_is_not_turned_is_parallel_whatever_the_last_digits() -> None:
    """rpy="0 0 0": every reader has the same axis, and the weight no moment about it."""
    assert effect(spindle(turned=False)).max() < 1e-15
    assert derive_model(spindle(turned=False)).certificate.max() < 1e-15


def test_pinocchio_is_as_sensitive() -> None:
    """The same slide 1e-13 rad askew, which doubles can show: in proportion it is what a last digit makes."""
    chain, (q, qd, qdd), askew = spindle(), drawn(2), 1e-13
    tilt = np.array([[1.0, -askew, 0.0], [askew, 1.0, -askew], [0.0, askew, 1.0]])
    tilted = Placement(tilt @ QUARTER, np.zeros(3))
    moved = replace(chain, joints=(chain.joints[0], replace(chain.joints[1], placement=tilted)))
    states = [np.stack(rows, axis=1) for rows in (q, qd, qdd)]
    torques = Oracle(chain).rnea(*states)[:, 0]
    change = np.abs(Oracle(moved).rnea(*states)[:, 0] - torques).max() / np.abs(torques).max()
    assert 0.2 < effect(chain)[0] / (change * LAST / askew) < 5.0


@pytest.mark.parametrize("expand", [False, True])
def test_such_a_robot_is_refused_and_one_that_turns_more_is_not(expand: bool) -> None:
    with pytest.raises(DerivationError, match=r"'random1': joint 'joint1': .* the last digit") as caught:
        derive_model(spindle(), expand=expand)
    assert "--tip" in caught.value.hint
    assert derive_model(spindle(10.0), expand=expand).certificate.max() < 1e-12


def test_a_certificate_is_not_below_what_the_last_digits_leave_open() -> None:
    chain = spindle(0.1)
    model = derive_model(chain)
    assert DOUBTFUL < effect(chain)[0] < PROMISED
    assert model.certificate[0] > 0.3 * effect(chain)[0]


@pytest.mark.parametrize("name", ["kr6", "lbr7", "denso_wall", "scara", "two_link"])
def test_bundled_robots_are_far_from_that(name: str) -> None:
    chain = bundled_robot(name).chain
    x = np.nan_to_num(chain.parameters.reshape(-1))
    assert last_digit_effect(chain, x, drawn(len(chain))).max() < 0.2 * DOUBTFUL


@pytest.mark.parametrize("kinds", ["RPRR", "RRPRR"])
def test_torques_in_extended_precision_are_pinocchios(kinds: str) -> None:
    chain, states = random_chain(2, kinds), drawn(len(kinds))
    found = extended_torques(chain, chain.parameters.reshape(-1), states)
    expected = Oracle(chain).rnea(*(np.stack(rows, axis=1) for rows in states))
    assert relative_error(found, expected) < 1e-14


def found_with(errors: float, plain: float) -> Measured:
    """A doubtful robot as if E and P, and base parameters alone, had these errors."""
    found = measured(derive_model(spindle(0.1)))
    both = np.array([errors, 0.0]), np.array([plain, 0.0])
    return replace(found, errors=both[0], plain=both[1])


def test_what_e_and_p_cannot_hold_is_refused_with_the_remedy() -> None:
    with pytest.raises(DerivationError, match=r"E and P leave errors of 3.0e-11") as caught:
        judged(found_with(3e-11, 1e-13))
    assert "--no-expand" in caught.value.hint
    with pytest.raises(DerivationError, match=r"double precision leaves errors of 3.0e-11") as caught:
        judged(found_with(3e-11, 2e-11))
    assert "units" in caught.value.hint


def test_coefficients_are_found_again_where_the_first_ones_leave_errors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    chain = tilted_chain(0, "RRR", 1e-5)
    used = derive_model(chain).provenance["tolerances"]
    assert used["coefficient"] == derive.EXTENDED.zero
    monkeypatch.setattr(derive, "GOOD", 0.0)
    assert derive_model(chain).provenance["tolerances"]["coefficient"] == derive.FINEST.zero
