"""Base parameters found link by link: as many as sampled torques of the whole chain show, and for long chains."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from random_chains import Oracle, random_chain, relative_error, states

from psdmc.derivation import memory
from psdmc.derivation.base_parameters import reduction_link_by_link, sampled_reduction
from psdmc.derivation.derive import LARGEST_CHAIN, derive_model
from psdmc.derivation.scaled import scaled
from psdmc.errors import DerivationError
from psdmc.robot.mechanism import Mechanism, Placement


@pytest.mark.parametrize("tidy", [False, True])
def test_as_many_as_the_whole_chain_shows(tidy: bool) -> None:
    for length in (1, 2, 3, 4):
        for kinds in map("".join, product("RP", repeat=length)):
            robot = scaled(random_chain(length, kinds, tidy=tidy))
            assert len(reduction_link_by_link(robot).pivots) == len(sampled_reduction(robot).pivots)


def test_the_same_torques_as_from_sampled_rows() -> None:
    """Both B have the row space of the regressor: each is the other's image."""
    robot = scaled(random_chain(5, "RPRRR", tidy=True))
    one, other = reduction_link_by_link(robot), sampled_reduction(robot)
    across = one.echelon[:, other.pivots]
    assert np.allclose(across @ other.echelon, one.echelon, atol=1e-12)


@pytest.mark.parametrize("length", [11, 40])
def test_long_chains(length: int) -> None:
    """Seven parameters a joint but for the first, of which gravity across its axis shows three: 7 n - 4 (Gautier 1991)."""
    chain = random_chain(3, "R" * length)
    model = derive_model(chain, expand=False)
    q, qd, qdd = states(length, 30)
    assert model.l == 7 * length - 4
    assert relative_error(model.inverse_dynamics(q, qd, qdd), Oracle(chain).rnea(q, qd, qdd)) < 1e-12
    assert np.abs(model.B @ model.representative - np.eye(model.l)).max() == 0.0


def test_a_long_chain_has_no_parameters_of_rounding() -> None:
    """Sixty equal steps without drive inertias: the far links' columns are hundreds long, and so is their rounding."""
    chain = random_chain(3, "R" * 60)
    step = chain.joints[1].placement
    joints = (chain.joints[0], *(replace(joint, placement=step) for joint in chain.joints[1:]))
    assert len(reduction_link_by_link(scaled(replace(chain, joints=joints))).pivots) == 7 * 60 - 4


def test_longer_chains_are_refused() -> None:
    with pytest.raises(
        DerivationError, match=f"'random0': {LARGEST_CHAIN + 1} joints, psdmc derives robots of up to 200"
    ) as caught:
        derive_model(random_chain(0, "R" * (LARGEST_CHAIN + 1)), expand=False)
    assert "--tip" in caught.value.hint


@pytest.mark.parametrize("kinds", ["R" * 10, "R" * 12, "R" * 200])
def test_grids_of_minutes_are_refused_before_they_are_made(kinds: str) -> None:
    with pytest.raises(DerivationError, match=r"-joint robot takes a grid of .* points") as caught:
        derive_model(random_chain(0, kinds))
    assert "--no-expand" in caught.value.hint


def test_velocity_terms_of_minutes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "LARGEST_EXPANSION", 1000)
    with pytest.raises(DerivationError, match=r"4-joint robot takes [\d,]+ velocity terms") as caught:
        derive_model(random_chain(0, "RRRR"))
    assert "--no-expand" in caught.value.hint


def _resized(chain: Mechanism, factor: float) -> Mechanism:
    joints = tuple(
        replace(
            joint,
            placement=Placement(joint.placement.rotation, joint.placement.translation * factor),
            link_frame=Placement(joint.link_frame.rotation, joint.link_frame.translation * factor),
        )
        for joint in chain.joints
    )
    return replace(chain, joints=joints)


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e155, 1e300])
@pytest.mark.filterwarnings("error")
def test_absurd_lengths_are_refused(size: float) -> None:
    with pytest.raises(DerivationError, match=r"'random1': its longest step .* m, expected 1e-12 to 1e\+12"):
        derive_model(_resized(random_chain(1, "RRR"), size))


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1e9])
@pytest.mark.filterwarnings("error")
def test_small_and_large_robots_are_as_accurate(size: float) -> None:
    assert derive_model(_resized(random_chain(1, "RPR"), size)).certificate.max() < 1e-12


@pytest.mark.parametrize("mass", [1e-300, 1e300])
@pytest.mark.filterwarnings("error")
def test_masses_of_any_size(mass: float) -> None:
    chain = random_chain(1, "RPR")
    assert derive_model(replace(chain, parameters=chain.parameters * mass)).certificate.max() < 1e-12


@pytest.mark.filterwarnings("error")
def test_a_certificate_that_the_numbers_spoil_blames_them() -> None:
    """Two bodies on one slide, the second on a slide across it, of masses a trillion times their sum and of opposite sign:
    the first slide's force is the rest."""
    chain = random_chain(1, "PP", tidy=True)
    parameters = np.zeros_like(chain.parameters)
    parameters[:, 0] = np.pi * 1e12, -np.pi * 1e12 + 0.1
    across = Placement(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.zeros(3))
    places = (Placement.identity(), across)
    joints = tuple(replace(joint, placement=p) for joint, p in zip(chain.joints, places, strict=True))
    spoilt = replace(chain, joints=joints, parameters=parameters)
    with pytest.raises(DerivationError, match="joint 'joint1': its torque is the difference") as caught:
        derive_model(spoilt)
    assert "units" in caught.value.hint
