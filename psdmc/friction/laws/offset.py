"""A constant torque of a joint, for example from a cable, a spring's rest position or the zero of a sensor."""

import math

from psdmc.friction.law import Law, Value

LAW = Law(
    name="offset",
    about="A constant torque, in either direction.",
    formula="constant",
    values=(Value("offset", low=-math.inf),),
    torque=lambda p, at: p[0],
    word=True,
)
