"""Interleaving, idle check and the figures drawn from trials."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_contestants import tiny

from psdmc.bench import measure as measuring
from psdmc.bench.contestant import Runner
from psdmc.bench.machine import others_share, this_machine
from psdmc.bench.measure import PATIENCE, Spread, measure
from psdmc.bench.states import States


@pytest.fixture(scope="module")
def runner(two_link):
    return Runner(tiny("sums"), States.random(two_link.chain, 1024, seed=1))


def shares(*values: float):
    """A stand-in for the machine: what others used, round by round."""
    left = iter(values)
    return lambda: lambda: next(left)


@pytest.mark.needs("g++")
def test_only_idle_rounds_count(runner, monkeypatch):
    monkeypatch.setattr(measuring, "others_share", shares(0.0, 0.9, 0.0))

    found = measure([runner], rounds=2)

    assert (found.rounds, found.idle) == (2, True)


@pytest.mark.needs("g++")
def test_a_machine_that_is_never_idle_is_said_to_be_busy(runner, monkeypatch):
    monkeypatch.setattr(measuring, "others_share", shares(*[0.9] * PATIENCE * 2))

    found = measure([runner], rounds=2)

    assert (found.rounds, found.idle) == (PATIENCE * 2, False)


def test_spread_is_median_quartiles_and_best():
    assert Spread.of([5.0, 1.0, 2.0, 3.0, 4.0]) == Spread(median=3.0, low=2.0, high=4.0, best=1.0)


@pytest.mark.needs("g++")
def test_latency_and_tail_only_where_one_state_is_a_call(runner, two_link, monkeypatch):
    monkeypatch.setattr(measuring, "others_share", shares(*[0.0] * 9))
    by_lane = Runner(tiny("by_lane", layout="lanes", lanes=4), States.random(two_link.chain, 1024, seed=1))

    single, batch = measure([runner, by_lane], rounds=1).times

    assert single.latency is not None
    assert single.tail is not None
    assert single.tail.worst >= single.tail.median
    assert (batch.latency, batch.tail) == (None, None)


def test_own_work_is_not_taken_for_others():
    share = others_share()
    np.linalg.svd(np.random.default_rng(1).normal(size=(200, 200)))

    assert 0.0 <= share() <= 1.0 + (this_machine().cores or 1)


def test_the_machine_is_described():
    machine = this_machine()

    assert machine.cores >= 1
    assert "-O3" in machine.flags
