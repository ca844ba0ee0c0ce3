"""Coulomb friction that differs between the directions: coulomb + asymmetry forward, coulomb - asymmetry backward.

In a linear fit, the torque per unit of `asymmetry` is the magnitude of the smooth sign. It differs from a constant
torque only near rest. A fit of an asymmetry and a constant torque therefore determines little more than their sum.
"""

import math

from psdmc.friction.law import Law, Value, absolute

LAW = Law(
    name="asymmetric",
    about="Coulomb friction that differs between the directions: coulomb + value forward, coulomb - value backward; neither "
    "is negative.",
    formula="|s| asymmetry",
    values=(Value("coulomb_asymmetry", low=-math.inf, within="coulomb"),),
    torque=lambda p, at: p[0] * absolute(at.sign),
    instead="offset",
)
