"""Viscous friction, which grows with a power of the speed. Terms with several exponents approximate any growing curve."""

from collections.abc import Sequence

from psdmc.friction.law import Law, Number, Value, absolute, power


def line(p: Sequence[float], exponent: float, top: float) -> tuple[float, float, str]:
    """Return the constant torque (zero) and the damping that approximate the viscous friction, and in words what they
    leave out.

    The damping is the fitted value times the slope s for which s v is nearest to v^exponent, by least squares for
    speeds from 0 to `top`.
    """
    slope = 3.0 / (exponent + 2.0) * top ** (exponent - 1.0)
    return (
        0.0,
        p[0] * slope,
        "" if exponent == 1.0 else "a viscous law that is no line (the line nearest to it is)",
    )


LAW = Law(
    name="viscous",
    about="Viscous friction: grows with the speed, or with a power of it.",
    formula=lambda d: "viscous |v|" if d == 1.0 else f"viscous |v|^{d:g}",
    values=(
        Value(
            lambda d: "viscous" if d == 1.0 else f"viscous^{d:g}",
            lambda d: "Nms/rad" if d == 1.0 else f"Nm (s/rad)^{d:g}",
        ),
    ),
    torque=lambda p, at, exponent: p[0] * power(absolute(at.v), exponent),
    against=True,
    number=Number("exponents", 0.0, 8.0, 4, usual=1.0),
    word=True,
    key=False,
    line=line,
)
