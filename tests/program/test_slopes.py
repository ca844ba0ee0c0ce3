"""Derivatives beside what is recorded: by inputs alone, at computed values by putting them in afterwards."""

from __future__ import annotations

import pytest

from psdmc.errors import InternalError
from psdmc.program.interpret import interpret
from psdmc.program.program import Slot
from psdmc.program.replay import substituted
from psdmc.program.slopes import gradients, slopes
from psdmc.program.trace import Tracer


def test_derivatives_by_a_computed_value_are_refused() -> None:
    """In tau z / 2, whose factor one half is merged into other factors, nothing is left of tau / 2 to differentiate by."""
    tracer = Tracer()
    tau, z = tracer.symbols("tau", 2)
    for computed in (tau * z, tau + 1.0, 0.5 * (tau * z)):
        for derivative in (
            lambda: gradients([2.0 * computed], [1.0], [[computed]]),  # noqa: B023
            lambda: slopes([tau], [computed], [1.0]),  # noqa: B023
        ):
            with pytest.raises(InternalError, match="derivatives are by inputs"):
                derivative()


def test_derivatives_by_a_multiple_of_an_input_are_those_by_the_input_over_the_factor() -> None:
    """A half of tau, doubled, is recorded as tau. Negative factors are signs of symbols."""
    tracer = Tracer()
    tau, z = tracer.symbols("tau", 2)
    half, minus = 0.5 * tau, -4.0 * z
    product = (2.0 * half) * z
    ((by_half, by_minus),) = gradients([product], [1.0], [[half, minus]])
    (along,) = slopes([product], [half, minus], [3.0, 1.0])
    program = tracer.finish([(Slot("out", k), value) for k, value in enumerate((by_half, by_minus, along))])
    out = interpret(program, {"tau": [5.0, 7.0]}, {"out": 3})["out"]
    assert out.tolist() == [2.0 * 7.0, -5.0 / 4.0, 3.0 * 2.0 * 7.0 - 5.0 / 4.0]


def test_at_a_computed_value_an_input_stands_for_it() -> None:
    """d (x^2 y) at fixed x = tau / 2, which depends on y's input too."""
    tracer = Tracer()
    (tau,), (y,), (free,) = (tracer.symbols(name, 1) for name in ("tau", "y", "free"))
    x = 0.5 * tau * y
    ((by_y,),) = gradients([free * free * y], [1.0], [[y]])
    (found,) = substituted([by_y], [free], [x])
    program = tracer.finish([(Slot("out", 0), found)])
    out = interpret(program, {"tau": [3.0], "y": [0.7], "free": [float("nan")]}, {"out": 1})["out"][0]
    assert out == pytest.approx((0.5 * 3.0 * 0.7) ** 2, rel=1e-15)


def test_only_inputs_can_be_replaced() -> None:
    tracer = Tracer()
    (tau,) = tracer.symbols("tau", 1)
    with pytest.raises(InternalError, match="only inputs"):
        substituted([tau], [-tau], [1.0])


def test_numbers_have_no_slopes_and_inputs_that_do_not_matter_none_either() -> None:
    tracer = Tracer()
    a, b = tracer.symbols("q", 2)
    assert gradients([3.0], [a], [[b]]) == [[0.0]]
    assert slopes([3.0, a], [b], [1.0]) == [0.0, 0.0]
    assert gradients([a], [2.0], [[b]]) == [[0.0]]


def test_signs_beside_values_are_kept() -> None:
    tracer = Tracer()
    a, b = tracer.symbols("q", 2)
    program = tracer.finish(
        [
            (Slot("out", i), value)
            for i, value in enumerate(
                [*gradients([-(a * b)], [2.0], [[a, b]])[0], *slopes([-(a * b)], [a, b], [1.0, -1.0])]
            )
        ]
    )
    out = interpret(program, {"q": [3.0, 5.0]}, {"out": 3})["out"]
    assert out.tolist() == [-10.0, -6.0, -5.0 + 3.0]
