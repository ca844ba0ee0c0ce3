"""Products of square matrices at the end of a function. They are not in the function's PROGRAM (list of operations to
generate). C code computes them in loops, or they are written out entry by entry."""

from __future__ import annotations

from dataclasses import dataclass
from math import isqrt
from operator import mul

from psdmc.program.program import Program, Slot
from psdmc.program.replay import Value, replayed
from psdmc.program.trace import Tracer

LARGE = 12
"""Rows from which products with more than LARGE^3 lines are loops, over entries that are always zero too, and states go one
after the other: lines take gcc minutes (18 rows, written out for one state and for lanes: more than one, and 600 MiB). A
hand of four fingers has few lines."""


@dataclass(frozen=True, slots=True)
class Product:
    """A matrix product at the end of a function: output = -(left @ right), with n x n matrices.

    output  name of the function's output that is the product
    left    name of the left factor, an output that the traced arithmetic computes, row by row
    right   name of the right factor, which the traced arithmetic computes column by column; column j of derivatives is
            by joint j
    """

    output: str
    left: str
    right: str


def written_out(program: Program, products: tuple[Product, ...]) -> Program:
    """Return the PROGRAM (list of operations to generate) with every entry of each matrix product computed by
    instructions. The product is stored in place of the product's right factor. Without products, the PROGRAM is
    returned unchanged."""
    if not products:
        return program
    tracer = Tracer()
    values = dict(zip((slot for slot, _ in program.outputs), replayed(program, tracer, {}), strict=True))
    by_right = {product.right: product for product in products}
    outputs: list[tuple[Slot, Value]] = []
    for slot, value in values.items():
        product = by_right.get(slot.vector)
        if product is None:
            outputs.append((slot, value))
        elif slot.index == 0:
            outputs += _multiplied(product, values)
    return tracer.finish(outputs)


def _multiplied(product: Product, values: dict[Slot, Value]) -> list[tuple[Slot, Value]]:
    n = isqrt(sum(slot.vector == product.right for slot in values))
    found: list[tuple[Slot, Value]] = []
    for i in range(n):
        for j in range(n):
            total: Value = 0.0
            for k in range(n):
                total = total + values[Slot(product.left, i * n + k)] * values[Slot(product.right, j * n + k)]
            found.append((Slot(product.output, i * n + j), -total))
    return found


def lines(program: Program, product: Product) -> int:
    """Return the number of multiplications that a matrix product takes if it is written out entry by entry. Entries
    that are zero at every state need none."""
    stored = {slot: program.body[i].value != 0.0 for slot, i in program.outputs}
    n = isqrt(sum(slot.vector == product.right for slot in stored))
    left = [sum(stored[Slot(product.left, i * n + k)] for i in range(n)) for k in range(n)]
    right = [sum(stored[Slot(product.right, j * n + k)] for j in range(n)) for k in range(n)]
    return sum(map(mul, left, right))


def zero_columns(program: Program, product: Product) -> int:
    """Return the number of leading columns of a product's right factor that are zero at every state."""
    stored = {
        slot.index: program.body[i].value for slot, i in program.outputs if slot.vector == product.right
    }
    n = isqrt(len(stored))
    return next((j for j in range(n) if any(stored[j * n + k] != 0.0 for k in range(n))), n)
