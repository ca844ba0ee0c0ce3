"""Statements of Rust mean what their PROGRAM means: they are few enough that Python runs them."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from bundled import bundled_model
from random_programs import SEEDS, outputs_of, random_program

from psdmc.backends.info import package_info
from psdmc.backends.rust.back_end import _kernel
from psdmc.backends.rust.body import WRITTEN, statements
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.program.kernel import Kernel
from psdmc.program.program import Instr, Op, Program, Slot
from psdmc.program.signature import Quantity

TAU = Quantity("tau", ("3",))
SHAPES = {"q": (3,), "qd": (3,), "tau": (3,)}


def run(lines: list[str], **given: object) -> dict[str, object]:
    """The values after these statements."""
    names = {
        **given,
        "fma": lambda a, b, c: a * b + c,
        "select": lambda a, b, x, y: x if a < b else y,
        "sqrt": math.sqrt,
        "sin_cos": lambda x: ([math.sin(each) for each in x], [math.cos(each) for each in x]),
    }
    for line in lines:
        text = re.sub(r"^let (mut )?", "", line).removesuffix(";")
        text = re.sub(r"\[0\.0; (\d+)\]", r"[0.0] * \1", text)
        exec(text, names)
    return names


@pytest.mark.parametrize("seed", SEEDS)
def test_random_programs(seed: int) -> None:
    program = random_program(seed, of=WRITTEN)
    lines = statements(program, SHAPES, [TAU])
    q, qd = np.random.default_rng(7).uniform(-1, 1, (2, 50, 3))

    found = [run(lines, q=q[k], qd=qd[k])["tau"] for k in range(50)]

    np.testing.assert_allclose(found, outputs_of(program), rtol=1e-12, atol=1e-12)


def test_a_product_that_is_only_added_is_fused() -> None:
    body = (
        *(Instr(Op.LOAD, slot=Slot("q", k)) for k in range(3)),
        Instr(Op.MUL, (0, 1)),
        Instr(Op.SUB, (2, 3)),
        Instr(Op.ADD, (4, 3)),
    )
    program = Program(body, ((Slot("tau", 0), 5), (Slot("tau", 1), 4)))

    lines = statements(program, SHAPES, [TAU])

    assert lines == [
        "let mut tau = [0.0; 3];",
        "let t4 = fma(-q[0], q[1], q[2]);",
        "tau[1] = t4;",
        "let t5 = fma(q[0], q[1], t4);",
        "tau[0] = t5;",
    ]


def test_a_product_that_is_put_out_is_not() -> None:
    body = (
        *(Instr(Op.LOAD, slot=Slot("q", k)) for k in range(2)),
        Instr(Op.MUL, (0, 1)),
        Instr(Op.ADD, (2, 0)),
    )
    program = Program(body, ((Slot("tau", 0), 2), (Slot("tau", 1), 3)))

    assert "fma" not in "".join(statements(program, SHAPES, [TAU]))


def test_a_function_that_needs_what_the_crate_lacks_is_refused() -> None:
    body = (Instr(Op.LOAD, slot=Slot("q", 0)), Instr(Op.LOAD, slot=Slot("q", 1)), Instr(Op.TANH, (0,)))
    tau = Kernel(
        RECIPES["gravity"].signature, False, Program(body, ((Slot("g", 0), 2),)), Program((), ()), "factored"
    )
    info = package_info(bundled_model("two_link"))

    with pytest.raises(InputError, match="gravity of two_link needs tanh, which the Rust back end lacks"):
        _kernel(tau, info)
