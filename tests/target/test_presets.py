"""Targets by name, and what the search and the passes read of them."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import pytest

from psdmc.errors import InputError
from psdmc.program.cost import Cost, for_lanes, for_one_state
from psdmc.program.pipeline import ordered, shortened
from psdmc.program.program import Program
from psdmc.program.text import parse, show
from psdmc.target.presets import COSTS, NATIVE, PRESETS, SCALAR, preset
from psdmc.target.target import AVX, SSE2, Costs

NAMES = ("native", "x86-64-v2", "x86-64-v3", "x86-64-v4", "neon", "scalar", "cortex-m4f", "cortex-m7")


def test_the_presets_are_these() -> None:
    assert tuple(PRESETS) == NAMES
    assert all(preset(name).name == name for name in NAMES)


def test_an_unknown_name_is_refused_with_the_list() -> None:
    with pytest.raises(InputError, match=r"^target is 'pentium'") as refused:
        preset("pentium")
    assert refused.value.hint == f"choose one of {', '.join(NAMES)}"


def test_a_target_is_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        NATIVE.cache_line = 32  # type: ignore[misc]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"vectors": (SSE2, AVX)}, "not widest first"),
        ({"vectors": ()}, "costs of another machine"),
        ({"forms": ("batch",)}, "no beginning"),
        ({"forms": ()}, "no beginning"),
    ],
)
def test_a_target_that_contradicts_itself_is_refused(
    change: dict[str, tuple[object, ...]], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        replace(NATIVE, **change)  # type: ignore[arg-type]


COUNTS = Cost(mul=10, add=20, div=1, neg=2, sincos=6, fused=4)


@pytest.mark.parametrize(
    ("change", "more"),
    [
        ({"div": 9.0}, 1.0),
        ({"neg": 1.1}, 2.0),
        ({"fused": 0.0}, 2.0),
        ({"sincos": 31.0}, 1.0),
        ({"angle": 2.0}, 6.0),
        ({"angles_per_sincos": 2}, 60.0),
    ],
)
def test_the_search_weighs_what_the_target_says(change: dict[str, float], more: float) -> None:
    other = replace(COSTS, **change)  # type: ignore[arg-type]
    assert for_one_state(other).weight(COUNTS) - for_one_state(COSTS).weight(COUNTS) == pytest.approx(more)


def test_in_lanes_every_angle_pays_a_sincos() -> None:
    assert for_lanes(COSTS).weight(COUNTS) - for_one_state(COSTS).weight(COUNTS) == 5 * COSTS.sincos


SUM = """
a = load q[0]
b = load q[1]
s = sin a
d = div a b
x = add s d
y = add x b
out tau[0] = y
"""


def order_of(text: str, costs: Costs) -> list[str]:
    return show(ordered(shortened(parse(text)), costs)[0]).splitlines()


def test_sums_follow_the_targets_latencies() -> None:
    """What is ready last is added last: the sine by default, the division where that takes longer."""
    slow = replace(COSTS, latency=replace(COSTS.latency, div=100))
    assert order_of(SUM, COSTS)[-3:-1] == ["t4 = add t1 t3", "t5 = add t2 t4"]
    assert order_of(SUM, slow) != order_of(SUM, COSTS)


def crossing(count: int) -> Program:
    """`count` products, then sums of each with its opposite: nested by readiness they stay alive for long."""
    lines = [f"a{i} = load q[{i}]" for i in range(count)]
    lines += [f"p{i} = mul a{i} a{(i + 1) % count}" for i in range(count)]
    lines += [f"s{i} = sin p{i}" for i in range(count)]
    lines += ["t0 = add s0 p0"]
    for i in range(1, count):
        lines += [f"u{i} = mul s{i} p{count - i}", f"t{i} = add t{i - 1} u{i}"]
    return parse("\n".join([*lines, f"out tau[0] = t{count - 1}"]))


def test_lanes_have_an_order_of_their_own_only_where_one_state_is_crowded() -> None:
    one, lanes = ordered(shortened(crossing(24)), replace(COSTS, crowded=0.0))
    assert one != lanes
    assert ordered(shortened(crossing(24)), replace(COSTS, crowded=1e9)) == (one, one)
    assert (
        ordered(shortened(crossing(24)), SCALAR.costs)[1] == ordered(shortened(crossing(24)), SCALAR.costs)[0]
    )


def test_where_spills_wait_one_state_takes_the_order_with_fewer() -> None:
    one, lanes = ordered(shortened(crossing(24)), replace(COSTS, crowded=0.0))
    waits = replace(COSTS, crowded=0.0, spills_wait=True, registers=2)
    assert ordered(shortened(crossing(24)), waits) == (lanes, lanes)
    assert ordered(shortened(crossing(24)), replace(waits, registers=1000))[0] == one
