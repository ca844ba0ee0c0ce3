"""How two layouts of a batch put numbers into memory: batch_layout.svg."""

from __future__ import annotations

from pictures.canvas import Canvas

NAME = "batch_layout.svg"

HIGH = 26
STATES = ("a", "b", "c")
"""Classes of the first states' boxes and text; the others are plain."""


def draw() -> str:
    canvas = Canvas(
        432,
        "Rows hold one state after the other: q0 q1 q2 of state 0, then of state 1. Lanes hold q0 of eight states, then"
        " q1 of the same eight states. Each box names its state.",
        "Two layouts of a batch, here three joints",
    )
    canvas.text(14, 52, "Rows: one state after the other", "bold")
    canvas.text(14, 71, "R_inverse_dynamics_batch", "code")
    _rows(canvas, 82)
    canvas.text(14, 198, "memory order: along the rows", "small soft")
    canvas.text(14, 236, "Lanes: one variable of 8 states together", "bold")
    canvas.text(14, 255, "R_inverse_dynamics_batch_soa", "code")
    _lanes(canvas, 266)
    canvas.text(14, 372, "memory order: along the rows; block after block", "small soft")
    canvas.text(14, 398, "q1 of 3: the second joint of state 3.", "small")
    canvas.text(14, 416, "A block has 8 lanes of double, or 16 of float.", "small")
    return canvas.svg


def _rows(canvas: Canvas, top: float) -> None:
    for state in range(3):
        for joint in range(3):
            _cell(canvas, 92 + joint * 66, top + state * (HIGH + 3), 66, joint, state)
        canvas.text(82, top + state * (HIGH + 3) + 18, f"state {state}", "small soft", "end")
    canvas.text(306, top + 18, "a row: q of", "small soft")
    canvas.text(306, top + 35, "one state", "small soft")
    canvas.text(92, top + 3 * (HIGH + 3) + 12, "...", "small soft")


def _lanes(canvas: Canvas, top: float) -> None:
    for joint in range(3):
        for lane in range(8):
            _cell(canvas, 60 + lane * 41, top + joint * (HIGH + 3), 41, joint, lane, short=True)
        canvas.text(50, top + joint * (HIGH + 3) + 18, f"q{joint} of", "small soft", "end")


def _cell(
    canvas: Canvas, x: float, y: float, wide: float, joint: int, state: int, short: bool = False
) -> None:
    style = STATES[state] if state < len(STATES) else ""
    canvas.box(x, y, wide - 2, HIGH, f"{style}box", 3)
    says = f"{state}" if short else f"q{joint} of {state}"
    canvas.text(x + wide / 2 - 1, y + 18, says, f"small t{style}" if style else "small", "middle")
