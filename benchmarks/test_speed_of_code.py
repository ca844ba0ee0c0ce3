"""The compiled functions from the same C loops as `make bench`: one figure is 65,536 states."""

from __future__ import annotations

from functools import cache

import pytest

from psdmc.bench.case import Case
from psdmc.bench.cases import standard_cases
from psdmc.bench.contestant import Contestant, Runner
from psdmc.bench.machine import native_flags
from psdmc.bench.rivals import pinocchio_cpp, psdmc_c
from psdmc.bench.run import CHECKED, disagreement, tolerance
from psdmc.bench.states import COUNT, States
from psdmc.errors import ToolchainError

ROBOTS = ("Denso", "KR6", "LBR7")
OURS = [(function, layout) for function in psdmc_c.FUNCTIONS for layout in ("state", "rows", "lanes")]
THEIRS = [symbol for symbols in pinocchio_cpp.SYMBOLS.values() for symbol in symbols]


@cache
def case_of(robot: str) -> Case:
    return next(standard_cases([robot]))


@cache
def states_of(robot: str) -> States:
    return States.random(case_of(robot).chain, COUNT, seed=1)


@cache
def ours(robot: str) -> tuple[Contestant, ...]:
    return tuple(psdmc_c.factored(case_of(robot), native_flags()))


@cache
def theirs(robot: str) -> tuple[Contestant, ...]:
    return tuple(pinocchio_cpp.library(case_of(robot), native_flags()))


def time_of(benchmark, contestant: Contestant, robot: str) -> None:
    checked = States.random(case_of(robot).chain, CHECKED, seed=2)
    assert disagreement(Runner(contestant, checked), checked) <= tolerance(contestant.function)
    runner = Runner(contestant, states_of(robot))

    benchmark.pedantic(runner.throughput, rounds=15, warmup_rounds=2)

    benchmark.extra_info["ns_per_state"] = round(1e9 * benchmark.stats["median"] / COUNT, 2)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("function", "layout"), OURS)
def test_psdmc(benchmark, robot, function, layout):
    time_of(benchmark, next(c for c in ours(robot) if (c.function, c.layout) == (function, layout)), robot)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("symbol", THEIRS)
def test_pinocchio(benchmark, robot, symbol):
    try:
        contestants = theirs(robot)
    except ToolchainError as error:
        pytest.skip(error.message)
    time_of(benchmark, next(c for c in contestants if c.symbol == symbol), robot)
