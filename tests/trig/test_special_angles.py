"""Zeros, denormals, infinities, NaN and angles beyond the limit, in every build."""

from __future__ import annotations

import platform
import shutil

import numpy as np
import pytest
from builds import Build, builds, compile_build, load, run

from psdmc.backends.trig_numbers import NUMBERS, Real

pytestmark = pytest.mark.skipif(
    shutil.which("gcc") is None or platform.machine() != "x86_64", reason="needs gcc on x86-64"
)

each_build = pytest.mark.parametrize("build", builds(), ids=lambda build: build.name)
each_real = pytest.mark.parametrize("real", ["double", "float"])


def among_others(angle: float) -> np.ndarray:
    """Sixteen angles, one of them this one: its neighbours must not notice."""
    angles = np.linspace(-3.0, 4.0, 16)
    angles[5] = angle
    return angles


@each_build
@each_real
@pytest.mark.parametrize("angle", [np.nan, np.inf, -np.inf])
def test_no_angle_gives_no_sine(build: Build, real: Real, angle: float) -> None:
    sincos = load(compile_build(build, real), build.name, real)

    s, c = sincos(among_others(angle))

    assert np.flatnonzero(np.isnan(s)).tolist() == [5]
    assert np.flatnonzero(np.isnan(c)).tolist() == [5]


@each_build
@each_real
def test_the_limit_still_counts_and_beyond_it_libm_or_nan_takes_over(build: Build, real: Real) -> None:
    sincos = load(compile_build(build, real), build.name, real)
    limit = NUMBERS[real].limit
    dtype = np.float64 if real == "double" else np.float32
    inside = np.array([limit, -limit, np.nextafter(dtype(limit), dtype(0))] + [1.0] * 13, dtype=dtype)
    outside = np.array([np.nextafter(dtype(limit), dtype(np.inf)), -2e9, 1e22, 3e38] * 4, dtype=dtype)
    close = 2 * np.finfo(dtype).eps

    for angles in (inside, outside):
        s, c = sincos(angles)
        if angles is outside and build.far == "nan":
            assert np.isnan(s).all()
            assert np.isnan(c).all()
        else:
            np.testing.assert_allclose(s, np.sin(angles.astype(np.float64)), rtol=close)
            np.testing.assert_allclose(c, np.cos(angles.astype(np.float64)), rtol=close)


@each_build
@each_real
def test_small_angles_keep_their_value_and_zero_its_sign(build: Build, real: Real) -> None:
    sincos = load(compile_build(build, real), build.name, real)
    dtype = np.float64 if real == "double" else np.float32
    tiny = np.finfo(dtype).tiny
    denormal = [] if build.fast_math else [tiny / 4, -np.finfo(dtype).smallest_subnormal]
    angles = np.array(([0.0, -0.0, tiny, -tiny, 1e-20, *denormal] * 4)[:16], dtype=dtype)

    s, c = sincos(angles)

    assert s.tolist() == angles.tolist()
    assert c.tolist() == [1.0] * 16
    if not build.fast_math:
        assert np.signbit(s).tolist() == np.signbit(angles).tolist()


@pytest.mark.parametrize("build", [b for b in builds() if b.far == "nan"], ids=lambda build: build.name)
@each_real
def test_the_freestanding_form_calls_nothing(build: Build, real: Real) -> None:
    undefined = run("nm", "-u", str(compile_build(build, real))).split()

    assert [name for name in undefined if name not in ("U", "memcpy", "_GLOBAL_OFFSET_TABLE_")] == []
