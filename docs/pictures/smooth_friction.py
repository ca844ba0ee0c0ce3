"""Friction against speed for two smoothing speeds: smooth_friction.svg, from the friction laws themselves."""

from __future__ import annotations

import numpy as np

from pictures.canvas import Canvas
from psdmc.friction.joints import Friction
from psdmc.friction.terms import every_joint_s

NAME = "smooth_friction.svg"
COULOMB, VISCOUS = 3.0, 2.0
"""N m and N m s/rad, of the drawn joint."""
SPEEDS = (0.03, 0.1)
"""rad/s."""
FASTEST, LARGEST = 0.4, 4.0
"""rad/s and N m at the ends of the axes."""
LEFT, RIGHT, TOP, BOTTOM = 44, 384, 84, 288


def _place(v: float, tau: float) -> tuple[float, float]:
    """A point of the plot."""
    x = LEFT + (v + FASTEST) / (2.0 * FASTEST) * (RIGHT - LEFT)
    return x, TOP + (LARGEST - tau) / (2.0 * LARGEST) * (BOTTOM - TOP)


def draw() -> str:
    title = "Friction torque against speed"
    says = (
        f"{title}, for Coulomb friction of {COULOMB:g} N m, viscous friction of {VISCOUS:g} N m s/rad and smoothing speeds "
        f"of {SPEEDS[0]:g} and {SPEEDS[1]:g} rad/s. The curve of the smaller speed is steeper at rest."
    )
    canvas = Canvas(334, says, title)
    for k, (speed, style) in enumerate(zip(SPEEDS, "ab", strict=True)):
        canvas.line([(14 + 190 * k, 54), (40 + 190 * k, 54)], f"l{style}{' dash' if k else ''}")
        canvas.text(46 + 190 * k, 58, f"V = {speed:g} rad/s", f"small t{style}")
    for v in (-FASTEST, -0.2, 0.2, FASTEST):
        canvas.line([_place(v, -0.1), _place(v, 0.1)])
        anchor = "start" if v == -FASTEST else "end" if v == FASTEST else "middle"
        canvas.text(_place(v, 0.0)[0], _place(v, 0.0)[1] + 20, f"{v:g}", "small soft", anchor)
    for tau in (-COULOMB, COULOMB):
        canvas.line([_place(-0.008, tau), _place(0.008, tau)])
        x, y = _place(0.012 if tau < 0.0 else -0.012, tau)
        canvas.text(x, y + 4, f"{tau:g} N m", "small soft", "start" if tau < 0.0 else "end")
    canvas.line([_place(-FASTEST, 0.0), _place(FASTEST, 0.0)])
    canvas.line([_place(0.0, -LARGEST), _place(0.0, LARGEST)])
    speeds = np.linspace(-FASTEST, FASTEST, 161)
    for k, (speed, style) in enumerate(zip(SPEEDS, "ab", strict=True)):
        law = Friction(every_joint_s((1.0,), offset=False), np.array([[COULOMB, VISCOUS]]), speed)
        torques = law.torque(speeds[:, None])[:, 0].round(6).tolist()
        canvas.line(
            [_place(*each) for each in zip(speeds.tolist(), torques, strict=True)],
            f"l{style}{' dash' if k else ''}",
        )
    canvas.text(14, 316, "speed v of the joint, rad/s; friction torque, N m", "small soft")
    return canvas.svg
