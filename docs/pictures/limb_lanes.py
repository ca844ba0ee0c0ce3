"""A quadruped's four legs computed at once, a leg per SIMD lane: limb_lanes.svg."""

from __future__ import annotations

from pictures.canvas import Canvas

NAME = "limb_lanes.svg"

LEGS = (("left", "front"), ("right", "front"), ("left", "hind"), ("right", "hind"))
STYLES = ("a", "b", "c", "")


def draw() -> str:
    canvas = Canvas(
        404,
        "A quadruped's legs have the same joints. Each leg takes one lane of a SIMD vector; one instruction computes the"
        " same value of all four legs. The trunk is computed once, from the sum over the lanes.",
        "Four legs, one instruction",
    )
    canvas.box(60, 44, 320, 36, "box")
    canvas.text(220, 67, "trunk: computed once", "", "middle")
    for leg, (names, style) in enumerate(zip(LEGS, STYLES, strict=True)):
        x = 100 + leg * 80
        line = f"l{style}" if style else "line"
        canvas.line([(x, 80), (x + 12, 108), (x - 6, 136)], line)
        for place in ((x, 84), (x + 12, 108)):
            canvas.circle(*place, 5, f"{style}box")
        canvas.circle(x - 6, 136, 3, f"f{line}")
        canvas.text(x, 156, names[0], "small", "middle")
        canvas.text(x, 172, names[1], "small", "middle")
        canvas.arrow([(x, 180), (x, 208)])
    for row, says in enumerate(("hip", "thigh", "knee")):
        y = 214 + row * 34
        canvas.text(52, y + 19, says, "small soft", "end")
        for leg, style in enumerate(STYLES):
            canvas.box(61 + leg * 80, y, 78, 28, f"{style}box", 3)
            canvas.text(
                100 + leg * 80, y + 19, f"lane {leg}", f"small t{style}" if style else "small", "middle"
            )
    canvas.line([(60, 320), (60, 326), (380, 326), (380, 320)])
    canvas.arrow([(220, 326), (220, 348)])
    canvas.text(220, 364, "the sum over the lanes acts on the trunk", "small", "middle")
    canvas.text(14, 390, "A row is one SIMD vector of four doubles (AVX2).", "small soft")
    return canvas.svg
