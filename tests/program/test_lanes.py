"""Constants of limbs: arithmetic one limb at a time, plain numbers where limbs agree, and symbols beside them."""

from __future__ import annotations

import pytest

from psdmc.program.lanes import Lanes, lanes
from psdmc.program.program import Slot
from psdmc.program.text import show
from psdmc.program.trace import Tracer

A = Lanes(0, (2.0, -4.0))


def test_limb_by_limb():
    assert Lanes(0, (3.0, -3.0)) == A + 1
    assert Lanes(0, (-1.0, 5.0)) == 1 - A
    assert A * Lanes(0, (3.0, 5.0)) == Lanes(0, (6.0, -20.0))
    assert Lanes(0, (0.5, -0.25)) == 1.0 / A
    assert Lanes(0, (1.0, -2.0)) == A / 2
    assert Lanes(0, (-4.0, 8.0)) == -A - A


@pytest.mark.parametrize(
    ("found", "number"), [(A - A, 0.0), (A / A, 1.0), (abs(lanes(0, [1.0, -1.0])), 1.0), (0.0 * A, 0.0)]
)
def test_a_plain_number_where_all_agree(found: object, number: float):
    assert isinstance(found, float)
    assert found == number


def test_two_groups_do_not_mix():
    with pytest.raises(ValueError, match="two groups"):
        A + Lanes(1, (1.0, 2.0))


def test_a_symbol_times_a_constant_loads_it_and_constants_along_a_product_become_one():
    tracer = Tracer()
    x = tracer.symbol(Slot("q", 0))

    program = tracer.finish([(Slot("y", 0), 3.0 * x * A), (Slot("y", 1), x * (A * -3.0)), (Slot("y", 2), A)])

    assert show(program).splitlines() == [
        "t0 = load q[0]",
        "t1 = load group0_constants[0]",
        "t2 = mul t0 t1",
        "t3 = neg t2",
        "t4 = load group0_constants[1]",
        "out y[0] = t2",
        "out y[1] = t3",
        "out y[2] = t4",
    ]
    assert tracer.lane_constants == {0: [(6.0, -12.0), (2.0, -4.0)]}


def test_sums_quotients_and_signs():
    tracer = Tracer()
    x = tracer.symbol(Slot("q", 0))

    program = tracer.finish(
        [(Slot("y", 0), A - x), (Slot("y", 1), x / A), (Slot("y", 2), 1.0 / (x + A)), (Slot("y", 3), -A / x)]
    )

    lines = show(program).splitlines()
    assert "t2 = sub t0 t1" in lines
    assert tracer.lane_constants[0] == [(2.0, -4.0), (0.5, -0.25)]
    assert [line for line in lines if "div" in line] == ["t7 = div t6 t5", "t8 = div t1 t0"]
