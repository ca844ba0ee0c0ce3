"""Functions with several outputs and with a fourth input behind the benchmark's loops."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.bench.contestant import SEVERAL_SHARE, Contestant, Runner, Unavailable
from psdmc.bench.machine import native_flags
from psdmc.bench.rivals import cppadcg_c, psdmc_c
from psdmc.bench.run import checked, disagreement
from psdmc.bench.states import States
from psdmc.errors import ToolchainError

SEVERAL, FOUR = "inverse_dynamics_derivatives", "inverse_dynamics_with_wrenches"


@pytest.fixture(scope="module")
def entered(two_link) -> dict[tuple[str, str], Contestant]:
    found = psdmc_c.contestants(two_link, "factored", (SEVERAL, FOUR), native_flags())
    return {(one.function, one.layout): one for one in found}


@pytest.mark.needs("g++")
def test_every_layout_of_both_is_right(entered, two_link):
    right, errors, wrong = checked(two_link, list(entered.values()), seed=1)

    assert (len(right), wrong) == (6, ())
    assert max(errors) < 1e-12


@pytest.mark.needs("g++")
@pytest.mark.parametrize("layout", ["state", "rows", "lanes"])
def test_a_wrong_entry_of_a_small_block_is_found(layout, entered, two_link, monkeypatch):
    """Each block has its own scale: M is small beside the others where the arm moves fast."""
    states = States.random(two_link.chain, 64, seed=2)
    fast = States(two_link.chain, states.q, 1e5 * states.qd, states.qdd)
    runner = Runner(entered[SEVERAL, layout], fast)
    assert disagreement(runner, fast) < 1e-12
    found = runner.outputs()
    found[:, 11] *= 1.0 + 1e-6  # the last entry of M
    monkeypatch.setattr(runner, "outputs", lambda: found)

    assert disagreement(runner, fast) == pytest.approx(1e-6, rel=0.5)


@pytest.mark.needs("g++")
def test_the_fourth_input_counts(entered, two_link):
    """Without the wrenches the torques are others."""
    states = States.random(two_link.chain, 64, seed=3)
    torques = Runner(entered[FOUR, "state"], states).outputs()

    assert np.abs(torques - states.tau).max() > 0.1
    assert (states.more(FOUR), states.more(SEVERAL)) == (6, 0)


@pytest.mark.needs("g++")
def test_several_outputs_are_timed_over_fewer_states(entered, two_link):
    states = States.random(two_link.chain, 4096, seed=4)
    blocks = {name: len(Runner(entered[name, "state"], states).tail()) for name in (SEVERAL, FOUR)}

    assert blocks[FOUR] == SEVERAL_SHARE * blocks[SEVERAL]


def test_without_its_wheel_cppadcodegen_says_what_to_install(two_link, monkeypatch, tmp_path):
    monkeypatch.setattr(cppadcg_c, "pinocchio_prefix", lambda: tmp_path)
    cppadcg_c._writer.cache_clear()

    with pytest.raises(ToolchainError, match="cmeel-cppadcodegen") as found:
        cppadcg_c.contestants(two_link, ())
    assert found.value.hint == "pip install cmeel-cppadcodegen"


def test_cppadcodegen_offers_both_ways_of_derivatives(two_link, monkeypatch, tmp_path):
    monkeypatch.setattr(cppadcg_c, "written", lambda case: "")
    monkeypatch.setattr(cppadcg_c, "built", lambda *given: tmp_path)
    found = [one for one in cppadcg_c.contestants(two_link, ()) if not isinstance(one, Unavailable)]

    own = [one for one in found if one.function == SEVERAL]
    assert [(one.label, one.outputs) for one in own] == [
        ("CppADCodeGen JACOBIAN", 12),
        ("CppADCodeGen RECURSION", 12),
    ]
