"""Derivatives beside what is recorded: by inputs alone, at computed values by putting them in afterwards."""

from __future__ import annotations

import pytest

from psdmc.errors import InternalError
from psdmc.program.interpret import interpret, substituted
from psdmc.program.limb_program import LimbGroup, LimbProgram, LimbSums, unpacked
from psdmc.program.limb_stages import staged
from psdmc.program.program import Slot
from psdmc.program.slopes import gradients, slopes
from psdmc.program.trace import Symbol, Tracer


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


def test_derivatives_pass_through_sums_over_limbs() -> None:
    """Three limbs give s = sum c x to the core; they put out y = s x and the core z = s^2. By hand."""
    tracer = Tracer()
    sums = LimbSums(tracer, [3])
    inputs = {name: tuple(Slot(name, limb) for limb in range(3)) for name in ("x", "w", "dx")}
    for name in inputs:
        sums.add_input(f"group0_{name}", 0)
    x, w, dx = (tracer.symbol(Slot(f"group0_{name}", 0)) for name in inputs)
    (c,), (u,), (dc,) = (tracer.symbols(name, 1) for name in ("c", "u", "dc"))
    s = sums.total(0, c * x)
    of = [s * x, s * s]
    (by_x,), (by_c,) = gradients(of, [w, u], [[x], [c]])
    dy, dz = slopes(of, [x, c], [dx, dc])
    own = {name: Slot("group0_output", k) for k, name in enumerate(("by_x", "dy"))}
    spread = tuple((slot, tuple(Slot(name, limb) for limb in range(3))) for name, slot in own.items())
    reads = tuple((Slot(f"group0_{name}", 0), slots) for name, slots in inputs.items())
    group = LimbGroup(0, 3, reads, (), spread)
    stored = [(own["by_x"], by_x), (own["dy"], dy), (Slot("by_c", 0), by_c), (Slot("dz", 0), dz)]
    stored += [(Slot(group.partial, k), Symbol(tracer, index)) for k, index in enumerate(sums.partials[0])]
    program = unpacked(LimbProgram((group,), staged(tracer.finish(stored), [group])))

    values = {"x": [0.5, -1.5, 2.0], "w": [3.0, 1.0, -2.0], "dx": [0.25, 4.0, -0.5]}
    given = values | {"c": [1.25], "u": [0.75], "dc": [-3.0]}
    found = interpret(program, given, {"by_x": 3, "by_c": 1, "dy": 3, "dz": 1})

    whole = sum(values["x"])
    weighted = sum(a * b for a, b in zip(values["w"], values["x"], strict=True)) + 2 * 0.75 * 1.25 * whole
    change = -3.0 * whole + 1.25 * sum(values["dx"])
    assert list(found["by_c"]) == pytest.approx([whole * weighted])
    assert list(found["by_x"]) == pytest.approx([a * 1.25 * whole + 1.25 * weighted for a in values["w"]])
    assert list(found["dz"]) == pytest.approx([2 * 1.25 * whole * change])
    assert list(found["dy"]) == pytest.approx(
        [change * a + 1.25 * whole * b for a, b in zip(values["x"], values["dx"], strict=True)]
    )
