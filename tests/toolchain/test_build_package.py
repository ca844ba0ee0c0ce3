"""The emitted package without psdmc: built by its own files, tested by its own test, used by other programs."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from installed import need, run
from slow_cases import slow_but_for
from traced import arm_kernels, arm_package, arm_references
from unoptimised import wrapper

import psdmc
from psdmc.backends.c.back_end import package_files
from psdmc.backends.info import EmitOptions
from psdmc.backends.package_folder import write_package
from psdmc.backends.reference_states import ReferenceStates
from psdmc.errors import InputError, ToolchainError
from psdmc.toolchain.build_package import UNFINISHED, build_package

NAMES = ["inverse_dynamics", "forward_dynamics"]
NANS = ["inverse_dynamics", "forward_dynamics_theta"]
BUILD_TOOLS = ["cmake", "make"]


def _emit(folder: Path, references: ReferenceStates | None = None, **options: str) -> Path:
    made = EmitOptions(**options)  # type: ignore[arg-type]
    package = arm_package(options=made, names=NAMES, references=references or arm_references())
    write_package(folder, package_files(package))
    return folder


@pytest.fixture
def unoptimised(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package's build files call a compiler that does not optimise: for what they do, not what they make."""
    monkeypatch.setenv("CC", str(wrapper(tmp_path_factory.mktemp("unoptimised"))))


@pytest.fixture(scope="module")
def emitted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _emit(tmp_path_factory.mktemp("emitted") / "arm")


@pytest.fixture(scope="module")
def installed(emitted: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("cmake")
    prefix = tmp_path_factory.mktemp("prefix")
    build_package(emitted)
    run("cmake", "--install", emitted / "build", "--prefix", prefix)
    return prefix


def test_build_runs_the_self_test_with_cmake(emitted: Path) -> None:
    need("cmake")
    report = build_package(emitted)
    for name in (
        "inverse_dynamics, one state",
        "inverse_dynamics_theta, rows",
        "forward_dynamics, rows",
        "forward_dynamics, lane by lane",
    ):
        assert any(name in line and line.endswith(": ok") for line in report.splitlines()), name
    assert "test_arm: 10 checks of 4 functions, 0 failed" in report


@pytest.mark.usefixtures("unoptimised")
def test_build_runs_the_self_test_with_make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need("make")
    folder = _emit(tmp_path / "arm", real="float32")
    which = shutil.which
    monkeypatch.setattr("shutil.which", lambda name: None if name == "cmake" else which(name))
    assert "inverse_dynamics, rows" in build_package(folder)
    assert (folder / "build" / "libtest_arm.so").is_file()


def _spoilt(name: str, value: float) -> ReferenceStates:
    """References with one entry of a kernel's expected values set to `value`."""
    good = arm_references()
    wrong = good.expected[name].copy()
    wrong[3, 1] = value
    return ReferenceStates(good.given, {**good.expected, name: wrong}, good.theta_b)


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("tool", slow_but_for(["cmake"], BUILD_TOOLS))
def test_a_failed_self_test_says_which_checks_failed_and_by_how_much(
    tool: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need(tool)
    which = shutil.which
    other = {"cmake": "make", "make": "cmake"}[tool]
    monkeypatch.setattr("shutil.which", lambda name: None if name == other else which(name))
    tau = arm_references().expected["inverse_dynamics"]
    largest = np.abs(tau[:, 1]).max()
    folder = _emit(tmp_path / "arm", _spoilt("inverse_dynamics", tau[3, 1] + 1e-6 * largest))
    with pytest.raises(ToolchainError) as caught:
        build_package(folder)
    assert str(caught.value) == (
        f"{folder}: the self-test failed in 3 checks: "
        "inverse_dynamics, one state: error 1.0e-06, tolerance 1e-10; "
        "inverse_dynamics, rows: error 1.0e-06, tolerance 1e-10; "
        "inverse_dynamics, lane by lane: error 1.0e-06, tolerance 1e-10"
    )
    assert "run it to see everything: " in str(caught.value.hint)


@pytest.mark.usefixtures("unoptimised")
def test_more_failures_than_a_line_holds_are_counted(tmp_path: Path) -> None:
    good = arm_references()
    spoilt = {name: 2.0 * values for name, values in good.expected.items()}
    with pytest.raises(ToolchainError, match=r"failed in 10 checks: .*; \.\.\.(?m:$)"):
        build_package(_emit(tmp_path / "arm", ReferenceStates(good.given, spoilt, good.theta_b)))


@pytest.mark.usefixtures("unoptimised")
def test_a_self_test_that_dies_is_not_called_failed_checks(tmp_path: Path) -> None:
    folder = _emit(tmp_path / "arm")
    source = folder / "test" / "self_test.c"
    text = source.read_text().replace(
        "int main(void)\n{", "#include <stdlib.h>\nint main(void)\n{\n    abort();"
    )
    source.write_text(text)
    with pytest.raises(ToolchainError, match=r"(ctest|make) failed with status"):
        build_package(folder, edited=True)


CMAKES_LINES = (
    "CMake Error at CMakeDetermineCompilerId.cmake:312 (file):\n"
    "  file failed to open for writing (No space left on device):\n"
)


@pytest.mark.parametrize(
    ("said", "free", "message"),
    [
        (CMAKES_LINES, 10**9, "cmake: file failed to open for writing (No space left on device):"),
        (
            "as: can't close a.o: Disk quota exceeded",
            10**9,
            "cmake: as: can't close a.o: Disk quota exceeded",
        ),
        ("gmake: No rule to make target 'Makefile'", 4096, "cmake: gmake: No rule to make target 'Makefile'"),
    ],
)
def test_a_full_disk_is_said_with_its_folder(
    said: str, free: int, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """CMake calls it by name in a later line, or not at all."""
    cmake = tmp_path / "bin" / "cmake"
    cmake.parent.mkdir()
    cmake.write_text(f"#!/bin/sh\ncat >&2 << 'END'\n{said}\nEND\nexit 1\n")
    cmake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{cmake.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=free))
    folder = _emit(tmp_path / "arm")

    with pytest.raises(ToolchainError) as caught:
        build_package(folder)

    assert caught.value.message == f"{folder}: no space left on the disk: {message}"
    assert str(caught.value.hint).startswith(
        f"make room there and in {tempfile.gettempdir()}, then try again"
    )


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("name", slow_but_for(["forward_dynamics_theta"], NANS))
def test_a_self_test_does_not_let_a_nan_pass(name: str, tmp_path: Path) -> None:
    with pytest.raises(ToolchainError, match=rf"{name}, rows: error nan"):
        build_package(_emit(tmp_path / "arm", _spoilt(name, np.nan)))


@pytest.mark.parametrize("flags", slow_but_for(["-Ofast"], ["-O2", "-Ofast"]))
def test_a_function_that_gives_no_number_fails_whatever_the_compiler_assumes(
    flags: str, tmp_path: Path
) -> None:
    """-ffast-math makes isnan false, and comparisons with a NaN anything."""
    spoilt = {"inverse_dynamics": ("tau", "NAN"), "gravity": ("g", "INFINITY")}
    folder = tmp_path / "arm"
    package = arm_package(names=[*spoilt], references=arm_references())
    write_package(folder, package_files(package))
    for name, (output, value) in spoilt.items():
        source = folder / "src" / f"{name}.c"
        body = f'#include "{name}.inc"\n'
        text = source.read_text()
        assert body in text
        text = text.replace(body, f"{body}    {output}[0] = (double){value};\n", 1)
        source.write_text(f"#include <math.h>\n{text}")
    done = subprocess.run(
        ["make", "-s", "-C", str(folder), "check", f"CFLAGS={flags}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    for name in spoilt:
        assert f"{name}, one state: error nan, tolerance 1e-10: FAILED" in done.stdout


@pytest.mark.usefixtures("unoptimised")
def test_the_self_test_checks_whatever_was_emitted(tmp_path: Path) -> None:
    """The functions of a new user's first try, for which it was an empty main once."""
    package = arm_package(names=["gravity", "jacobian"], references=arm_references())
    write_package(tmp_path / "arm", package_files(package))
    report = build_package(tmp_path / "arm")
    for layout in ("one state", "rows", "lane by lane"):
        assert f"gravity, {layout}: error" in report
        assert f"jacobian, {layout}: error" in report
    assert "gravity_theta, rows: error" in report
    assert "test_arm: 8 checks of 3 functions, 0 failed" in report


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("real", slow_but_for(["float64"], ["float64", "float32"]))
def test_the_self_test_checks_functions_that_add_loads(real: Any, tmp_path: Path) -> None:
    """At the tip and at every frame; a fault in the matrix of one frame is seen."""
    need("make")
    robot = Path(__file__).parents[2] / "examples" / "robots" / "kr6.toml"
    model = psdmc.derive(robot, expand=False, frames=["link6", "link3"], tool=(0.1, 0, 0.2, 0, 0.3, 0))
    psdmc.emit_c(model, tmp_path / "arm", functions=["gravity"], real=real, payload=True, name="arm")

    report = build_package(tmp_path / "arm")
    assert "add_payload, at the tip: error" in report
    assert "add_payload_at, every frame: error" in report
    assert "arm: 7 checks of 4 functions, 0 failed" in report

    source = tmp_path / "arm" / "src" / "payload.c"
    text = source.read_text()
    source.write_text(text.replace("load_map[frame + 1]", "load_map[frame]"))
    assert source.read_text() != text
    with pytest.raises(ToolchainError, match="add_payload_at, every frame: error"):
        build_package(tmp_path / "arm", edited=True)


def _with_a_fault(body: str) -> str:
    """A body whose last stored entry is off by a millionth, in the forms that store one by one and in groups."""
    lines = body.splitlines()
    stores = [i for i, line in enumerate(lines) if "STORE(" in line and "SPLAT(0.0)" not in line]
    lines[stores[-1]] = re.sub(r"(\d+, )(.*)\);$", r"\1(\2) * 1.000001);", lines[stores[-1]], count=1)
    groups = [i for i, line in enumerate(lines) if "STORE_GROUP(" in line]
    for i in groups[-1:]:
        lines[i] = re.sub(r"STORE_GROUP\((\w+, \d+), (.*)\);$", _spoilt_group, lines[i])
    return "\n".join(lines) + "\n"


def _spoilt_group(matched: re.Match[str]) -> str:
    values = ", ".join(f"({value}) * 1.000001" for value in matched[2].split(", "))
    return f"STORE_GROUP({matched[1]}, {values});"


def test_a_fault_in_any_function_fails_its_checks_in_every_layout(tmp_path: Path) -> None:
    need("make")
    package = arm_package(references=arm_references())
    files = package_files(package)
    for path in files:
        if path.endswith(".inc"):
            files[path] = _with_a_fault(files[path])
    write_package(tmp_path, files)
    words = ["make", "-C", str(tmp_path), "CC=gcc", "CFLAGS=-O0", "check"]
    report = subprocess.run(words, capture_output=True, text=True, check=False).stdout
    for name in arm_kernels():
        for layout in (
            ("one state", "rows") if name.endswith("_theta") else ("one state", "rows", "lane by lane")
        ):
            assert re.search(rf"^{name}, {layout}: error .*: FAILED$", report, re.MULTILINE), (name, layout)
    assert "39 checks of 15 functions, 39 failed" in report


def test_a_folder_without_a_package_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no emitted package") as caught:
        build_package(tmp_path)
    assert "emit-c" in str(caught.value.hint)


@pytest.mark.parametrize(
    ("name", "shown"),
    [('a"b', "'\"'"), ("a;b", "';'"), ("a\nb", r"'\\n'"), ("a[b", "'\\['"), ("a:b/c", "':'")],
)
def test_a_path_that_cmake_cannot_take_is_refused(name: str, shown: str, tmp_path: Path) -> None:
    need("cmake")
    folder = _emit(tmp_path / name)
    with pytest.raises(InputError, match=f"CMake cannot take {shown} in a folder's path") as caught:
        build_package(folder)
    assert "make" in str(caught.value.hint)
    assert not (folder / "build").exists()


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("name", slow_but_for(["~"], ["~", "-a", "a [b] 'c' $d #e"]))
def test_cmake_takes_other_names(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also those that are something else on its command line."""
    need("cmake")
    monkeypatch.chdir(tmp_path)
    assert ": ok" in build_package(_emit(Path(name)))


def test_a_folder_of_others_is_not_built_in(tmp_path: Path) -> None:
    folder = _emit(tmp_path / "arm")
    (folder / "build").mkdir()
    (folder / "build" / "plan.dwg").write_text("mine")
    with pytest.raises(
        InputError, match=r"build: psdmc did not write the files in this folder: plan.dwg"
    ) as caught:
        build_package(folder)
    assert "move" in str(caught.value.hint)
    assert [path.name for path in (folder / "build").iterdir()] == ["plan.dwg"]


def test_a_machine_without_build_tools_is_said(emitted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "psdmc.toolchain.build_package.shutil.which", lambda name: "/usr/bin/cc" if name == "cc" else None
    )
    with pytest.raises(ToolchainError, match="neither cmake nor make"):
        build_package(emitted)


SANITIZED = ["-fsanitize=address,undefined", "-march=native -fsanitize=address,undefined"]


@pytest.mark.parametrize("flags", slow_but_for(SANITIZED[:1], SANITIZED))
def test_the_self_test_is_clean_under_sanitizers(flags: str, tmp_path: Path) -> None:
    need("make")
    folder = _emit(tmp_path / "arm")
    sanitize = f"-O0 -g {flags} -fno-sanitize-recover=all"
    run("make", "-C", folder, "CC=gcc", f"CFLAGS={sanitize}", "check")


CONSUMER = r"""
#include <test_arm/test_arm.h>
#include <stdio.h>

int main(void)
{
    double q[test_arm_DOF] = {0.1, 0.2, 0.3, 0.4}, qd[test_arm_DOF] = {1, 2, 3, 4}, tau[test_arm_DOF];
    test_arm_inverse_dynamics(q, qd, qd, tau);
    printf("%.17g %s\n", tau[0], test_arm_joint_names[0]);
    return 0;
}
"""

CMAKE = """
cmake_minimum_required(VERSION 3.13)
project(consumer LANGUAGES C)
find_package(test_arm 0.1 REQUIRED)
add_executable(consumer main.c)
target_link_libraries(consumer PRIVATE test_arm::test_arm)
"""


def test_a_cmake_project_finds_the_installed_package(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "main.c").write_text(CONSUMER)
    (tmp_path / "CMakeLists.txt").write_text(CMAKE)
    run("cmake", "-S", tmp_path, "-B", tmp_path / "b", f"-DCMAKE_PREFIX_PATH={installed}")
    run("cmake", "--build", tmp_path / "b")
    assert run(tmp_path / "b" / "consumer").endswith(" joint 0\n")


def test_pkg_config_finds_the_installed_package(installed: Path, tmp_path: Path) -> None:
    need("pkg-config")
    (tmp_path / "main.c").write_text(CONSUMER)
    (place,) = (str(path.parent) for path in installed.rglob("test_arm.pc"))
    flags = run("pkg-config", "--cflags", "--libs", "test_arm", PKG_CONFIG_PATH=place).split()
    run("gcc", "-std=c99", tmp_path / "main.c", *flags, "-o", tmp_path / "main")
    assert run(tmp_path / "main").endswith(" joint 0\n")


@pytest.mark.usefixtures("unoptimised")
def test_make_install_gives_the_same_layout(tmp_path: Path) -> None:
    need("make")
    folder, prefix = _emit(tmp_path / "arm"), tmp_path / "prefix"
    run("make", "-C", folder, f"PREFIX={prefix}", "install")
    found = sorted(str(path.relative_to(prefix)) for path in prefix.rglob("*") if path.is_file())
    assert found == [
        "include/test_arm/test_arm.h",
        "include/test_arm/test_arm.hpp",
        "lib/libtest_arm.a",
        "lib/libtest_arm.so",
        "lib/pkgconfig/test_arm.pc",
    ]
    assert "prefix=${pcfiledir}/../..\n" in (prefix / "lib/pkgconfig/test_arm.pc").read_text()


def test_openmp_gives_the_same_results(tmp_path: Path) -> None:
    need("make")
    folder = _emit(tmp_path / "arm")
    report = run("make", "-C", folder, "CFLAGS=-O0 -fopenmp -Dtest_arm_OPENMP", "check")
    assert report.count(": ok") == 10


@pytest.mark.usefixtures("unoptimised")
def test_an_edited_package_is_named_and_built_only_on_request(tmp_path: Path) -> None:
    folder = _emit(tmp_path / "arm")
    with open(folder / "src" / "tables.c", "a", encoding="utf-8") as stream:
        stream.write("/* edited */\n")
    (folder / "README.md").unlink()

    with pytest.raises(InputError, match=r"not as emit-c wrote it: .*src/tables\.c") as caught:
        build_package(folder)
    assert "README.md" in caught.value.message
    assert "--edited" in str(caught.value.hint)
    assert not (folder / "build").exists()
    assert ": ok" in build_package(folder, edited=True)


@pytest.mark.parametrize(
    "text", ["", "[]", '{"generator": "psdmc"}', '{"generator": "psdmc", "files": {}}', "{" * 9000]
)
def test_a_manifest_that_is_none(text: str, tmp_path: Path) -> None:
    folder = _emit(tmp_path / "arm")
    (folder / "manifest.json").write_text(text)
    with pytest.raises(InputError, match=r"no emitted package \(no manifest\.json of psdmc's\)"):
        build_package(folder)


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("tool", slow_but_for(["make"], BUILD_TOOLS))
def test_what_a_killed_build_left_is_not_built_on(
    tool: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An object file cut short is younger than its source: build tools take it for finished."""
    need(tool)
    which = shutil.which
    monkeypatch.setattr("shutil.which", lambda name: None if name == "cmake" != tool else which(name))
    folder = _emit(tmp_path / "arm")
    build_package(folder)
    for path in folder.glob("build/**/*.o"):
        path.write_bytes(path.read_bytes()[:100])
    for path in (*folder.glob("build/**/*.a"), *folder.glob("build/**/*.so*")):
        path.unlink()
    (folder / "build" / UNFINISHED).touch()

    assert ": ok" in build_package(folder)
    assert not (folder / "build" / UNFINISHED).exists()


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("tool", slow_but_for(["make"], BUILD_TOOLS))
def test_spaces_and_letters_in_paths_and_compilers(
    tool: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need(tool, "gcc")
    which = shutil.which
    monkeypatch.setattr("shutil.which", lambda name: None if name == "cmake" != tool else which(name))
    own = tmp_path / "my $tools"
    own.mkdir()
    (own / "gcc").write_text('#!/bin/sh\nexec gcc "$@"\n')
    (own / "gcc").chmod(0o755)
    if tool == "make":  # CMake takes no such path from CC
        monkeypatch.setenv("CC", f"'{own / 'gcc'}' -O0")
    assert ": ok" in build_package(_emit(tmp_path / "mein Röboter 'x'"))


PARENT = """
cmake_minimum_required(VERSION 3.13)
project(parent LANGUAGES C)
enable_testing()
add_subdirectory({package} arm)
add_executable(consumer main.c)
target_link_libraries(consumer PRIVATE test_arm::test_arm)
add_test(NAME consumer COMMAND consumer)
if(DEFINED BUILD_TESTING)
  message(FATAL_ERROR "BUILD_TESTING was set")
endif()
"""


@pytest.mark.usefixtures("unoptimised")
@pytest.mark.parametrize("asked", slow_but_for([False], [False, True]))
def test_a_subdirectory_leaves_the_parents_tests_and_installation_alone(
    asked: bool, emitted: Path, tmp_path: Path
) -> None:
    need("cmake")
    (tmp_path / "main.c").write_text(CONSUMER)
    (tmp_path / "CMakeLists.txt").write_text(PARENT.format(package=emitted))
    build, prefix = str(tmp_path / "b"), tmp_path / "prefix"
    options = ["-Dtest_arm_SELF_TEST=ON", "-Dtest_arm_INSTALL=ON"] if asked else []
    run("cmake", "-S", tmp_path, "-B", build, *options)
    run("cmake", "--build", build, "--parallel", "2")
    tests = run("ctest", "--test-dir", build)
    run("cmake", "--install", build, "--prefix", prefix)

    assert ("test_arm_self_test" in tests) == asked
    assert "consumer" in tests
    assert (prefix / "include" / "test_arm").is_dir() == asked
    assert "Nightly" not in run("cmake", "--build", build, "--target", "help")
