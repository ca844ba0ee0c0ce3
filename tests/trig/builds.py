"""Builds of the rendered sincos for the tests: each compiler, target and floating-point mode promised."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from numpy.typing import NDArray

from psdmc.backends.c.trig import Far, scalar_trig, trig_preamble, vector_trig
from psdmc.backends.trig_numbers import Real
from psdmc.target.target import WIDEST_FIRST
from psdmc.toolchain.cache import cache_key, cached

TEMPLATES = Path(__file__).parents[2] / "templates"
STRICT = ("-std=c99", *(f"-W{kind}" for kind in ("all", "extra", "pedantic", "conversion", "shadow")))
STRICT += ("-Wdouble-promotion", "-Werror")
LIBRARY = "sincos.so"
FAST_CONTRACT = "-ffp-contract=fast"


@dataclass(frozen=True, slots=True)
class Build:
    """One instantiation and how it is compiled; vector_bytes 0 is the scalar form."""

    name: str
    compiler: str
    vector_bytes: int
    far: Far
    flags: str

    @property
    def fast_math(self) -> bool:
        """Signed zeros and denormals are not promised then."""
        return "fast-math" in self.flags or "associative" in self.flags


_ALL = (
    Build("native", "gcc", 64, "libm", f"-O3 -march=native {FAST_CONTRACT}"),
    Build("native_separate", "gcc", 64, "nan", "-O3 -march=native -ffp-contract=off"),
    Build("native_fast_math", "gcc", 64, "nan", "-O3 -march=native -ffast-math"),
    Build("native_32", "gcc", 32, "libm", f"-O2 -march=native {FAST_CONTRACT}"),
    Build("v3", "gcc", 32, "libm", f"-O3 -march=x86-64-v3 {FAST_CONTRACT}"),
    Build("v3_separate", "gcc", 32, "nan", "-O3 -march=x86-64-v3 -ffp-contract=off"),
    Build("v3_fast_math", "gcc", 32, "libm", "-O3 -march=x86-64-v3 -ffast-math"),
    Build("v3_wide_fast_math", "gcc", 64, "libm", "-O3 -march=x86-64-v3 -ffast-math"),
    Build(
        "wide_associative", "gcc", 32, "nan", "-O3 -fassociative-math -fno-signed-zeros -fno-trapping-math"
    ),
    Build("baseline", "gcc", 16, "libm", "-O3"),
    Build("baseline_unoptimised", "gcc", 16, "nan", "-O0"),
    Build("scalar", "gcc", 0, "libm", "-O2"),
    Build("scalar_nan", "gcc", 0, "nan", f"-O3 -march=native {FAST_CONTRACT}"),
    Build("scalar_fast_math", "gcc", 0, "nan", "-O3 -march=native -ffast-math"),
    Build("scalar_plain_c", "gcc", 0, "nan", "-O3 -U__GNUC__"),
    Build("scalar_plain_c_fast_math", "gcc", 0, "nan", "-O3 -march=native -ffast-math -U__GNUC__"),
    Build("clang_native", "clang", 64, "libm", f"-O3 -march=native {FAST_CONTRACT}"),
    Build("clang_fast_math", "clang", 64, "nan", "-O3 -march=native -ffast-math"),
    Build("clang_baseline", "clang", 16, "nan", "-O2"),
)


def builds() -> tuple[Build, ...]:
    """Those whose compiler is on this machine."""
    return tuple(build for build in _ALL if shutil.which(build.compiler))


@dataclass(frozen=True, slots=True)
class Function:
    """C source that defines `symbol`, on pointers to `vec`, which holds `lanes` numbers."""

    source: str
    symbol: str
    vec: str
    lanes: int


def render_function(build: Build, real: Real) -> Function:
    """The sincos alone, as a generated package includes it."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )

    def fill(template: str, view: object) -> str:
        return environment.get_template(f"trig/{template}.jinja").render(trig=view) + "\n"

    preamble = fill("preamble", trig_preamble("arm", real, build.far))
    if build.vector_bytes == 0:
        scalar = scalar_trig("arm", real, build.far)
        return Function(preamble + fill("sincos_scalar", scalar), scalar.symbol, scalar.vec, 1)
    unit = next(unit for unit in WIDEST_FIRST if unit.bytes == build.vector_bytes)
    vector = vector_trig("arm", real, unit, build.far)
    source = preamble + fill("types", vector) + fill("sincos_vector", vector)
    return Function(source, vector.symbol, vector.vec, vector.lanes)


def render(build: Build, real: Real) -> str:
    """C source of `void <build name>(count, x, s, c)` around the sincos."""
    function = render_function(build, real)
    signature = f"void {build.name}(size_t count, const {real} *x, {real} *s, {real} *c)"
    return (
        f"#include <stddef.h>\n#include <string.h>\n{function.source}"
        f"{signature};\n{signature}\n{{\n    for (size_t i = 0; i < count; i += {function.lanes}) {{\n"
        f"        {function.vec} angle, sine, cosine;\n        memcpy(&angle, x + i, sizeof angle);\n"
        f"        {function.symbol}(&angle, &sine, &cosine);\n        memcpy(s + i, &sine, sizeof sine);\n"
        "        memcpy(c + i, &cosine, sizeof cosine);\n    }\n}\n"
    )


def compile_build(build: Build, real: Real) -> Path:
    """Object file, position independent, without a warning, and beside it a library of it; made once a test run."""
    source, made = render(build, real), f"{build.name}.o"
    words = [build.compiler, *STRICT, "-fPIC", *build.flags.split()]

    def compile_into(folder: Path) -> None:
        text = folder / f"{build.name}.c"
        text.write_text(source)
        run(*words, "-c", str(text), "-o", str(folder / made))
        run("gcc", "-shared", str(folder / made), "-lm", "-o", str(folder / LIBRARY))

    return (
        cached(cache_key({f"{build.name}.c": source}, ("trig", *words)), compile_into, [made, LIBRARY]) / made
    )


def run(*command: str) -> str:
    """What the command prints; its complaints in the failure."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"
    return done.stdout


Sincos = Callable[[NDArray[np.floating]], tuple[NDArray[np.floating], NDArray[np.floating]]]


def load(compiled: Path, name: str, real: Real) -> Sincos:
    """The compiled function on NumPy arrays whose length is a multiple of 16."""
    function = getattr(ctypes.CDLL(str(compiled.with_name(LIBRARY))), name)
    dtype = np.float64 if real == "double" else np.float32

    def sincos(angles: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        x = np.ascontiguousarray(angles, dtype=dtype)
        assert x.size % 16 == 0
        s, c = np.empty_like(x), np.empty_like(x)
        function(ctypes.c_size_t(x.size), *(array.ctypes.data_as(ctypes.c_void_p) for array in (x, s, c)))
        return s, c

    return sincos
