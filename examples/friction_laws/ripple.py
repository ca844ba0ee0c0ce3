"""Torque ripple of a gear: five waves per turn of the joint, of unknown size and phase."""

import math

from psdmc.friction import Law, Value, cos, sin

WAVES = 5.0

LAW = Law(
    name="ripple",
    about="Torque ripple of a gear: five waves per turn of the joint.",
    formula="ripple_sin sin(5 q) + ripple_cos cos(5 q)",
    values=(Value("ripple_sin", "Nm", low=-math.inf), Value("ripple_cos", "Nm", low=-math.inf)),
    torque=lambda p, at: p[0] * sin(WAVES * at.q) + p[1] * cos(WAVES * at.q),
)
