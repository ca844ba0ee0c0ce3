"""Robots called like something of C's, POSIX's, CMake's or Windows': their packages compile and configure beside it."""

from __future__ import annotations

import platform
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import platform_names
import pytest
from slow_cases import slow_but_for
from small import pendulum, pendulum_info

from psdmc.backends.c.back_end import package_files
from psdmc.backends.c.render import RESERVED, identifier, is_reserved

NEWEST_GLIBC = (2, 36)
"""The one whose headers reserved/c_and_posix.txt was made from."""

ISSUED = """sin cos tan time index rindex j0 j1 jn y0 y1 yn gamma lgamma signgam select EOF NULL M_PI M_E I B0 link
unlink read write open close pipe signal raise abort exit abs labs div div_t tm stat remainder round trunc floor ceil fmin
fmax fma pow exp log log2 sqrt cbrt hypot erf tgamma drem scalb significand ecvt rand random srand drand48 environ
optarg optind getopt daemon nice pause sleep usleep wait kill alarm clock ctime double_t float_t FILE stdin stdout
stderr puts printf memcpy strlen strdup malloc free assert errno isnan isinf INFINITY NAN HUGE_VAL PATH_MAX BUFSIZ
SIGINT int8_t size_t wchar_t bool true false complex imaginary linux unix i386 std abi posix main class namespace
operator option entry FTW timeval sockaddr bind listen accept send socket htons truncate sync times ulimit y2"""


def _installed(*programs: str) -> bool:
    return all(shutil.which(program) for program in programs)


@pytest.mark.parametrize("language", ["c", "c++"])
def test_every_name_of_the_headers_is_reserved(language: str) -> None:
    if not _installed("gcc", "g++", "clang", "clang++"):
        pytest.skip("needs gcc, g++ and clang")
    found = platform_names.declarations(language)
    for compiler in ("gcc", "clang") if language == "c" else ("g++", "clang++"):
        found |= platform_names.macros(compiler, language)
    missing = sorted(name for name in found if not is_reserved(name))
    version = tuple(int(part) for part in (platform.libc_ver()[1] or "0.0").split(".")[:2])
    if missing and (platform.libc_ver()[0] != "glibc" or version > NEWEST_GLIBC):
        pytest.skip(f"another C library: run python tests/backends/c/platform_names.py to add {missing}")
    assert len(found) > 2500
    assert missing == []


@pytest.mark.parametrize(
    "name", ["CON", "Aux", "lpt1", "com9", "nul", "all", "test", "m", "install", "Threads"]
)
def test_devices_targets_and_libraries_are_reserved(name: str) -> None:
    assert identifier(name) == f"robot_{name}"


@pytest.mark.parametrize(
    "name", ["kr6", "ur5", "panda", "arm", "denso_wall", "scara", "two_link", "z1", "sin2"]
)
def test_ordinary_names_stay(name: str) -> None:
    assert identifier(name) == name


def _headers(names: Iterable[str], folder: Path) -> list[str]:
    """Emit each robot's two headers under `folder`; their paths below it, without ending."""
    made = []
    for name in names:
        package = pendulum(pendulum_info(name))
        files = package_files(package)
        (folder / package.robot).mkdir()
        for kind in ("h", "hpp"):
            path = f"{package.robot}/{package.robot}.{kind}"
            (folder / path).write_text(files[f"include/{path}"], encoding="ascii")
        made.append(f"{package.robot}/{package.robot}")
    return made


@pytest.fixture(scope="module")
def headers(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A folder of every issued robot's headers, and their paths in it."""
    folder = tmp_path_factory.mktemp("headers")
    names = [*ISSUED.split(), *sorted(RESERVED)[::40]]
    return folder, _headers(dict.fromkeys(names), folder)


COMPILED = [
    (compiler, kind, order)
    for compiler, kind in (("gcc", "h"), ("g++", "hpp"), ("clang++", "hpp"))
    for order in ("package first", "system first")
]
QUICK = [("gcc", "h", "package first"), ("g++", "hpp", "system first")]


@pytest.mark.parametrize(("compiler", "kind", "order"), slow_but_for(QUICK, COMPILED, spread=True))
def test_headers_compile_beside_all_system_headers(
    compiler: str, kind: str, order: str, headers: tuple[Path, list[str]], tmp_path: Path
) -> None:
    if not _installed(compiler):
        pytest.skip(f"{compiler} is not installed")
    folder, robots = headers
    language = "c" if kind == "h" else "c++"
    own = "".join(f'#include "{robot}.{kind}"\n' for robot in robots)
    system = platform_names.sources()[language] + ("#include <cmath>\n" if kind == "hpp" else "")
    parts = (own, system) if order == "package first" else (system, own)
    main = tmp_path / ("main.c" if kind == "h" else "main.cpp")
    main.write_text("#define _GNU_SOURCE 1\n" + "".join(parts) if kind == "h" else "".join(parts))
    standard = "-std=gnu11" if kind == "h" else "-std=gnu++17"
    words = [compiler, standard, "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{folder}", str(main)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


BELONGING_TO_THE_BUILD = """all clean help install test package edit_cache rebuild_cache preinstall ALL_BUILD INSTALL
ZERO_CHECK Nightly Experimental NightlyTest m c rt pthread gcc CMAKE PROJECT Threads OpenMP con"""


def test_cmake_configures_packages_of_its_own_names(tmp_path: Path) -> None:
    if not _installed("cmake", "gcc"):
        pytest.skip("needs cmake and gcc")
    robots = []
    for name in BELONGING_TO_THE_BUILD.split():
        package = pendulum(pendulum_info(name))
        robots.append(package.robot)
        for path, text in package_files(package).items():
            (tmp_path / package.robot / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / package.robot / path).write_text(text, encoding="ascii")
    lines = ["cmake_minimum_required(VERSION 3.13)", "project(parent C)", "include(CTest)", "include(CPack)"]
    lines += [f"add_subdirectory({robot})" for robot in robots]
    (tmp_path / "main.c").write_text("int main(void) { return 0; }\n")
    lines += ["add_executable(main main.c)", f"target_link_libraries(main {' '.join(robots)})"]
    (tmp_path / "CMakeLists.txt").write_text("\n".join(lines) + "\n")
    words = ["cmake", "-S", str(tmp_path), "-B", str(tmp_path / "build"), "-Wno-dev"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    assert "Warning" not in done.stderr
