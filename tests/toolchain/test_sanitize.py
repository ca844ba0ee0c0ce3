"""The short form of `make test-sanitize`: each kind of tool once, and that it would have seen a fault."""

from __future__ import annotations

from pathlib import Path

import pytest
import sanitizers
from odd_package import odd_package
from sanitizers import DYNAMIC, STATIC, Outcome, Tool, look
from slow_cases import slow_but_for
from traced import arm_package

from psdmc.backends.c.package import PackageView
from psdmc.backends.info import EmitOptions

NAMES = ["inverse_dynamics", "forward_dynamics", "jacobian"]
"""Torques with parameters, pivots, a matrix written straight into rows."""


def arm(options: EmitOptions) -> PackageView:
    return arm_package(options=options, names=NAMES)


def torques(options: EmitOptions) -> PackageView:
    return arm_package(options=options, names=["inverse_dynamics"])


def accelerations(options: EmitOptions) -> PackageView:
    return arm_package(options=options, names=["forward_dynamics"])


def odd(options: EmitOptions) -> PackageView:
    """Several outputs, some written straight into rows, an input longer than q, and pivots."""
    return odd_package(options.real, trig=options.trig)


SHORT = {
    "ASan and UBSan, gcc -O0, widest vectors": ("float64", "inline", odd),
    "ASan and UBSan, gcc -O0, no vectors": ("float32", "freestanding", arm),
    "TSan, gcc -O1, widest vectors": ("float64", "libm", arm),
    "memcheck, gcc -O2, AVX2": ("float32", "inline", odd),
    "guard pages, gcc -O3, SSE2": ("float64", "inline", accelerations),
    "guard pages, clang -O3, widest vectors": ("float32", "libm", odd),
    "gcc -fanalyzer": ("float64", "inline", torques),
    "gcc, all warnings": ("float64", "freestanding", arm),
    "clang, all warnings": ("float32", "inline", arm),
    "clang-tidy": ("float64", "inline", torques),
}
QUICK = ("ASan and UBSan, gcc -O0, widest vectors", "guard pages, gcc -O3, SSE2")
"""Tools that `make test` takes; the others' are `make test-slow`'s."""
TOOLS = {tool.name: tool for tool in (*DYNAMIC, *STATIC)}


def _looked(tool: Tool, package: PackageView, folder: Path) -> Outcome:
    outcome = look(tool, package, folder)
    if outcome.missing:
        pytest.skip(f"{outcome.missing} is not installed")
    return outcome


@pytest.mark.parametrize("name", slow_but_for(QUICK, SHORT))
def test_nothing_is_found(name: str, tmp_path: Path) -> None:
    real, trig, package = SHORT[name]
    outcome = _looked(TOOLS[name], package(EmitOptions(real, trig)), tmp_path)
    assert outcome.findings == ""
    assert outcome.calls > 500 or TOOLS[name].is_static


FAULTS = {
    "reads beyond the last row": (
        "src/rows.h",
        "(lane < count ? lane : count - 1) * n",
        "(lane < count ? lane : count) * n",
        torques,
        ("guard pages, gcc -O3, SSE2", "ASan and UBSan, gcc -O0, widest vectors"),
    ),
    "writes beyond the last row": (
        "src/rows.h",
        "for (size_t lane = 0; lane < count; lane++)",
        "for (size_t lane = 0; lane <= count; lane++)",
        odd,
        ("guard pages, gcc -O3, SSE2", "memcheck, gcc -O2, AVX2"),
    ),
    "keeps a state between calls": (
        "src/pivots.h",
        "    int bad = 0;",
        "    static int bad; bad = 0;",
        accelerations,
        ("TSan, gcc -O1, widest vectors",),
    ),
    "spoils the row behind one that fails": (
        "src/pivots.h",
        "spoil(width, rows + lane * width)",
        "spoil(width, rows + (lane + 1) * width)",
        odd,
        ("guard pages, gcc -O3, SSE2",),
    ),
}
"""File, right and wrong text, a package that has both, and the tools that must see it."""


SEEN = [(fault, tool) for fault, row in FAULTS.items() for tool in row[4]]
SEEN_QUICKLY = [("reads beyond the last row", QUICK[0]), ("writes beyond the last row", QUICK[1])]


@pytest.mark.parametrize(("fault", "tool"), slow_but_for(SEEN_QUICKLY, SEEN, spread=True))
def test_a_fault_is_seen(fault: str, tool: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, right, wrong, package, _ = FAULTS[fault]
    write = sanitizers.write_sources

    def spoilt(package: object, folder: Path) -> Path:
        write(package, folder)  # type: ignore[arg-type]
        text = (folder / path).read_text()
        assert right in text
        (folder / path).write_text(text.replace(right, wrong))
        return folder

    monkeypatch.setattr(sanitizers, "write_sources", spoilt)
    assert _looked(TOOLS[tool], package(EmitOptions()), tmp_path).findings != ""
