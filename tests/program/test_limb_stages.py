"""Stages of core and limbs: what a cut PROGRAM computes is what the whole does, limb by limb."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.errors import InternalError
from psdmc.program.interpret import interpret
from psdmc.program.limb_program import LimbGroup, LimbProgram, unpacked
from psdmc.program.limb_stages import staged
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.products import Shares, ThinProducts
from psdmc.program.program import Slot
from psdmc.program.text import parse, show

TWO = LimbGroup(
    number=0,
    count=2,
    inputs=((Slot("group0_q", 0), (Slot("q", 1), Slot("q", 2))),),
    constants=((3.0, 5.0),),
    outputs=((Slot("group0_output", 0), (Slot("tau", 1), Slot("tau", 2))),),
)
WHOLE = """
    body = load q[0]
    leg = load group0_q[0]
    k = load group0_constants[0]
    s = sin body
    c = cos leg
    force = mul s c
    own = mul force k
    all = load group0_sum[0]
    carried = mul all s
    pushed = mul carried c
    back = add pushed own
    out tau[0] = carried
    out group0_partial[0] = own
    out group0_output[0] = back
"""


def test_core_limbs_core_limbs():
    stages = staged(parse(WHOLE), [TWO])

    assert [stage.group for stage in stages] == [None, 0, None, 0]
    assert show(stages[0].program).splitlines() == ["t0 = load q[0]", "t1 = sin t0", "out core[0] = t1"]
    assert show(stages[2].program).splitlines() == [
        "t0 = load group0_sum[0]",
        "t1 = load core[0]",
        "t2 = mul t0 t1",
        "out tau[0] = t2",
        "out core[1] = t2",
    ]


def test_written_out_limb_by_limb_it_is_the_same_function():
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (10, 3))
    program = unpacked(LimbProgram((TWO,), staged(parse(WHOLE), [TWO])))

    tau = interpret(program, {"q": q}, {"tau": 3})["tau"]

    s, c = np.sin(q[:, :1]), np.cos(q[:, 1:])
    own = s * c * [3.0, 5.0]
    carried = own.sum(axis=1, keepdims=True) * s
    assert np.allclose(tau, np.hstack([carried, carried * c + own]), rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a = load group0_q[0]\nout tau[0] = a", "differs from limb to limb"),
        ("a = load group0_q[0]\nb = load group1_q[0]\nc = add a b\nout tau[0] = c", "two groups"),
        ("a = load group0_sum[0]\nout tau[0] = a\nout group0_partial[0] = a", "depends on itself"),
    ],
)
def test_what_is_no_function_of_core_and_limbs_is_refused(text: str, fault: str):
    other = LimbGroup(1, 2, ((Slot("group1_q", 0), (Slot("q", 3), Slot("q", 4))),), (), ())
    with pytest.raises(InternalError, match=fault):
        staged(parse(text), [TWO, other])


@pytest.mark.parametrize("is_solved", [False, True])
def test_products_behind_limbs_are_written_out_entry_by_entry(is_solved: bool):
    """Two limbs of one rate on one rate: x = -V E in the core's row, y - T x in a limb's; one column is known. If
    is_solved, the code for limbs stores x itself."""
    group = LimbGroup(
        number=0,
        count=2,
        inputs=((Slot("group0_q", 0), (Slot("q", 1), Slot("q", 2))),),
        constants=(),
        outputs=(
            (Slot("group0_output", 0), (Slot("shares", 0), Slot("shares", 1))),
            (
                Slot("group0_output", 1),
                (Slot("M", 1), Slot("M", 2)) if is_solved else (Slot("M_core", 1), Slot("M_core", 2)),
            ),
            (Slot("group0_output", 2), (Slot("M", 4), Slot("M", 8))),
        ),
    )
    lines = """
        v = load q[0]
        leg = load group0_q[0]
        e = sin leg
        y = cos leg
        p = mul v e
        x = neg p
        out M[0] = v
        out group0_output[0] = leg
        out group0_output[2] = y
    """ + ("out group0_output[1] = x" if is_solved else "out core_inverse[0] = v\n out group0_output[1] = e")
    whole = drop_unused(parse(lines))
    shares = (Shares("shares", (1, 2), (0,)),)
    products = ThinProducts(("M",), (1,), 3, (0,), shares, is_solved=is_solved)
    limbs = LimbProgram((group,), staged(whole, [group]), products=(products,))
    v, a, b = q = np.array([0.7, 0.3, -0.4])

    found = interpret(unpacked(limbs), {"q": q}, {"M": 9})["M"].reshape(3, 3)

    x = -v * np.sin(q[1:])
    np.testing.assert_allclose(found[0], [v, *x], rtol=1e-15)
    np.testing.assert_allclose(found[1:, 0], 0.0)
    np.testing.assert_allclose(found[1:, 1:], np.diag(np.cos(q[1:])) - np.outer([a, b], x), rtol=1e-15)
    assert (products.cost.mul, products.cost.add) == ((2, 2) if is_solved else (3, 2))
