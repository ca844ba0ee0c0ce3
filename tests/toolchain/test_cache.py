"""The compile cache: found again, never mixed up, safe to race for."""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path

import pytest
from racing import race
from traced import arm_package

from psdmc.errors import ToolchainError
from psdmc.toolchain.cache import cache_directory, cache_key, cached
from psdmc.toolchain.compile import compile_library
from psdmc.toolchain.compiler_command import find_compiler


@pytest.fixture
def fresh_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_the_same_package_is_compiled_once(fresh_cache: Path) -> None:
    package = arm_package(names=["gravity"])
    first = compile_library(package)
    stamp = first.stat().st_mtime_ns

    assert compile_library(package) == first
    assert first.stat().st_mtime_ns == stamp
    assert [path.name for path in fresh_cache.iterdir()] == [first.parent.name], (
        "temporary folders stay behind"
    )


def test_every_part_of_the_key_counts() -> None:
    base = cache_key({"a.c": "int x;"}, ["gcc", "12"])
    others = [
        cache_key({"a.c": "int y;"}, ["gcc", "12"]),
        cache_key({"b.c": "int x;"}, ["gcc", "12"]),
        cache_key({"a.c": "int x;"}, ["gcc", "13"]),
        cache_key({"a.c": "int x;"}, ["gcc1", "2"]),
        cache_key({"a.c": "int x;", "b.c": ""}, ["gcc", "12"]),
    ]
    assert len({base, *others}) == 6
    assert base == cache_key({"a.c": "int x;"}, ["gcc", "12"])


def test_the_key_sees_the_cpu_that_native_code_is_for() -> None:
    assert "__x86_64__" in find_compiler().target or "__aarch64__" in find_compiler().target
    assert "__OPTIMIZE__" in find_compiler().target


def test_a_failing_build_leaves_nothing_behind(fresh_cache: Path) -> None:
    def fail(folder: Path) -> None:
        (folder / "half").write_text("")
        raise ToolchainError("no")

    with pytest.raises(ToolchainError, match=r"^no$"):
        cached("k" * 64, fail)
    assert list(fresh_cache.iterdir()) == []


def test_processes_that_race_all_get_the_same_result(fresh_cache: Path, tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    barrier, log = context.Barrier(3), tmp_path / "log"
    racers = [context.Process(target=race, args=(barrier, str(log), k)) for k in range(3)]
    for racer in racers:
        racer.start()
    for racer in racers:
        racer.join(60)

    assert [racer.exitcode for racer in racers] == [0] * 3
    winners = log.read_text().split()
    assert len(winners) == 3
    assert len(set(winners)) == 1
    assert [path.name for path in fresh_cache.iterdir()] == ["r" * 64]


def test_a_cache_that_cannot_be_written_is_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path / "file" / "cache"))
    with pytest.raises(ToolchainError, match="cannot write to the compile cache") as caught:
        compile_library(arm_package(names=["gravity"]))
    assert "PSDMC_CACHE_DIR" in str(caught.value.hint)


def test_the_platform_chooses_where_no_variable_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("PSDMC_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")
    assert cache_directory() == tmp_path / "psdmc"


def test_a_missing_compiler_is_one_clear_error(monkeypatch: pytest.MonkeyPatch, fresh_cache: Path) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", os.devnull)
    with pytest.raises(ToolchainError, match="no C compiler found") as caught:
        compile_library(arm_package(names=["gravity"]))
    assert "apt install" in str(caught.value.hint)


def test_a_compiler_that_cc_names_must_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-cc -m64")
    with pytest.raises(ToolchainError, match=r"'no-such-cc -m64' \(from CC\)"):
        find_compiler()


def test_a_compiler_that_fails_says_why(monkeypatch: pytest.MonkeyPatch, fresh_cache: Path) -> None:
    monkeypatch.setenv("CC", "false")
    with pytest.raises(ToolchainError, match="false failed with status 1"):
        compile_library(arm_package(names=["gravity"]))
