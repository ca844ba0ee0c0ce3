"""Load-dependent friction: it grows with the torque that the joint transmits, like the friction of gears."""

from psdmc.friction.law import Law, Value, absolute

LAW = Law(
    name="load",
    about="Friction that grows with the torque of the rigid bodies.",
    formula="load |torque of the rigid bodies|",
    values=(Value("load_friction", "1"),),
    torque=lambda p, at: p[0] * absolute(at.load),
    against=True,
)
