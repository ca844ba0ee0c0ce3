"""Every build of the sincos stays below 1 ulp: against long double, on every float, against mpmath. `make test-accuracy`
takes ten million angles for each build and every float, `make test` a hundred thousand."""

from __future__ import annotations

import math
import os
import platform
import shutil
from collections.abc import Iterable
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from builds import Build, builds, compile_build, load, run

from psdmc.backends.trig_numbers import NUMBERS, Real

WHOLE = os.environ.get("PSDMC_ACCURACY") == "whole"
BLOCKS, LEAST = (160, 10_000_000) if WHOLE else (2, 100_000)
"""Of 16384 angles, per uniform range, and angles of each build with the other ranges."""

EXHAUSTIVE = ("native", "baseline")

pytestmark = pytest.mark.skipif(
    shutil.which("gcc") is None or platform.machine() != "x86_64", reason="needs gcc and x87's long double"
)


def compare(real: Real, chosen: Iterable[Build], how: str, folder: Path) -> dict[str, int]:
    """Angles seen by each build; fails on the first error of 1 ulp or more. Prints each range's greatest."""
    chosen = tuple(chosen)
    objects = [str(compile_build(build, real)) for build in chosen]
    names = " ".join(f"X({build.name})" for build in chosen)
    defines = (f"-DREAL={real}", f"-DDIGITS={NUMBERS[real].digits}", f"-DVARIANTS={names}")
    program = folder / "accuracy"
    source = Path(__file__).with_name("accuracy.c")
    run("gcc", "-std=gnu99", "-O2", *defines, str(source), *objects, "-lm", "-o", str(program))
    angles: dict[str, int] = {}
    for line in run(str(program), str(NUMBERS[real].limit), how).splitlines():
        print(line)
        _range, name, count, of_sin, of_cos, _worst = line.split()
        assert float(of_sin) < 1, line
        assert float(of_cos) < 1, line
        angles[name] = angles.get(name, 0) + int(count)
    return angles


@pytest.mark.parametrize("real", ["double", "float"])
def test_every_build_is_within_one_unit_in_the_last_place(real: Real, tmp_path: Path) -> None:
    angles = compare(real, builds(), str(BLOCKS), tmp_path)

    assert sorted(angles) == sorted(build.name for build in builds())
    assert min(angles.values()) >= LEAST


@pytest.mark.skipif(not WHOLE, reason="make test-accuracy takes it")
def test_every_float_is_within_one_unit_in_the_last_place(tmp_path: Path) -> None:
    chosen = [build for build in builds() if build.name in EXHAUSTIVE]

    angles = compare("float", chosen, "every", tmp_path)

    least, greatest = np.array([0.125, NUMBERS["float"].limit], np.float32).view(np.int32)
    assert min(angles.values()) >= greatest - least
    assert len(angles) == len(EXHAUSTIVE)


def test_the_hardest_multiples_of_half_pi_agree_with_sixty_digits() -> None:
    """Independent of x87: doubles whose remainder modulo pi/2 is smallest, against mpmath."""
    build = next(build for build in builds() if build.name == "baseline")
    sincos = load(compile_build(build, "double"), build.name, "double")
    with mp.workdps(60):
        nearest = np.array([float(k * mp.pi / 2) for k in range(1, 63662)])
        remainder = np.array([abs(float(mp.mpf(x) - k * mp.pi / 2)) for k, x in enumerate(nearest, start=1)])
        hardest = nearest[np.argsort(remainder)[:256]]
        assert remainder.min() < 1e-18
        s, c = sincos(hardest)
        for x, of_sin, of_cos in zip(hardest, s, c, strict=True):
            for got, exact in ((of_sin, mp.sin(mp.mpf(x))), (of_cos, mp.cos(mp.mpf(x)))):
                assert abs(mp.mpf(got) - exact) < math.ulp(float(exact)), x
