"""python tests/trig/speed.py: nanoseconds and loop instructions of each kind of sincos on this machine.

Least of many trials; on a machine that does other things too, compare the instructions.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from builds import Build, render_function, run

from psdmc.backends.trig_numbers import Real

CONTRACT = "-O3 -ffp-contract=fast"
CASES: tuple[tuple[Real, Build], ...] = (
    ("double", Build("avx512", "gcc", 64, "libm", f"{CONTRACT} -march=native")),
    ("double", Build("avx512_freestanding", "gcc", 64, "nan", f"{CONTRACT} -march=native")),
    ("double", Build("avx2", "gcc", 32, "libm", f"{CONTRACT} -march=x86-64-v3")),
    ("double", Build("sse2", "gcc", 16, "libm", CONTRACT)),
    ("double", Build("scalar", "gcc", 0, "libm", f"{CONTRACT} -march=native")),
    ("float", Build("avx512", "gcc", 64, "libm", f"{CONTRACT} -march=native")),
    ("float", Build("avx2", "gcc", 32, "libm", f"{CONTRACT} -march=x86-64-v3")),
)


def loop_instructions(listing: str) -> int:
    """Instructions of the first loop of `independent` in GCC's assembly."""
    body = listing.split("\nindependent:")[1].split(".size\tindependent")[0]
    label = next(m for m in re.finditer(r"^(\.L\d+):\n(.*?)\tj\w+\t\1\n", body, re.DOTALL | re.MULTILINE))
    return len(re.findall(r"^\t[a-z]", label.group(2), re.MULTILINE)) + 1


def measure(real: Real, build: Build, folder: Path) -> str:
    """One line of the table."""
    function = render_function(build, real)
    defines = (f"VEC {function.vec}", f"LANES {function.lanes}", f"REAL {real}", f"SINCOS {function.symbol}")
    source = folder / "speed.c"
    source.write_text(
        "#define _POSIX_C_SOURCE 199309L\n"
        + function.source
        + "".join(f"#define {define}\n" for define in defines)
        + Path(__file__).with_name("speed.c").read_text()
    )
    command = (build.compiler, "-std=c99", *build.flags.split(), str(source))
    run(*command, "-S", "-o", str(folder / "speed.s"))
    run(*command, "-lm", "-o", str(folder / "speed"))
    count = loop_instructions((folder / "speed.s").read_text())
    times = run(str(folder / "speed")).strip()
    return f"{real:6} x{function.lanes:<2} {build.name:20} {count:4} instructions, {times}"


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for real, build in CASES:
            print(measure(real, build, Path(folder)))
