"""What design.md promises of the C text: no warnings, no foreign symbols, no state, C++ headers, packages side by side."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from bundled import bundled_model
from c_warnings import EXTRA, STRICT
from direct import write_sources
from installed import need
from slow_cases import slow_but_for
from traced import arm_package

from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.functions import OF_TREES
from psdmc.lower.admitted import wanted
from psdmc.lower.kernels import lower
from psdmc.program.kernel import Kernel
from psdmc.toolchain.compile import lowered_once

COMPILERS = ["gcc", "clang"]
NAMES = ["inverse_dynamics", "forward_dynamics", "mass_matrix", "jacobian"]
"""One of each kind: torques with parameters, pivots, a matrix with and one without parameters."""


def _checked(compiler: str, optimised: bool) -> list[str]:
    """Flags under which a compiler warns: clang says all by reading; gcc says what follows from values where it
    optimises."""
    if compiler == "clang":
        return ["-fsyntax-only"]
    return ["-O1" if optimised else "-O0"]


OPTIMISED = [(("float64", "inline"), "-march=native"), (("float32", "inline"), "-march=native")]
"""Options and flag of the packages whose warnings gcc looks for while it optimises."""


def _compile(words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    assert done.stderr == ""


WARNED = [
    (("float64", "inline"), "-march=native"),
    (("float64", "inline"), "-g0"),
    (("float64", "inline"), "-Dtest_arm_NO_VECTORS"),
    (("float32", "inline"), "-march=native"),
    (("float32", "libm"), "-g0"),
    (("float64", "libm"), "-march=native"),
    (("float64", "freestanding"), "-march=native"),
    (("float32", "freestanding"), "-Dtest_arm_NO_VECTORS"),
]
"""Options and flag of the packages that must give no warning."""


@pytest.mark.parametrize(("options", "flag"), slow_but_for([WARNED[0], WARNED[-1]], WARNED, spread=True))
@pytest.mark.parametrize("compiler", COMPILERS)
def test_no_warnings(compiler: str, options: tuple[str, str], flag: str, tmp_path: Path) -> None:
    need(compiler)
    package = arm_package(options=EmitOptions(*options), names=NAMES)  # type: ignore[arg-type]
    write_sources(package, tmp_path)
    for source in package.sources:
        checked = _checked(compiler, (options, flag) in OPTIMISED)
        words = [compiler, *STRICT, *EXTRA, *checked, flag, f"-I{tmp_path}/include", "-c"]
        _compile([*words, str(tmp_path / source), "-o", str(tmp_path / "x.o")])


def every_kernel() -> dict[str, Kernel]:
    """Of two_link."""
    model, names = bundled_model("two_link"), OF_TREES
    return lowered_once((model.content_hash, "every kernel", *names), lambda: lower(model, functions=names))


@pytest.mark.parametrize("name", slow_but_for(OF_TREES[::3], OF_TREES))
def test_a_package_of_any_one_function_compiles(name: str, tmp_path: Path) -> None:
    """Macros and helpers that one function needs do not come from another that happens to be there."""
    need("gcc")
    names = wanted([name])
    kernels = {key: kernel for key, kernel in every_kernel().items() if kernel.function.name in names}
    package = package_view(package_info(bundled_model("two_link")), kernels, EmitOptions())
    write_sources(package, tmp_path)
    sources = [str(tmp_path / source) for source in package.sources]
    _compile(["gcc", *STRICT, *EXTRA, f"-I{tmp_path}/include", "-fsyntax-only", *sources])


PLAIN = {
    "gcc": ["-Dtest_arm_NO_VECTORS"],
    "clang": ["-U__GNUC__", "-fms-compatibility", "-Wno-builtin-macro-redefined", "-Wno-literal-range"],
}
"""As near to MSVC as there is here. The literal range: without __GNUC__ glibc's own INFINITY is 1e10000f."""

GNU_C = r"\b__(?!builtin_(?:inf|nan)f\b)\w+|#pragma|_Pragma"
"""Names and pragmas of GCC's; INFINITY and NAN are math.h's own business."""


PLAIN_OPTIONS = [("float64", "inline"), ("float32", "inline"), ("float64", "libm")]


@pytest.mark.parametrize("options", slow_but_for(PLAIN_OPTIONS[:1], PLAIN_OPTIONS))
@pytest.mark.parametrize("compiler", COMPILERS)
def test_without_vectors_it_is_plain_c99(compiler: str, options: tuple[str, str], tmp_path: Path) -> None:
    """No vector extension, attribute, builtin or pragma is left for a compiler that has none of GCC's."""
    need(compiler)
    package = arm_package(options=EmitOptions(*options), names=NAMES)  # type: ignore[arg-type]
    write_sources(package, tmp_path)
    for source in map(str, (tmp_path / source for source in package.sources)):
        words = [compiler, *STRICT, "-pedantic-errors", *PLAIN[compiler], f"-I{tmp_path}/include"]
        _compile([*words, *_checked(compiler, False), "-c", source, "-o", str(tmp_path / "x.o")])
        if "-U__GNUC__" not in PLAIN[compiler]:
            continue
        words = [compiler, "-std=c99", *PLAIN[compiler], f"-I{tmp_path}/include", "-E", source]
        text = subprocess.run(words, capture_output=True, text=True, check=True).stdout
        own = _own_lines(text, tmp_path)
        assert len(own) > 10
        assert [line for line in own if re.search(GNU_C, line)] == []


FREESTANDING = [(compiler, real) for compiler in COMPILERS for real in ("float64", "float32")]


@pytest.mark.parametrize(("compiler", "real"), slow_but_for([("gcc", "float32")], FREESTANDING, spread=True))
def test_freestanding_code_needs_no_library(compiler: str, real: str, tmp_path: Path) -> None:
    """What it leaves to the linker is what a freestanding compiler itself may call. All functions by gcc in float64."""
    need(compiler)
    names = None if (real, compiler) == ("float64", "gcc") else NAMES
    package = arm_package(options=EmitOptions(real, "freestanding"), names=names)  # type: ignore[arg-type]
    write_sources(package, tmp_path)
    sources = [str(tmp_path / source) for source in package.sources]
    words = [compiler, "-std=c99", "-ffreestanding", "-O2", "-nostdlib", "-r", f"-I{tmp_path}/include"]
    _compile([*words, *sources, "-o", str(tmp_path / "all.o")])
    missing = subprocess.run(
        ["nm", "-u", str(tmp_path / "all.o")], capture_output=True, text=True, check=True
    )
    assert set(missing.stdout.replace(" U ", " ").split()) <= {"memcpy", "memset", "memmove", "memcmp"}


def _own_lines(preprocessed: str, folder: Path) -> list[str]:
    """Lines that come from the package's files, by the preprocessor's line markers."""
    own, inside = [], False
    for line in preprocessed.splitlines():
        marker = re.match(r'# \d+ "([^"]*)"', line)
        if marker:
            inside = marker[1].startswith(str(folder))
        elif inside and line.strip():
            own.append(line)
    return own


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The object files of two arms of different names and inertias."""
    made = []
    for number, name in enumerate(("first arm", "second arm")):
        folder = tmp_path_factory.mktemp("objects")
        package = arm_package(name, seed=number, names=[*NAMES, "gravity"])
        write_sources(package, folder)
        for source in package.sources:
            made.append(folder / f"{number}_{Path(source).stem}.o")
            _compile(
                [
                    "gcc",
                    "-std=c99",
                    "-O1" if number == 0 else "-O0",
                    f"-I{folder}/include",
                    "-c",
                    str(folder / source),
                    "-o",
                    str(made[-1]),
                ]
            )
    return made


def _symbols(objects: list[Path], kinds: str) -> list[str]:
    listing = subprocess.run(["nm", *map(str, objects)], capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in listing.splitlines() if line and not line.endswith(":")]
    return [row[-1] for row in rows if row[-2] in kinds]


def test_every_public_symbol_starts_with_the_robots_name(objects: list[Path]) -> None:
    public = _symbols(objects, "TDBRVC")
    assert len(public) > 40
    assert [s for s in public if not s.startswith(("first_arm_", "second_arm_"))] == []


def test_nothing_is_called_but_sines_and_cosines_and_no_state_is_kept(objects: list[Path]) -> None:
    foreign = {s for s in _symbols(objects, "U") if not s.startswith(("first_arm_", "second_arm_"))}
    # gcc merges sin and cos, and may call its own memset, memcpy and stack guard
    assert foreign <= {
        "sin",
        "cos",
        "sincos",
        "memset",
        "memcpy",
        "memmove",
        "__stack_chk_fail",
        "_GLOBAL_OFFSET_TABLE_",
    }
    assert _symbols(objects, "BbCGgSs") == []
    assert _symbols(objects, "Dd") == [
        s for s in _symbols(objects, "Dd") if "names" in s or "units" in s or "equations" in s
    ]


TWO_ROBOTS = r"""
#include <array>
#include <cmath>
#include <cstdio>
#include <thread>
#include "first_arm/first_arm.h"
#include "second_arm/second_arm.h"

static_assert(first_arm_DOF == 4 && second_arm_DOF == 4, "");

int main()
{
    std::array<first_arm_REAL, first_arm_DOF> q{0.1, 0.2, 0.3, 0.4}, a{}, b{}, a2{}, b2{};
    first_arm_gravity(q.data(), a.data());
    second_arm_gravity(q.data(), b.data());
    std::thread one([&] { for (int k = 0; k < 10000; k++) first_arm_gravity(q.data(), a2.data()); });
    std::thread two([&] { for (int k = 0; k < 10000; k++) second_arm_gravity(q.data(), b2.data()); });
    one.join();
    two.join();
    return !(a == a2 && b == b2 && a != b && std::isfinite(a[1]));
}
"""


def test_two_robots_run_side_by_side_in_a_cpp17_program(objects: list[Path], tmp_path: Path) -> None:
    need("g++")
    source, program = tmp_path / "main.cpp", tmp_path / "main"
    source.write_text(TWO_ROBOTS)
    folders = sorted({f"-I{path.parent}/include" for path in objects})
    flags = ["-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *folders]
    _compile(["g++", *flags, str(source), *map(str, objects), "-lm", "-pthread", "-o", str(program)])
    assert subprocess.run([str(program)], check=False).returncode == 0


def test_the_stack_frame_of_a_call_is_small(tmp_path: Path) -> None:
    package = arm_package(names=["forward_dynamics", "regressor"])
    write_sources(package, tmp_path)
    for source in package.sources:
        words = ["gcc", "-std=c99", "-O2", "-march=native", "-fno-math-errno", f"-I{tmp_path}/include"]
        _compile(
            [
                *words,
                "-Wstack-usage=16384",
                "-Werror",
                "-c",
                str(tmp_path / source),
                "-o",
                str(tmp_path / "x.o"),
            ]
        )
