"""The Stribeck effect: Coulomb friction is larger near rest.

Linear in the values, so that they belong to the one vector and its one prior, the semidefinite program stays convex and rows
stay additive. A speed that is not known is found by giving several: their sum follows any curve that falls from rest on.
"""

from psdmc.friction.law import Law, Number, Value
from psdmc.friction.scalars import exp

LAW = Law(
    name="stribeck",
    about="The Stribeck effect: larger near rest, for each Stribeck velocity v_s that you give.",
    formula=lambda speed: f"Stribeck exp(-(v / {speed:g})^2)",
    values=(Value(lambda speed: f"stribeck_{float(speed)!r}"),),
    torque=lambda p, at, speed: p[0] * exp(-((at.v / speed) * (at.v / speed))),
    against=True,
    number=Number("speeds", 1e-4, 100.0, 6, "rad/s (m/s)"),
)
