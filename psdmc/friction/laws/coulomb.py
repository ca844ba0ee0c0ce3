"""Coulomb friction: a torque of constant magnitude that acts against the motion."""

from psdmc.friction.law import Law, Value

LAW = Law(
    name="coulomb",
    about="Coulomb friction: constant, against the motion.",
    formula="Coulomb",
    values=(Value("coulomb"),),
    torque=lambda p, at: p[0],
    against=True,
    word=True,
    key=False,
    line=lambda p, number, top: (p[0], 0.0, ""),
)
