"""While a stage runs, cycles are looked for rarely; afterwards as before, whoever else ran one meanwhile."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from weakref import ref

import pytest

from psdmc.garbage import RARELY, collecting_rarely
from psdmc.lower.dimension_check import DimensionedTracer
from psdmc.program.limb_program import LimbSums
from psdmc.program.trace import Tracer


@pytest.fixture(autouse=True)
def usual() -> Iterator[None]:
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


def test_rarely_within_and_as_before_behind() -> None:
    gc.set_threshold(701, 11, 12)
    with collecting_rarely():
        assert gc.get_threshold() == (RARELY, 11, 12)
    assert gc.get_threshold() == (701, 11, 12)


def test_as_before_behind_an_error() -> None:
    gc.set_threshold(701, 11, 12)
    with pytest.raises(KeyError), collecting_rarely():
        raise KeyError
    assert gc.get_threshold() == (701, 11, 12)


def test_the_last_of_several_stages_sets_it_back() -> None:
    """Two threads' stages overlap: the first to begin is the first to end."""
    gc.set_threshold(701, 11, 12)
    one, other = collecting_rarely(), collecting_rarely()
    one.__enter__()
    other.__enter__()
    one.__exit__(None, None, None)
    assert gc.get_threshold() == (RARELY, 11, 12)
    other.__exit__(None, None, None)
    assert gc.get_threshold() == (701, 11, 12)


@pytest.mark.parametrize("own", [0, 2 * RARELY])
def test_a_process_that_looks_more_rarely_or_never(own: int) -> None:
    gc.set_threshold(own, 11, 12)
    with collecting_rarely():
        assert gc.get_threshold() == (own, 11, 12)
    assert gc.get_threshold() == (own, 11, 12)


def with_limbs() -> Tracer:
    tracer = Tracer()
    sums = LimbSums(tracer, [2])
    sums.add_input("group0_q", 0)
    sums.total(0, tracer.symbols("group0_q", 1)[0])
    return tracer


@pytest.mark.parametrize("make", [Tracer, DimensionedTracer, with_limbs])
def test_a_trace_is_gone_without_a_search_for_cycles(make: Callable[[], Tracer]) -> None:
    gc.set_threshold(0)
    alive = ref(make())

    assert alive() is None
