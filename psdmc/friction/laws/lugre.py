"""LuGre friction: a model of bristles that bend by z (rad, m) before they slide. Source: Denso-2022, (12) to (14)."""

from collections.abc import Sequence

from psdmc.friction.law import (
    At,
    Law,
    Scalar,
    State,
    Value,
    absolute,
    exp,
    larger,
    power,
    select,
    smaller,
    tanh,
)

VALUES = (
    Value("coulomb", low=1e-9),
    Value("static", low=1e-9, above="coulomb"),
    Value("stribeck_velocity", "rad/s", low=1e-5, high=1e2, start=1.0, logarithmic=True),
    Value("viscous", "Nms/rad"),
    Value("viscous_exponent", "-", low=0.05, high=3.0, start=1.0),
    Value("stiffness", "Nm/rad", low=1.0, high=1e9, start=1e5, logarithmic=True),
    Value("damping", "Nms/rad"),
)


def bent(p: Sequence[Scalar], v: Scalar) -> Scalar:
    """Return g(v), the deflection of the bristles in steady sliding at speed v. Source: Denso-2022, (13)."""
    ratio = v / p[2]
    return (p[0] + (p[1] - p[0]) * exp(-(ratio * ratio))) / p[5]


def rate(p: Sequence[Scalar], v: Scalar, z: Scalar) -> Scalar:
    """Return dz/dt, the rate of change of the deflection z of the bristles. Source: Denso-2022, (12)."""
    return v - absolute(v) * z / bent(p, v)


def step(p: Sequence[Scalar], v0: Scalar, v1: Scalar, z: Scalar, dt: Scalar) -> Scalar:
    """Return the deflection of the bristles after a time dt in which the speed changes linearly from v0 to v1 (same
    sign).

    The differential equation (12) of Denso-2022 is dz/dt = lambda (target - z). Here lambda is |v| / g(v), target is
    sign(v) g(v), and g(v) is the deflection in steady sliding. The step solves the equation exactly for a target that
    changes linearly with time. For lambda it takes the mean over the step by Simpson's rule. The solution is stable for
    any dt. In steady sliding, the lag of z behind the target is exact to first order.
    """
    middle = 0.5 * (v0 + v1)
    g0, g1 = bent(p, v0), bent(p, v1)
    mean = (absolute(v0) / g0 + 4.0 * absolute(middle) / bent(p, middle) + absolute(v1) / g1) / 6.0
    x = mean * dt
    decay = exp(-x)
    # (1 - exp(-x)) / x: with h = tanh(x / 2), 1 - exp(-x) is 2 h / (1 + h) without cancellation.
    h = tanh(0.5 * x)
    share = select(x, 1e-5, 1.0 - 0.5 * x, 2.0 * h / ((1.0 + h) * larger(x, 1e-5)))
    moved = g1 - g0 * decay - (g1 - g0) * share
    return select(middle, 0.0, -moved, moved) + z * decay


def pieces(p: Sequence[Scalar], v0: Scalar, v1: Scalar) -> Scalar:
    """Return the number of additional steps in which the speed changes from v0 to v1; 0 means a single step.

    In each step the speed changes by at most a quarter of the Stribeck velocity, in up to 64 steps. If both speeds
    exceed four times the Stribeck velocity, one step is enough.
    """
    slowest = smaller(absolute(v0), absolute(v1))
    return select(4.0 * p[2], slowest, 0.0, smaller(4.0 * absolute(v1 - v0) / p[2], 63.0))


def torque(p: Sequence[Scalar], at: At) -> Scalar:
    """Return the friction torque, N m (N for a sliding joint), from the fitted values p, the speed and the deflection
    of the bristles. Source: Denso-2022, (14)."""
    viscous = p[3] * power(absolute(at.v), p[4])
    return p[5] * at.z + p[6] * rate(p, at.v, at.z) + select(at.v, 0.0, -viscous, viscous)


def line(p: Sequence[float], number: float, top: float) -> tuple[float, float, str]:
    """Return a constant torque and a damping that approximate LuGre friction, and in words what they leave out.

    The constant is the Coulomb torque. The damping is the slope of the line nearest to the viscous torque, for speeds
    from 0 to `top`.
    """
    slope = 3.0 / (p[4] + 2.0) * top ** (p[4] - 1.0)
    return (
        p[0],
        p[3] * slope,
        "the Stribeck effect and bristles of LuGre friction, and the curve of its viscous law",
    )


LAW = Law(
    name="lugre",
    about="LuGre friction: bristles that bend before they slide, from friction runs of single joints.",
    formula="stiffness z + damping dz/dt + viscous |v|^viscous_exponent sign(v), dz/dt = v - |v| z / g(v)",
    values=VALUES,
    torque=torque,
    key=False,
    line=line,
    state=State(rate, step, pieces),
)
