"""Targets on their machines: compiled here where this machine is one, cross-compiled and run by qemu where it is not."""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_warnings import EXTRA, STRICT
from direct import write_sources
from installed import run
from slow_cases import slow_but_for
from traced import arm_package

import psdmc
from psdmc import emission
from psdmc.backends.info import EmitOptions
from psdmc.errors import InputError, ToolchainError
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.kernel import Kernel
from psdmc.target.presets import CORTEX_M4F, CORTEX_M7, COSTS, NATIVE, PRESETS, SCALAR, X86_64_V3, preset
from psdmc.target.target import Costs, Target
from psdmc.toolchain import compile, compiler_command
from psdmc.toolchain.build_package import build_package
from psdmc.toolchain.compiler_command import find_compiler

ROBOTS = Path(__file__).parents[2] / "examples" / "robots"
HERE = Path(__file__).parent
X86 = platform.machine() in ("x86_64", "AMD64")
FEW = ["inverse_dynamics", "forward_dynamics", "mass_matrix"]
WHOLE = os.environ.get("PSDMC_TARGETS") == "whole"
"""Every function, optimised, and nothing skipped: make test-targets."""
FUNCTIONS = ["all"] if WHOLE else FEW
LOOKED_AT = "x86-64-v3"
"""The target whose C gcc looks at while it optimises; clang says all by reading. `make test-accuracy` takes every target,
`make test` it and a microcontroller."""

ACCURACY = WHOLE or os.environ.get("PSDMC_ACCURACY") == "whole"
SHOWN = ("two_link", "kr6") if ACCURACY else ("two_link",)
EMULATED = {
    name: [(robot, preset(name)) for robot in SHOWN]
    for name in ("neon", "native", "cortex-m4f", "cortex-m7")
    if ACCURACY or name in ("neon", "cortex-m4f")
}
"""Robot and target under qemu: `make test-accuracy` takes both robots on each, `make test` the small one on one of each
kind."""


def emulated(*names: str) -> pytest.MarkDecorator:
    pairs = [pair for name in names for pair in EMULATED.get(name, ())]
    ids = [f"{target.name}-{robot}" for robot, target in pairs]
    return pytest.mark.parametrize(("robot", "target"), pairs, ids=ids)


@pytest.fixture(scope="module")
def two_link() -> DynamicsModel:
    return psdmc.derive(ROBOTS / "two_link_full.toml")


@pytest.fixture(scope="module")
def kr6() -> DynamicsModel:
    return psdmc.derive(ROBOTS / "kr6.toml", expand=False)


def need(*programs: str) -> None:
    for program in programs:
        if shutil.which(program) is None:
            (pytest.fail if WHOLE else pytest.skip)(f"{program} is not installed")


OF_THIS_MACHINE = ["native", "scalar", "x86-64-v2", "x86-64-v3", "x86-64-v4"]


@pytest.mark.parametrize("name", slow_but_for(["native", "scalar", "x86-64-v3"], OF_THIS_MACHINE))
def test_every_target_that_this_machine_is_gives_the_models_results(
    two_link: DynamicsModel, name: str
) -> None:
    try:
        robot = psdmc.compile(two_link, functions=FEW, target=name)
    except ToolchainError as refused:
        assert name.startswith("x86-64")
        pytest.skip(str(refused))
    q, qd, qdd = np.random.default_rng(4).normal(size=(3, 19, 2))

    tau = robot.inverse_dynamics(q, qd, qdd)

    np.testing.assert_allclose(tau, two_link.inverse_dynamics(q, qd, qdd), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(robot.forward_dynamics(q, qd, tau), qdd, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("target", [CORTEX_M4F, CORTEX_M7])
def test_python_has_no_use_for_one_state_a_call(two_link: DynamicsModel, target: Target) -> None:
    with pytest.raises(InputError, match=f"target {target.name} has no functions for many states"):
        psdmc.compile(two_link, functions=["gravity"], target=target.name)


def test_a_compiler_that_knows_no_such_target_is_told(two_link: DynamicsModel) -> None:
    other = replace(X86_64_V3, name="other", flags=("-march=z80",))
    with pytest.raises(ToolchainError, match=r"target other: .* does not take -march=z80"):
        psdmc.compile(two_link, functions=["gravity"], target=other)


@pytest.mark.skipif(not X86, reason="instructions of x86-64")
def test_a_target_that_this_cpu_is_not_is_refused_before_it_runs(two_link: DynamicsModel) -> None:
    """Xeon Phi's AVX-512ER is in no other CPU."""
    need("gcc")
    other = replace(X86_64_V3, name="phi", flags=("-march=x86-64-v3", "-mavx512er"))
    with pytest.raises(ToolchainError, match=r"target phi: this machine's CPU lacks .*AVX512ER"):
        psdmc.compile(two_link, functions=["gravity"], target=other)


def test_the_default_targets_flags_are_those_for_this_machine() -> None:
    compiler = find_compiler()
    assert compiler == find_compiler(NATIVE)
    assert compiler.flags[: len(compiler.portable)] == compiler.portable
    assert compiler.flags[len(compiler.portable) :] in [(flag,) for flag in NATIVE.host_flags] + [()]
    assert find_compiler(SCALAR).flags == compiler.portable


def test_targets_share_lowerings_where_their_costs_are_equal(
    two_link: DynamicsModel, tmp_path: Path, own_cache: Path
) -> None:
    def kept() -> int:
        return len(list(own_cache.glob("*/kernels.json")))

    made = []
    for number, name in enumerate(("native", "x86-64-v4", "x86-64-v3", "cortex-m4f", "cortex-m4f")):
        psdmc.emit_c(two_link, tmp_path / str(number), functions=["gravity"], target=name)
        made.append(kept())

    assert made == [1, 1, 2, 3, 3]
    assert preset("x86-64-v4").costs == COSTS


@pytest.mark.usefixtures("own_cache")
def test_lowering_is_given_the_targets_costs(
    two_link: DynamicsModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Costs] = []

    def recorded(*arguments: Any, costs: Costs = COSTS, **further: Any) -> dict[str, Kernel]:
        given.append(costs)
        return lower(*arguments, costs=costs, **further)

    monkeypatch.setattr(emission, "lower", recorded)
    for name in ("native", "cortex-m4f"):
        psdmc.emit_c(two_link, tmp_path / name, functions=["gravity"], target=name)

    assert given == [COSTS, CORTEX_M4F.costs]


@pytest.mark.parametrize("target", [SCALAR, X86_64_V3], ids=lambda target: target.name)
def test_libraries_are_compiled_with_the_targets_flags(
    two_link: DynamicsModel, target: Target, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    try:
        flags = find_compiler(target).flags
    except ToolchainError as refused:
        pytest.skip(str(refused))
    commands: list[tuple[str, ...]] = []

    def recorded(words: Sequence[str], *more: str) -> str:
        commands.append(tuple(words))
        return compiler_command.run(words, *more)

    monkeypatch.setattr(compile, "run", recorded)
    psdmc.compile(two_link, functions=["gravity"], target=target.name)

    compiled = [words for words in commands if "-c" in words]
    assert compiled
    assert all(set(flags) <= set(words) and "-march=native" not in words for words in compiled)


def test_libraries_of_different_targets_are_kept_apart(two_link: DynamicsModel) -> None:
    libraries = {
        psdmc.compile(two_link, functions=["gravity"], target=target).library
        for target in (NATIVE, SCALAR, replace(SCALAR, name="other", blocks_ahead=3))
    }
    assert len(libraries) == 3


@pytest.mark.parametrize("target", slow_but_for([CORTEX_M4F], [CORTEX_M4F, X86_64_V3]))
def test_a_package_builds_and_tests_itself_on_the_machine_at_hand(
    two_link: DynamicsModel, target: Target, tmp_path: Path
) -> None:
    """With the target's flags where the compiler takes them, without where it does not."""
    psdmc.emit_c(two_link, tmp_path / "arm", functions=FEW, target=target.name)
    try:
        find_compiler(X86_64_V3)
    except ToolchainError as refused:
        if target == X86_64_V3:
            pytest.skip(str(refused))

    assert "0 failed" in build_package(tmp_path / "arm")
    need("make")
    commands = run("make", "-C", tmp_path / "arm", "BUILD=by_make", "check")
    assert "0 failed" in commands
    assert (" ".join(target.flags) in commands) == (target == X86_64_V3 and X86)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize(
    "name", [name for name in PRESETS if name != "native" and (ACCURACY or name in (LOOKED_AT, "cortex-m4f"))]
)
def test_no_targets_c_is_warned_of(name: str, compiler: str, tmp_path: Path) -> None:
    """Without the target's flags: its vectors, too, are right for every machine."""
    need(compiler)
    target = preset(name)
    options = EmitOptions(target.real, target.trig, target)
    package = arm_package(options=options, names=["inverse_dynamics", "forward_dynamics", "regressor"])
    write_sources(package, tmp_path)
    checked = ["-fsyntax-only"] if compiler == "clang" else ["-O1" if name == LOOKED_AT else "-O0", "-c"]
    for source in package.sources:
        words = [*STRICT, *EXTRA, *checked, f"-I{tmp_path}/include", "-o", tmp_path / "x.o"]
        run(compiler, *words, tmp_path / source)


@emulated("cortex-m4f", "cortex-m7")
def test_the_self_test_passes_compiled_for_a_microcontroller(
    robot: str, target: Target, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """The very instructions: linked with newlib, on Linux's system calls. The library alone needs no other."""
    need("arm-none-eabi-gcc", "qemu-arm", "make")
    package = tmp_path / "arm"
    psdmc.emit_c(request.getfixturevalue(robot), package, target=target.name, name="arm")
    made = run("make", "-C", package, "CC=arm-none-eabi-gcc", "AR=arm-none-eabi-ar", "build/libarm.a")
    program = [*target.flags, "-std=c99", "-O2", "-nostartfiles", f"-I{package}/include"]
    sources = [package / "test" / "self_test.c", HERE / "bare_metal.c", package / "build" / "libarm.a"]
    run("arm-none-eabi-gcc", *program, *sources, "-lm", "-o", package / "self_test.elf")

    assert " ".join(target.flags) in made
    assert ", 0 failed" in run("qemu-arm", package / "self_test.elf")
    assert undefined(package / "build" / "libarm.a") == set()


def undefined(library: Path) -> set[str]:
    """Symbols that a library needs of others; its own tables are not."""
    words = [line.split() for line in run("arm-none-eabi-nm", library).splitlines()]
    needed = {line[-1] for line in words if line[-2:-1] == ["U"]}
    return needed - {line[-1] for line in words if len(line) == 3} - {"memcpy", "memset"}


@emulated("neon", "native")
def test_the_self_test_passes_compiled_for_64_bit_arm(
    robot: str, target: Target, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    package = tmp_path / "arm"
    psdmc.emit_c(request.getfixturevalue(robot), package, functions=FUNCTIONS, target=target.name, name="arm")

    made, said = elsewhere("aarch64", package)

    assert " ".join(target.flags) in made
    assert ", 0 failed" in said


@pytest.mark.parametrize("real", ["float64", "float32"] if ACCURACY else ["float64"])
@pytest.mark.parametrize("robot", SHOWN)
def test_the_self_test_passes_on_a_machine_whose_first_byte_is_the_highest(
    robot: str, real: Any, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    package = tmp_path / "arm"
    psdmc.emit_c(request.getfixturevalue(robot), package, functions=FUNCTIONS, real=real, name="arm")

    _, said = elsewhere("s390x", package)

    assert ", 0 failed" in said


def elsewhere(machine: str, package: Path) -> tuple[str, str]:
    """What make and the self-test print, built for another machine and run by qemu."""
    need(f"{machine}-linux-gnu-gcc", f"qemu-{machine}", "make")
    words = [f"CC={machine}-linux-gnu-gcc", f"AR={machine}-linux-gnu-ar", "LDFLAGS=-static"]
    quick = [] if WHOLE else ["CFLAGS=-O1"]
    made = run("make", "-C", package, *words, *quick, "build/self_test")
    said = run(f"qemu-{machine}", package / "build" / "self_test")
    print(f"{machine}: {said.splitlines()[-1]}")
    return made, said
