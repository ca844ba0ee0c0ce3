"""What a six-joint package takes of a small machine: its source's size, and every call's stack as the compiler says it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from bundled import bundled_model

from psdmc.compiler import emit_c
from psdmc.toolchain.compiler_command import FLAGS

MOST = 16 * 1024
"""Bytes: what a small real-time thread has to spare."""
MOST_OF_ONE_STATE = 2 * 1024
LARGEST_SOURCE, WITH_DERIVATIVES = 400 * 1024, 640 * 1024
DERIVATIVES = ("inverse_dynamics_derivatives", "forward_dynamics_derivatives")
TARGETS = {"sse2": "-march=x86-64", "avx512": "-march=x86-64-v4"}

PUBLIC = re.compile(r"kr6_((?!sincos_)\w+?)(?:_batch|_batch_soa)?$")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    folder = tmp_path_factory.mktemp("stack") / "kr6"
    emit_c(bundled_model("kr6"), folder)
    return folder


def test_the_library_has_at_most_400_kib_of_source(package: Path) -> None:
    assert source_of(package) <= LARGEST_SOURCE


def test_with_derivatives_at_most_640_kib(package: Path, tmp_path: Path) -> None:
    emit_c(bundled_model("kr6"), tmp_path / "kr6", functions=["default", *DERIVATIVES])
    assert source_of(package) < source_of(tmp_path / "kr6") <= WITH_DERIVATIVES


def source_of(package: Path) -> int:
    """Bytes of the library."""
    files = [*(package / "src").iterdir(), package / "include/kr6/kr6.h"]
    return sum(file.stat().st_size for file in files)


@pytest.mark.parametrize("target", TARGETS)
def test_no_call_takes_more_than_16_kib(target: str, package: Path, tmp_path: Path) -> None:
    sources = sorted((package / "src").glob("*.c"))
    words = ["gcc", "-std=c99", *FLAGS, TARGETS[target], "-fstack-usage", f"-I{package}/include", "-c"]

    def frames(source: Path) -> str:
        made = tmp_path / f"{source.stem}.o"
        subprocess.run([*words, str(source), "-o", str(made)], check=True)
        return made.with_suffix(".su").read_text()

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        reports = list(pool.map(frames, sources))
    deepest: dict[str, int] = {}
    for report in reports:
        rows = [line.split("\t") for line in report.splitlines()]
        assert all(row[2] == "static" for row in rows)  # known when compiled: no alloca, no variable array
        deepest |= _deepest({where.rpartition(":")[2]: int(size) for where, size, _ in rows})
    assert len(deepest) == 9 * 3 + 6 * 2  # all functions in three forms; with theta_b in two
    assert max(deepest.values()) <= MOST, deepest
    assert max(size for name, size in deepest.items() if "_batch" not in name) <= MOST_OF_ONE_STATE, deepest


def _deepest(frames: Mapping[str, int]) -> dict[str, int]:
    """Of each public function: its frame, its kernel's unless that was inlined, and the largest of the helpers'."""
    kernels = {name: size for name, size in frames.items() if name.endswith(("_lanes", "_rows"))}
    public = {name: size for name, size in frames.items() if PUBLIC.match(name)}
    helpers = max((size for name, size in frames.items() if name not in kernels | public), default=0)
    found = {}
    for name, size in public.items():
        kernel = PUBLIC.match(name)[1]  # type: ignore[index]
        inner = max(kernels.get(f"{kernel}_lanes", 0), kernels.get(f"{kernel}_rows", 0))
        found[name] = size + helpers + (inner if "_batch" in name else 0)
    return found
