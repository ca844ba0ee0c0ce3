"""Rivals are optional: none is needed, and one that cannot be built is shown with its reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, robot_path
from unoptimised import without_optimisation

from psdmc.bench.case import Case, generic_chain, robot_as_numbers
from psdmc.bench.cases import first_joints, oblique_chain, standard_cases
from psdmc.bench.contestant import Contestant, Unavailable
from psdmc.bench.rivals import EVERYONE, Entrant, casadi_c, mujoco_c, pinocchio_cpp, psdmc_c
from psdmc.bench.rivals.mujoco_c import mjcf, quaternion
from psdmc.bench.run import Settings, run
from psdmc.compiler import derive
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError, ToolchainError


def refuses(*arguments):
    raise ToolchainError("the wheel 'rival' is not installed", "pip install rival")


def test_a_rival_that_cannot_be_built_says_why(two_link):
    assert Entrant("rival", refuses).contestants(two_link) == [
        Unavailable("rival", "the wheel 'rival' is not installed")
    ]


@pytest.mark.slow
def test_without_compiler_nobody_is_dropped_silently(two_link, monkeypatch, tmp_path):
    monkeypatch.setenv("CXX", "no-such-compiler")
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path))

    for entrant in EVERYONE:
        found = list(entrant.contestants(two_link))
        assert [type(one) for one in found] == [Unavailable] * len(found)
        assert found


def test_a_form_too_large_to_compile_is_left_out_with_the_reason(two_link, monkeypatch):
    monkeypatch.setattr(psdmc_c, "EXPANDED_LIMIT", 17)

    (answer,) = psdmc_c.expanded(two_link, ())

    assert answer == Unavailable(
        "psdmc expanded", "p = 18 monomials: not lowered and compiled beyond 17, it takes too long"
    )


@pytest.mark.needs("g++")
def test_the_benchmark_works_with_no_rival(two_link):
    with without_optimisation():
        result = run([two_link], Settings(rounds=1, states=2048, rivals=("psdmc factored", "psdmc expanded")))

    assert {m.rival for m in result.cases[0].measurements} == {"psdmc factored", "psdmc expanded"}
    assert result.wrong == ()


def test_numbers_read_back_exactly(two_link):
    lines = robot_as_numbers(two_link.chain).splitlines()
    word, parent, *numbers = lines[2].split()

    assert lines[0].split()[0] == "2"
    assert (word, parent) == ("RZ", "1")
    assert len(numbers) == 9 + 3 + 10 + 1
    assert np.array_equal(
        np.array(numbers[9:12], dtype=float), two_link.chain.joints[1].placement.translation
    )


@pytest.mark.parametrize("seed", range(8))
def test_quaternions_give_their_rotation_back(seed):
    rotation = oblique_chain(1, seed).joints[0].placement.rotation
    w, x, y, z = quaternion(rotation)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])

    assert np.allclose(np.eye(3) + 2 * w * cross + 2 * cross @ cross, rotation, atol=1e-14)


def test_mujoco_gets_one_body_a_joint(two_link):
    assert mjcf(generic_chain(two_link.chain, 1)).count("<body ") == 2


@pytest.mark.needs("g++")
def test_mujoco_is_not_asked_for_what_it_leaves_out(two_link):
    (answer,) = mujoco_c.contestants(two_link, ())

    assert isinstance(answer, Unavailable)


@pytest.mark.parametrize("rival", ["Pinocchio", "CasADi"])
def test_a_regressor_without_drive_inertia_is_not_called_wrong(rival, monkeypatch):
    """It is left out with the reason where the robot has drive inertia, and only there."""
    if rival == "CasADi":
        counts = {way: (1, 1) for ways in casadi_c.WAYS.values() for way in ways}
        monkeypatch.setattr(casadi_c, "written", lambda case: ("", counts))
        monkeypatch.setattr(casadi_c, "_by_lane", refuses)
        monkeypatch.setattr(casadi_c, "_scalar", lambda *arguments: Path("casadi.so"))
    else:
        monkeypatch.setattr(pinocchio_cpp, "compiled", lambda way, flags: Path("pinocchio.so"))
    build = {"Pinocchio": pinocchio_cpp.library, "CasADi": casadi_c.contestants}[rival]
    bare = Case("bare", bundled_model("scara"))
    geared = Case("geared", derive(robot_path("scara"), drive_inertia=(0.0, 0.3, 0.0, 0.0)))

    assert "regressor" in [one.function for one in build(bare, ()) if isinstance(one, Contestant)]
    entries = build(geared, ())
    functions = [one.function for one in entries if isinstance(one, Contestant)]
    assert "regressor" not in functions
    assert "inverse_dynamics" in functions
    left_out = [one for one in entries if isinstance(one, Unavailable) and one.rival == f"{rival}, regressor"]
    assert [one.reason for one in left_out] == ["it has no columns for drive inertia, which this robot has"]


def test_generic_inertias_are_physical_and_the_same_for_the_same_seed():
    chain = oblique_chain(3, 1)
    first, second = generic_chain(chain, 7), generic_chain(chain, 7)

    assert np.array_equal(first.parameters, second.parameters)
    assert np.all(first.parameters[:, 10] == 0.0)
    model = derive_model(first, expand=False)
    assert model.theta_b is not None


def test_a_chain_cut_short_is_the_chains_beginning():
    chain = generic_chain(oblique_chain(4, 2), 1)
    short = first_joints(chain, 2)

    assert len(short) == 2
    assert np.array_equal(short.parameters, chain.parameters[:2])
    assert short.parameter_span.shape == (22, 20)


def test_an_unknown_robot_is_refused_by_name():
    with pytest.raises(InputError, match="'KR7'"):
        next(standard_cases(["KR7"]))


def test_unknown_inertia_is_refused(two_link):
    unknown = derive_model(two_link.chain, expand=False)
    object.__setattr__(unknown, "theta_b", None)

    with pytest.raises(InputError, match="inertial parameter"):
        Case("two-link", unknown)
