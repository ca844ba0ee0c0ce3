"""Where the numbers of psdmc/backends/trig_numbers.py come from; run as a script it prints them.

Remez' exchange in 60-digit arithmetic for the two polynomials of a sincos on [-pi/4, pi/4], in z = r^2,

    sin r = r - r^3 P(z)          cos r = 1 - z/2 + z^2 Q(z)

for the smallest greatest relative error of sin r and of cos r. Coefficients are rounded to the format one
after the other, lowest first, the rest fitted again each time: later terms make up for a rounding.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp

mp.mp.dps = 60

DIGITS = {"double": 53, "float": 24}
TERMS = {"double": 6, "float": 3}
REACH = mp.pi / 4 * (1 + mp.mpf(2) ** -10)
"""k = round(2 q / pi) is rounded in working precision, so |r| may pass pi/4 a little."""

SERIES_TERMS = 18
"""Of the Taylor series: the first one left out is below 1e-45."""

Function = Callable[[mp.mpf], mp.mpf]


def round_to(value: mp.mpf, digits: int) -> mp.mpf:
    """The nearest number with so many binary digits."""
    if value == 0:
        return mp.mpf(0)
    exponent = int(mp.floor(mp.log(abs(value), 2))) + 1
    unit = mp.mpf(2) ** (exponent - digits)
    return mp.nint(value / unit) * unit


def sin_rest(z: mp.mpf) -> mp.mpf:
    """P, exactly: (r - sin r) / r^3, by its series (no cancellation near zero)."""
    return mp.fsum((-1) ** i * z**i / mp.factorial(2 * i + 3) for i in range(SERIES_TERMS))


def cos_rest(z: mp.mpf) -> mp.mpf:
    """Q, exactly: (cos r - 1 + z / 2) / z^2, by its series."""
    return mp.fsum((-1) ** i * z**i / mp.factorial(2 * i + 4) for i in range(SERIES_TERMS))


def sin_weight(z: mp.mpf) -> mp.mpf:
    """What an error of P is worth in units of sin r."""
    r = mp.sqrt(z)
    return r**3 / mp.sin(r)


def cos_weight(z: mp.mpf) -> mp.mpf:
    """What an error of Q is worth in units of cos r."""
    return z**2 / mp.cos(mp.sqrt(z))


def horner(coefficients: list[mp.mpf], z: mp.mpf) -> mp.mpf:
    """The polynomial with these coefficients, constant first."""
    value = mp.mpf(0)
    for coefficient in reversed(coefficients):
        value = value * z + coefficient
    return value


def remez(target: Function, weight: Function, fixed: list[mp.mpf], free: int) -> list[mp.mpf]:
    """Best weighted approximation of target on (0, REACH^2]: fixed terms, then so many free ones."""
    reach = REACH**2
    first = len(fixed)
    points = [reach * (1 + mp.cos(mp.pi * (i + mp.mpf("0.5")) / (free + 1))) / 2 for i in range(free + 1)][
        ::-1
    ]
    grid = [reach * (1 - mp.cos(mp.pi * i / 200)) / 2 for i in range(1, 201)]
    solution: list[mp.mpf] = []
    for _ in range(6):
        rows = mp.matrix(free + 1, free + 1)
        right = mp.matrix(free + 1, 1)
        for i, z in enumerate(points):
            for j in range(free):
                rows[i, j] = z ** (first + j)
            rows[i, free] = (-1) ** i / weight(z)
            right[i] = target(z) - horner(fixed, z)
        solution = list(mp.lu_solve(rows, right))[:free]
        error = [(horner(fixed + solution, z) - target(z)) * weight(z) for z in grid]
        points = alternating_extrema(grid, error, free + 1)
    return fixed + solution


def alternating_extrema(grid: list[mp.mpf], error: list[mp.mpf], wanted: int) -> list[mp.mpf]:
    """The largest error of each run of one sign; the last `wanted` runs."""
    best: list[int] = []
    for i, value in enumerate(error):
        if best and mp.sign(error[best[-1]]) == mp.sign(value):
            if abs(value) > abs(error[best[-1]]):
                best[-1] = i
        else:
            best.append(i)
    if len(best) < wanted:
        raise ArithmeticError(f"the error changes sign {len(best) - 1} times, expected {wanted - 1}")
    return [grid[i] for i in best[-wanted:]]


def rounded_fit(target: Function, weight: Function, terms: int, digits: int) -> list[mp.mpf]:
    """Coefficients in the format, constant first."""
    fixed: list[mp.mpf] = []
    for free in range(terms, 0, -1):
        fixed.append(round_to(remez(target, weight, fixed, free)[len(fixed)], digits))
    return fixed


def greatest_error(coefficients: list[mp.mpf], target: Function, weight: Function) -> float:
    """max |relative error| over (0, REACH], on a fine grid."""
    grid = [REACH**2 * i / 500 for i in range(1, 501)]
    return float(max(abs((horner(coefficients, z) - target(z)) * weight(z)) for z in grid))


def half_pi_parts(exact: int, digits: int, index_digits: int) -> list[mp.mpf]:
    """pi/2 as a sum of `exact` parts whose products with any index k are exact, and a rounded rest.

    Cut off, not rounded: a negative part times k = 0 is -0, and would turn an angle of -0 into +0.
    """
    rest = mp.pi / 2
    parts: list[mp.mpf] = []
    for _ in range(exact):
        unit = mp.mpf(2) ** (int(mp.floor(mp.log(rest, 2))) + 1 - (digits - index_digits))
        parts.append(mp.floor(rest / unit) * unit)
        rest -= parts[-1]
    return [*parts, round_to(rest, digits)]


if __name__ == "__main__":
    for real, digits in DIGITS.items():
        for name, target, weight in (("sin", sin_rest, sin_weight), ("cos", cos_rest, cos_weight)):
            fit = rounded_fit(target, weight, TERMS[real], digits)
            bits = mp.log(greatest_error(fit, target, weight), 2)
            print(real, name, [float(c).hex() for c in fit], f"error 2^{float(bits):.1f}")
    print([float(c).hex() for c in half_pi_parts(2, 53, 16)])
    print([float(c).hex() for c in half_pi_parts(3, 24, 10)])
