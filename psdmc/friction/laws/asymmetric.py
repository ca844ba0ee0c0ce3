"""Coulomb friction that differs between the directions: coulomb + asymmetry forward, coulomb - asymmetry backward.

Its column in a fit is the magnitude of the smooth sign. This column differs from that of a constant offset only near
rest, so a fit with both determines little more than their sum.
"""

import math

from psdmc.friction.law import Law, Value
from psdmc.friction.scalars import absolute

LAW = Law(
    name="asymmetric",
    about="Coulomb friction that differs between the directions: coulomb + value forward, coulomb - value backward; neither "
    "is negative.",
    formula="|s| asymmetry",
    values=(Value("coulomb_asymmetry", low=-math.inf, within="coulomb"),),
    torque=lambda p, at: p[0] * absolute(at.sign),
    instead="offset",
)
