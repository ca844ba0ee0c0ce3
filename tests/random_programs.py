"""Seeded random PROGRAMs, and a way to compare two of them."""

from __future__ import annotations

import random
from collections.abc import Collection

import numpy as np

from psdmc.program.interpret import interpret
from psdmc.program.program import Instr, Op, Program, Slot, check

SEEDS = range(30)
_SIZES = {"tau": 3}


def random_program(seed: int, length: int = 60, of: Collection[Op] = tuple(Op)) -> Program:
    """Loads, a few constants, then operations that prefer recent values; three outputs of shared parts.

    of  operations that may occur beside sums, products, negation, sine and cosine, which always may
    """
    choose = random.Random(seed)
    body = [Instr(Op.LOAD, slot=Slot(vector, i)) for vector in ("q", "qd") for i in range(3)]
    body += [Instr(Op.CONST, value=value) for value in (0.0, 1.0, -1.0, 2.5, -0.3)]
    rare = {
        op: 1 for op in Op if op in of and op.arity and op not in (Op.DIV, Op.SQRT, Op.EXP, Op.LOG, Op.POW)
    }  # these overflow or are NaN
    weights = rare | {Op.ADD: 10, Op.SUB: 10, Op.MUL: 16, Op.NEG: 4, Op.SIN: 2, Op.COS: 2}
    for _ in range(length):
        op = choose.choices(list(weights), list(weights.values()))[0]
        recent = range(max(0, len(body) - 20), len(body))
        args = tuple(choose.choice([*range(11), *recent]) for _ in range(op.arity))
        # sums of products would overflow when squared again and again: products take one small factor
        if op is Op.MUL:
            args = (args[0], choose.randrange(11))
        body.append(Instr(op, args))
    outputs = tuple((Slot("tau", i), choose.randrange(len(body) - 15, len(body))) for i in range(3))
    return check(Program(tuple(body), outputs))


def outputs_of(program: Program) -> np.ndarray:
    """(50, 3) outputs at fixed random inputs."""
    q, qd = np.random.default_rng(7).uniform(-1, 1, (2, 50, 3))
    return interpret(program, {"q": q, "qd": qd}, _SIZES)["tau"]
