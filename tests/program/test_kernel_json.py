"""Kernels kept as text come back as they were, and nothing else is taken for them."""

from __future__ import annotations

import math

import pytest
from bundled import bundled_model

from psdmc.errors import InternalError
from psdmc.functions import RECIPES, SIGNATURES
from psdmc.lower.reframe import unmoved
from psdmc.program.kernel import Kernel
from psdmc.program.kernel_json import kernels_from_json, kernels_to_json
from psdmc.program.limb_program import LimbGroup, LimbProgram, Stage
from psdmc.program.products import Shares, ThinProducts
from psdmc.program.program import Instr, Op, Program, Slot
from psdmc.program.text import parse

GRAVITY = parse("""
    a = load q[0]
    s = sin a
    c = const 0.1
    x = mul c s
    y = neg x
    out g[0] = y
""")


def kernels() -> dict[str, Kernel]:
    other = parse("a = load q[0]\nout g[0] = a")
    made = (
        Kernel(SIGNATURES["gravity"], False, GRAVITY, GRAVITY, "factored"),
        Kernel(SIGNATURES["gravity"], True, GRAVITY, other, "expanded"),
    )
    return {kernel.name: kernel for kernel in made}


def test_what_stands_before_products_comes_back():
    made = Kernel(SIGNATURES["gravity"], False, GRAVITY, GRAVITY, "factored", GRAVITY)
    assert kernels_from_json(kernels_to_json({"gravity": made}), SIGNATURES) == {"gravity": made}


def test_limbs_and_the_products_behind_them_come_back():
    group = LimbGroup(0, 2, ((Slot("group0_q", 0), (Slot("q", 0), Slot("q", 1))),), ((1.0, 2.0),), ())
    products = ThinProducts(("g",), (0,), 2, (0,), (Shares("group0_shares", (1,), (0,), True),), ("g",))
    limbs = LimbProgram(
        (group,), (Stage(None, parse("a = load q[0]\nout g_core[0] = a")),), 4, (products,), True
    )
    made = Kernel(SIGNATURES["gravity"], False, GRAVITY, GRAVITY, "factored", limbs=limbs)
    assert kernels_from_json(kernels_to_json({"gravity": made}), SIGNATURES) == {"gravity": made}


def test_regions_come_back():
    """Loops, slices, calls, constants and straight lines."""
    regions = RECIPES["rk4_step_derivatives"].regions(unmoved(bundled_model("scara").mechanism).frames)
    nothing = Program((), ())
    made = Kernel(SIGNATURES["rk4_step_derivatives"], True, nothing, nothing, "factored", regions=regions)
    assert kernels_from_json(kernels_to_json({made.name: made}), SIGNATURES) == {made.name: made}


def test_kernels_come_back_equal_and_in_order():
    found = kernels_from_json(kernels_to_json(kernels()), SIGNATURES)

    assert found == kernels()
    assert list(found) == ["gravity", "gravity_theta"]
    assert found["gravity"].batch is found["gravity"].single


@pytest.mark.parametrize("value", [5e-324, 1.7976931348623157e308, 0.1 + 0.2, -0.0, 1 / 3])
def test_constants_come_back_bit_for_bit(value: float):
    program = Program((Instr(Op.CONST, value=value),), ((Slot("g", 0), 0),))
    kept = Kernel(SIGNATURES["gravity"], False, program, program, "factored")

    (found,) = kernels_from_json(kernels_to_json({kept.name: kept}), SIGNATURES).values()

    constant = found.single.body[0].value
    assert constant == value
    assert math.copysign(1.0, constant) == math.copysign(1.0, value)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text.replace('"format":6', '"format":5'),
        lambda text: text.replace('"mul"', '"hypot"'),
        lambda text: text.replace('"gravity"', '"weight"'),
        lambda text: text.replace('["mul",2,1]', '["mul",2,9]'),
        lambda text: text.replace('["mul",2,1]', '["mul",2]'),
        lambda text: "[]",
    ],
)
def test_a_changed_text_is_refused(change):
    text = kernels_to_json(kernels())
    assert change(text) != text

    with pytest.raises(InternalError):
        kernels_from_json(change(text), SIGNATURES)
