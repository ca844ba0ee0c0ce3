"""A package that was built for this machine, and then for another one, by its own build files."""

from __future__ import annotations

import shutil
from pathlib import Path
from time import sleep

import pytest
from bundled import bundled_model
from installed import need, run

import psdmc
from psdmc.progress import Step
from psdmc.target.target import Real
from psdmc.toolchain import build_package as building
from psdmc.toolchain.build_package import build_package

TOOLS = ("arm-none-eabi-gcc", "arm-none-eabi-ar", "arm-none-eabi-readelf")
BOARD = """set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
"""


def emitted(folder: Path, target: str) -> Path:
    psdmc.emit_c(bundled_model("two_link"), folder, name="arm", functions=["gravity"], target=target)
    return folder


def members(library: Path) -> list[str]:
    return run("ar", "t", library).split()


@pytest.mark.parametrize("first", ["psdmc build", "make"])
def test_another_compiler_compiles_everything_again(tmp_path: Path, first: str) -> None:
    need("make", "cmake", "cc", "ar")
    package = emitted(tmp_path / "arm", "scalar")
    if first == "make":
        run("make", "-C", package, "CFLAGS=-O0", "all")
    else:
        build_package(package)
    other = tmp_path / "other cc"
    other.write_text(f'#!/bin/sh\necho compiled >> "{tmp_path}/calls"\nexec cc "$@"\n', encoding="utf-8")
    other.chmod(0o755)
    make = ["make", "-C", package, f"CC='{other}'", "CFLAGS=-O0", "all"]

    run(*make)
    calls = (tmp_path / "calls").read_text(encoding="utf-8").count("compiled")
    again = run(*make)

    assert sorted(members(package / "build" / "libarm.a")) == ["gravity.o", "tables.o"]
    assert calls >= 2
    assert "-c src/" not in again, "nothing changed, nothing is compiled"


WHEEL = """<robot name="wheel"><link name="base"/><link name="rim"><inertial><mass value="2"/>
<inertia ixx="0.02" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="axle" type="continuous"><parent link="base"/><child link="rim"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_tcc_builds_a_package_without_limits_and_its_self_test_passes(tmp_path: Path, real: Real) -> None:
    """tcc takes no minus before INFINITY in a constant. The limits that it compiles are C's infinities."""
    need("make", "tcc", "ar")
    (tmp_path / "wheel.urdf").write_text(WHEEL, encoding="utf-8")
    package = tmp_path / "wheel"
    psdmc.emit_c(psdmc.derive(tmp_path / "wheel.urdf"), package, functions=["inverse_dynamics"], real=real)
    (tmp_path / "limits.c").write_text(
        "#include <stdio.h>\n#include <wheel/wheel.h>\n"
        'int main(void) { printf("%g %g %g", (double)wheel_position_lower[0], (double)wheel_position_upper[0],'
        " (double)wheel_effort_limit[0]); return 0; }\n",
        encoding="utf-8",
    )

    said = run("make", "-C", package, "CC=tcc", "all", "check")
    library = [package / "build" / "libwheel.a", "-lm"]
    run("tcc", f"-I{package}/include", tmp_path / "limits.c", *library, "-o", tmp_path / "limits")

    assert ", 0 failed" in said
    assert run(tmp_path / "limits") == "-inf inf inf"


@pytest.mark.parametrize("tool", ["cmake", "make"])
def test_a_build_says_how_far_it_is(tmp_path: Path, tool: str, monkeypatch: pytest.MonkeyPatch) -> None:
    need(tool)
    if tool == "make":
        monkeypatch.setattr(shutil, "which", lambda name: None if name == "cmake" else f"/usr/bin/{name}")
    monkeypatch.setattr(building, "TICK", 0.01)
    said: list[str] = []

    build_package(emitted(tmp_path / "arm", "scalar"), progress=said.append)

    steps = [step for step in said if isinstance(step, Step)]
    assert steps[0] == "building: 0 of 3 files"
    assert [step.share for step in steps] == sorted(step.share for step in steps)
    assert 0.6 < steps[-1].share <= 1.0


def test_a_step_stays_where_the_build_takes_an_object_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(building, "TICK", 0.001)
    first, second = (tmp_path / name for name in ("one.o", "two.o"))
    steps: list[Step] = []
    first.touch()

    with building.told(tmp_path, 2, lambda step: steps.append(step)):  # type: ignore[arg-type]
        first.unlink()
        while len(steps) < 3:
            sleep(0.001)
        first.touch()
        second.touch()
        while steps[-1].share < 1.0:
            sleep(0.001)

    assert {step.share for step in steps} == {0.5, 1.0}
    assert [step.share for step in steps] == sorted(step.share for step in steps)


def test_a_board_s_library_holds_the_boards_code_alone(tmp_path: Path) -> None:
    need(*TOOLS, "make")
    package = emitted(tmp_path / "arm", "cortex-m4f")
    build_package(package)

    run("make", "-C", package, f"CC={TOOLS[0]}", f"AR={TOOLS[1]}", "all")

    heads = run(TOOLS[2], "-h", package / "build" / "libarm.a")
    machines = [line.split(":")[1].strip() for line in heads.splitlines() if "Machine:" in line]
    assert machines == ["ARM"] * len(members(package / "build" / "libarm.a"))


def test_cmake_with_a_boards_toolchain_file_needs_no_further_option(tmp_path: Path) -> None:
    """The self-test is a program: it wants an operating system, or an emulator."""
    need(*TOOLS, "cmake")
    package = emitted(tmp_path / "arm", "cortex-m4f")
    (tmp_path / "board.cmake").write_text(BOARD, encoding="utf-8")
    build = tmp_path / "build"

    run("cmake", "-S", package, "-B", build, f"-DCMAKE_TOOLCHAIN_FILE={tmp_path}/board.cmake")
    run("cmake", "--build", build)

    assert (build / "libarm.a").is_file()
