"""A link's frame and its numbers, as a URDF and as a DH table give them: link_frames.svg."""

from __future__ import annotations

from pictures.canvas import Canvas

NAME = "link_frames.svg"


def draw() -> str:
    canvas = Canvas(
        560,
        "Where a link's frame is. URDF: on the joint's axis, at the joint. Standard DH table: at the link's far end, on"
        " the next joint's axis. Mass, centre of mass and inertia are given in the link's frame.",
        "Where a link's frame is, and its numbers",
    )
    _urdf(canvas, 40)
    canvas.line([(14, 292), (386, 292)], "line dash")
    _dh(canvas, 300)
    return canvas.svg


def _urdf(canvas: Canvas, top: float) -> None:
    canvas.text(14, top + 22, "URDF", "bold")
    canvas.text(66, top + 22, "the frame is on the joint's axis", "small soft")
    joint, tip = (92, top + 172), (316, top + 138)
    _link(canvas, joint, tip)
    canvas.line([(joint[0], top + 214), (joint[0], top + 56)], "line dash")
    canvas.arc(joint[0], top + 82, 16, -2.2, 1.9)
    canvas.text(116, top + 83, "q, qd, qdd, tau", "code")
    canvas.text(116, top + 99, "about the joint's <axis>", "small soft")
    _frame(canvas, joint, (joint[0], top + 112), (joint[0] + 56, top + 144), ("z", -16, 8), ("x", 7, -1))
    _frame(canvas, tip, (tip[0] + 14, tip[1] - 52), (tip[0] + 52, tip[1] + 14), ("z", 8, 6), ("x", -4, 18))
    canvas.text(386, top + 76, "next joint's <origin>", "small soft", "end")
    _mass(canvas, joint, (212, top + 164))
    canvas.text(14, top + 226, "c: centre of mass, from <inertial> <origin>", "small tb")
    canvas.text(14, top + 243, "m: <mass>. Inertia about c: <inertia>", "small tb")


def _dh(canvas: Canvas, top: float) -> None:
    canvas.text(14, top + 22, "DH table", "bold")
    canvas.text(92, top + 22, "the frame is at the far end (standard DH)", "small soft")
    joint, foot, tip = (92, top + 206), (92, top + 138), (300, top + 138)
    _link(canvas, foot, tip)
    canvas.line([(92, top + 218), (92, top + 36)], "line dash")
    canvas.line([(282, top + 178), (344, top + 40)], "line dash")
    canvas.arrow([joint, foot], "la")
    canvas.text(82, top + 178, "d", "code ta", "end")
    canvas.arrow([foot, (tip[0] - 2, tip[1])], "la")
    canvas.text(196, top + 133, "a", "code ta", "middle")
    canvas.arc(92, top + 62, 16, -2.2, 1.9)
    canvas.text(116, top + 63, "theta + q", "code ta")
    canvas.text(116, top + 79, "joint's axis", "small soft")
    canvas.arc(300, top + 138, 58, -1.571, -1.18, "la")
    canvas.line([(300, top + 138), (300, top + 76)], "line dash")
    canvas.text(294, top + 94, "alpha", "code ta", "end")
    canvas.text(354, top + 56, "next", "small soft")
    canvas.text(354, top + 72, "axis", "small soft")
    _frame(canvas, tip, (tip[0] + 24, tip[1] - 54), (tip[0] + 64, tip[1]), ("z", 8, 8), ("x", -4, 20))
    _mass(canvas, tip, (172, top + 150))
    canvas.text(14, top + 234, "c: centre of mass, from com", "small tb")
    canvas.text(14, top + 251, "m: mass. Inertia about c: inertia_com", "small tb")


def _link(canvas: Canvas, start: tuple[float, float], end: tuple[float, float]) -> None:
    """The body: a bar with round ends."""
    (x, y), (u, v) = start, end
    canvas.path(
        f"M{x} {y - 20}L{u} {v - 15}A15 15 0 0 1 {u} {v + 15}L{x} {y + 20}A20 20 0 0 1 {x} {y - 20}Z", "link"
    )


def _frame(
    canvas: Canvas,
    origin: tuple[float, float],
    z: tuple[float, float],
    x: tuple[float, float],
    *names: tuple[str, float, float],
) -> None:
    for end, (name, right, down) in zip((z, x), names, strict=True):
        canvas.arrow([origin, end], "lc")
        canvas.text(end[0] + right, end[1] + down, name, "tc bold it")
    canvas.circle(*origin, 4, "flc")


def _mass(canvas: Canvas, origin: tuple[float, float], centre: tuple[float, float]) -> None:
    """The centre of mass with the vector to it and gravity."""
    x, y = centre
    canvas.line([origin, centre], "lb dash")
    canvas.circle(x, y, 6, "bbox")
    canvas.circle(x, y, 2, "flb")
    canvas.arrow([(x, y + 8), (x, y + 44)], "lb")
    canvas.text(x + 10, y + 42, "m g", "code tb")
    canvas.text(x + (11 if x > origin[0] else -18), y + 5, "c", "code tb")
