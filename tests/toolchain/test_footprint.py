"""What a six-joint package takes of a small machine: its source's size, and every call's stack as the compiler says it."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from bundled import bundled_model
from installed import need

from psdmc.compiler import emit_c
from psdmc.toolchain.compiler_command import FLAGS

MOST = 16 * 1024
"""Bytes: what a small real-time thread has to spare."""
MOST_OF_ONE_STATE = 2 * 1024
LARGEST_SOURCE, WITH_DERIVATIVES = 400 * 1024, 640 * 1024
DERIVATIVES = ("inverse_dynamics_derivatives", "forward_dynamics_derivatives")
MOST_OF_DERIVATIVES, MOST_OF_ONE_DERIVATIVE = 19 * 1024, 2560
"""docs/derivatives.md states them: why they are not in the default set."""
TARGETS = {"sse2": "-march=x86-64", "avx512": "-march=x86-64-v4"}
WHOLE = os.environ.get("PSDMC_ACCURACY") == "whole"
whole = pytest.mark.skipif(not WHOLE, reason="make test-accuracy takes it: gcc's time at -O3")
"""`make test` bounds the stack of a smaller arm's calls (test_c_rules.py)."""

PUBLIC = re.compile(r"kr6_((?!sincos_)\w+?)(?:_batch|_batch_soa)?$")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("gcc")
    folder = tmp_path_factory.mktemp("stack") / "kr6"
    emit_c(bundled_model("kr6"), folder)
    return folder


def test_the_library_has_at_most_400_kib_of_source(package: Path) -> None:
    assert source_of(package) <= LARGEST_SOURCE


@pytest.mark.slow
def test_with_derivatives_at_most_640_kib(package: Path, tmp_path: Path) -> None:
    emit_c(bundled_model("kr6"), tmp_path / "kr6", functions=["default", *DERIVATIVES])
    assert source_of(package) < source_of(tmp_path / "kr6") <= WITH_DERIVATIVES


def source_of(package: Path) -> int:
    """Bytes of the library."""
    files = [*(package / "src").iterdir(), package / "include/kr6/kr6.h"]
    return sum(file.stat().st_size for file in files)


@whole
@pytest.mark.parametrize("target", TARGETS)
def test_no_call_takes_more_than_16_kib(target: str, package: Path, tmp_path: Path) -> None:
    deepest = stack_of(package, target, tmp_path)
    assert len(deepest) == 9 * 3 + 6 * 2  # all functions in three forms; with theta_b in two
    assert max(deepest.values()) <= MOST, deepest
    assert _of_one_state(deepest) <= MOST_OF_ONE_STATE, deepest


@whole
@pytest.mark.parametrize("target", TARGETS)
def test_derivatives_take_what_the_documents_say(target: str, tmp_path: Path) -> None:
    need("gcc")
    emit_c(bundled_model("kr6"), tmp_path / "kr6", functions=DERIVATIVES)
    deepest = stack_of(tmp_path / "kr6", target, tmp_path)
    assert len(deepest) == 2 * (3 + 2)
    assert max(deepest.values()) <= MOST_OF_DERIVATIVES, deepest
    assert _of_one_state(deepest) <= MOST_OF_ONE_DERIVATIVE, deepest


def stack_of(package: Path, target: str, folder: Path) -> dict[str, int]:
    """Bytes of each public function; every frame's size is known when it is compiled: no alloca, no variable array."""
    words = ["gcc", "-std=c99", *FLAGS, TARGETS[target], "-fstack-usage", f"-I{package}/include", "-c"]

    def frames(source: Path) -> str:
        made = folder / f"{source.stem}.o"
        subprocess.run([*words, str(source), "-o", str(made)], check=True)
        return made.with_suffix(".su").read_text()

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        sources = sorted((package / "src").glob("*.c"))
        reports = list(pool.map(frames, sources))
    deepest: dict[str, int] = {}
    for source, report in zip(sources, reports, strict=True):
        rows = [line.split("\t") for line in report.splitlines()]
        assert {row[2] for row in rows} <= {"static", "dynamic,bounded"}  # bounded: arguments of a call
        own = {where.rpartition(":")[2]: int(size) for where, size, _ in rows}
        deepest |= _deepest(own, source.read_text())
    return deepest


def _of_one_state(deepest: Mapping[str, int]) -> int:
    return max(size for name, size in deepest.items() if "_batch" not in name)


def _deepest(frames: Mapping[str, int], text: str) -> dict[str, int]:
    """Of each public function: its frame, that of the kernel that it calls unless it was inlined, and the largest of the
    helpers'."""
    kernels = {name: size for name, size in frames.items() if name.endswith(("_lanes", "_rows"))}
    public = {name: size for name, size in frames.items() if PUBLIC.match(name)}
    helpers = max((size for name, size in frames.items() if name not in kernels | public), default=0)
    found = {}
    for name, size in public.items():
        kernel = PUBLIC.match(name)[1]  # type: ignore[index]
        by_row = name.endswith("_batch") and f" {kernel}_rows(" in text
        inner = kernels.get(f"{kernel}_{'rows' if by_row else 'lanes'}", 0)
        found[name] = size + helpers + (inner if "_batch" in name else 0)
    return found
