"""The Stribeck effect: friction that is larger near rest.

The user gives the Stribeck velocity, so that the law is linear in its fitted values and the fit remains a convex
problem. If you do not know the velocity, give several. The sum of the terms, one for each velocity, approximates any
falling curve.
"""

from psdmc.friction.law import Law, Number, Value, exp

LAW = Law(
    name="stribeck",
    about="The Stribeck effect: larger near rest, for each Stribeck velocity v_s that you give.",
    formula=lambda speed: f"Stribeck exp(-(v / {speed:g})^2)",
    values=(Value(lambda speed: f"stribeck_{float(speed)!r}"),),
    torque=lambda p, at, speed: p[0] * exp(-((at.v / speed) * (at.v / speed))),
    against=True,
    number=Number("speeds", 1e-4, 100.0, 6, "rad/s (m/s)"),
)
