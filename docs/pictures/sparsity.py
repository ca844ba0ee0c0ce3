"""Where E and P of the KR6 have entries: sparsity.svg, from the derived model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pictures.canvas import Canvas

NAME = "sparsity.svg"
ROBOT = Path(__file__).parents[2] / "examples/robots/kr6.toml"

LEFT, WIDE = 62, 324
LEVELS = (0.0, 0.2, 0.5)
"""A stroke is darker where more than these shares of its monomials have an entry."""


def draw() -> str:
    import psdmc

    model = psdmc.derive(str(ROBOT))
    assert model.E is not None
    assert model.P is not None
    n, p, l = model.n, model.E.shape[1], model.P[0].shape[1]
    joints = [np.asarray(each.toarray()).T != 0 for each in model.P]
    share = sum(int(each.sum()) for each in joints) / (n * p * l)
    each = -(-p // WIDE)
    canvas = Canvas(
        536,
        f"The exponents E of the KR6's {p} monomials and the matrices P of its {n} joints, {l} base parameters each."
        f" {100 * share:.1f} % of the entries of P differ from zero; joints near the base have the most.",
        "What the KR6's E and P hold",
    )
    canvas.text(14, 50, f"left to right: the {p} monomials, {each} per stroke", "small soft")
    canvas.text(14, 74, "E: the factors of each monomial", "bold")
    y = 82.0
    for name, rows in zip(("q", "sin q", "cos q", "qd", "qdd"), np.split(model.E > 0, 5), strict=True):
        _pattern(canvas, rows, y, 3.0, "fla", each)
        canvas.text(LEFT - 8, y + 14, name, "small", "end")
        y += 3.0 * n + 2
    canvas.text(14, y + 24, "P: which base parameter it multiplies", "bold")
    y += 32
    for joint, rows in enumerate(joints):
        _pattern(canvas, rows, y, 1.2, "flb", each)
        canvas.text(LEFT - 8, y + 26, f"joint {joint + 1}", "small", "end")
        y += 1.2 * l + 4
    canvas.text(14, 520, f"P: {l} rows per joint, {100 * share:.1f} % of the entries not zero.", "small soft")
    return canvas.svg


def _pattern(canvas: Canvas, rows: Any, top: float, high: float, style: str, each: int) -> None:
    """Strokes where rows have entries, darker for more of them."""
    count = -(-rows.shape[1] // each)
    padded = np.zeros((rows.shape[0], count * each))
    padded[:, : rows.shape[1]] = rows
    filled = padded.reshape(rows.shape[0], count, each).mean(axis=2)
    canvas.box(LEFT, top, WIDE, rows.shape[0] * high, "box", 0)
    strokes = []
    for level in LEVELS:
        data = []
        for row, line in enumerate(filled > level):
            edges = np.flatnonzero(np.diff(np.concatenate(([0], line.astype(int), [0]))))
            data += [f"M{start} {row}h{end - start}v1H{start}" for start, end in edges.reshape(-1, 2)]
        if data:
            strokes.append(f'<path class="{style}" opacity=".6" d="{"".join(data)}"/>')
    place = f"translate({LEFT} {top:.1f}) scale({WIDE / count:.5f} {high})"
    canvas.parts.append(f'<g transform="{place}">{"".join(strokes)}</g>')
