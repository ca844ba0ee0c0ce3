"""The sincos, compiled every promised way, against long double on ten million angles and mpmath on the hardest."""

from __future__ import annotations

import platform
import shutil
from pathlib import Path

import pytest
from builds import builds, compile_build, run

from psdmc.emit.trig import NUMBERS, Real

BLOCKS = {"double": 160, "float": 160}
"""Of 16384 angles, per uniform range: above ten million angles with the other ranges."""

pytestmark = pytest.mark.skipif(
    shutil.which("gcc") is None or platform.machine() != "x86_64", reason="needs gcc and x87's long double"
)


@pytest.mark.parametrize("real", ["double", "float"])
def test_every_build_is_within_one_unit_in_the_last_place(real: Real, tmp_path: Path) -> None:
    names = " ".join(f"X({build.name})" for build in builds())
    objects = [str(compile_build(build, real, tmp_path)) for build in builds()]
    program = tmp_path / "accuracy"
    defines = (f"-DREAL={real}", f"-DDIGITS={NUMBERS[real].digits}", f"-DVARIANTS={names}")
    source = Path(__file__).with_name("accuracy.c")
    run("gcc", "-std=gnu99", "-O2", *defines, str(source), *objects, "-lm", "-o", str(program))

    lines = run(str(program), str(NUMBERS[real].limit), str(BLOCKS[real])).splitlines()
    print("\n".join(lines))

    angles: dict[str, int] = {}
    for line in lines:
        span, name, count, of_sin, of_cos, _worst = line.split()
        assert float(of_sin) < 1 and float(of_cos) < 1, line
        angles[name] = angles.get(name, 0) + int(count)
        assert span
    assert sorted(angles) == sorted(build.name for build in builds())
    assert min(angles.values()) >= 10_000_000
