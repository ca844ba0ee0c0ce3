"""The timing loops, on contestants whose outputs are known."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_contestants import tiny

from psdmc.bench.contestant import Runner
from psdmc.bench.states import States


@pytest.fixture(scope="module")
def states(two_link):
    return States.random(two_link.chain, 2048, seed=1)


@pytest.mark.needs("g++")
@pytest.mark.parametrize(("symbol", "layout", "lanes"), [("sums", "state", 1), ("by_lane", "lanes", 4)])
def test_every_state_is_computed_in_its_place(symbol, layout, lanes, states):
    found = Runner(tiny(symbol, layout=layout, lanes=lanes), states).outputs()

    assert np.array_equal(found, states.q + 10.0 * states.qd + 100.0 * states.qdd)


@pytest.mark.needs("g++")
def test_times_come_block_by_block(states):
    runner = Runner(tiny("sums"), states)

    assert runner.throughput().shape == (2048 // 1024,)
    assert runner.latency().shape == (1,)
    assert runner.tail().shape == (2048 // 64,)


@pytest.mark.needs("g++")
def test_more_work_takes_longer(states):
    few, many = (np.median(Runner(tiny(name), states).throughput()) for name in ("few", "many"))

    assert many > 2.0 * few


def test_forward_dynamics_gets_torques(states):
    _, _, x = states.inputs("forward_dynamics")

    assert np.array_equal(x, states.tau.ravel())


def test_lane_by_lane_layout_is_block_variable_lane(states):
    q, _, _ = states.inputs("inverse_dynamics", lanes=4)

    assert np.array_equal(q.reshape(-1, 2, 4)[3, 1], states.q[12:16, 1])


def test_same_seed_gives_the_same_states(two_link):
    first, second, other = (States.random(two_link.chain, 16, seed) for seed in (1, 1, 2))

    assert np.array_equal(first.qdd, second.qdd)
    assert not np.array_equal(first.qdd, other.qdd)
