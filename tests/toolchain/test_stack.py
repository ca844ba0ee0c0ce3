"""Stack of every call of a six-joint package, as the compiler reports it."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from bundled import bundled_model

from psdmc.compiler import emit_c
from psdmc.toolchain.compiler_command import FLAGS

MOST = 16 * 1024
"""Bytes: what a small real-time thread has to spare."""
TARGETS = {"sse2": "-march=x86-64", "avx512": "-march=x86-64-v4"}


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    folder = tmp_path_factory.mktemp("stack") / "kr6"
    emit_c(bundled_model("kr6"), folder)
    return folder


@pytest.mark.parametrize("target", TARGETS)
def test_no_call_takes_more_than_16_kib(target: str, package: Path, tmp_path: Path) -> None:
    """A public function's frame, and the largest private one in its file: no call goes deeper."""
    sources = sorted((package / "src").glob("*.c"))
    words = ["gcc", "-std=c99", *FLAGS, TARGETS[target], "-fstack-usage", f"-I{package}/include", "-c"]

    def frames(source: Path) -> str:
        made = tmp_path / f"{source.stem}.o"
        subprocess.run([*words, str(source), "-o", str(made)], check=True)
        return made.with_suffix(".su").read_text()

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        reports = list(pool.map(frames, sources))
    deepest: dict[str, int] = defaultdict(int)
    for source, report in zip(sources, reports, strict=True):
        rows = [line.split("\t") for line in report.splitlines()]
        assert {kind for _, _, kind in rows} <= {
            "static"
        }  # known when compiled: no alloca, no variable array
        sizes = {where.rpartition(":")[2]: int(size) for where, size, _ in rows}
        inner = max((size for name, size in sizes.items() if not name.startswith("kr6_")), default=0)
        outer = max((size for name, size in sizes.items() if name.startswith("kr6_")), default=0)
        deepest[source.stem] = outer + inner
    assert len(deepest) >= 10
    assert max(deepest.values()) <= MOST, dict(deepest)
