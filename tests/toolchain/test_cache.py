"""The compile cache: found again, never mixed up, safe to race for."""

from __future__ import annotations

import multiprocessing
import multiprocessing.process
import os
import shutil
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from racing import race
from traced import arm_package
from unoptimised import without_optimisation

from psdmc.errors import ToolchainError
from psdmc.toolchain import cache
from psdmc.toolchain.cache import cache_key, cached
from psdmc.toolchain.cache_room import cache_directory
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.compile import compile_library
from psdmc.toolchain.compiler_command import find_compiler
from psdmc.toolchain.interface import interface_of


@pytest.fixture
def fresh_cache(own_cache: Path) -> Iterator[Path]:
    with without_optimisation():
        yield own_cache


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
    assert len((tmp_path / "log-builds").read_text().split()) == 1, "the others wait"


def written(folder: Path) -> None:
    (folder / "who").write_text("anybody")


def test_threads_that_race_build_once(fresh_cache: Path) -> None:
    built: list[Path] = []

    def build(folder: Path) -> None:
        built.append(folder)
        time.sleep(0.1)
        (folder / "who").write_text("one")

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: cached("t" * 64, build), range(4)))
    assert len(built) == 1
    assert found == [fresh_cache / ("t" * 64)] * 4


def test_a_turn_is_of_the_file_that_others_find(fresh_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lock file that is removed as a leftover before it is locked keeps nobody out: another one is taken."""
    fresh_cache.mkdir(exist_ok=True)
    path, locks = fresh_cache / f".turn-{'u' * 16}", cache.lock

    def swept(handle: int, wait: bool = True) -> bool:
        monkeypatch.setattr(cache, "lock", locks)
        path.unlink()
        return locks(handle, wait)

    monkeypatch.setattr(cache, "lock", swept)
    with cache.turn(fresh_cache, "u" * 64):
        other = os.open(path, os.O_RDWR)
        assert not locks(other, wait=False)
        os.close(other)


def test_after_a_build_that_failed_the_next_one_builds(fresh_cache: Path) -> None:
    tries: list[Path] = []

    def build(folder: Path) -> None:
        tries.append(folder)
        time.sleep(0.05)
        if len(tries) == 1:
            raise ToolchainError("no")
        (folder / "who").write_text("two")

    with ThreadPoolExecutor(2) as pool:
        both = [pool.submit(cached, "f" * 64, build) for _ in range(2)]
    assert sorted(type(each.exception()).__name__ for each in both) == ["NoneType", "ToolchainError"]
    assert [path.name for path in fresh_cache.iterdir()] == ["f" * 64]


def test_nobody_waits_for_a_process_that_was_forked_during_a_build(fresh_cache: Path) -> None:
    """It has a copy of the lock's handle and lives on."""
    context = multiprocessing.get_context("fork")
    idle = context.Event()

    def build(folder: Path) -> None:
        child = context.Process(target=idle.wait, daemon=True)
        child.start()
        children.append(child)
        (folder / "who").write_text("one")

    children: list[multiprocessing.process.BaseProcess] = []
    try:
        cached("a" * 64, build)
        shutil.rmtree(fresh_cache / ("a" * 64))
        begin = time.monotonic()
        cached("a" * 64, written)
        assert time.monotonic() - begin < 5.0
    finally:
        idle.set()
        for child in children:
            child.join(10)


def test_a_turn_that_a_killed_process_left_is_swept(fresh_cache: Path) -> None:
    fresh_cache.mkdir(mode=0o700, exist_ok=True)
    (fresh_cache / f".turn-{'b' * 16}").touch()
    cached("c" * 64, written)
    assert [path.name for path in fresh_cache.iterdir()] == ["c" * 64]


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


def damage_by_truncation(library: Path) -> None:
    library.write_bytes(library.read_bytes()[:5000])


def damage_by_flipping(library: Path) -> None:
    data = bytearray(library.read_bytes())
    data[len(data) // 2] ^= 0xFF
    library.write_bytes(bytes(data))


def damage_by_emptying(library: Path) -> None:
    library.write_bytes(b"")


def damage_by_removal(library: Path) -> None:
    library.unlink()


def damage_by_replacing_with_a_link(library: Path) -> None:
    library.rename(library.parent / "elsewhere.so")
    library.symlink_to("elsewhere.so")


def damage_to_the_seal(library: Path) -> None:
    (library.parent / "entry.json").write_text('{"files": [1]}')


def damage_by_forging_the_seal(library: Path) -> None:
    (library.parent / "entry.json").write_text('{"files": {"../../../etc/hostname": "0"}, "bytes": 0}')


@pytest.mark.parametrize(
    "damage",
    [
        damage_by_truncation,
        damage_by_flipping,
        damage_by_emptying,
        damage_by_removal,
        damage_by_replacing_with_a_link,
        damage_to_the_seal,
        damage_by_forging_the_seal,
    ],
)
def test_a_damaged_entry_is_built_again(
    damage: Callable[[Path], None], fresh_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PSDMC_DIRECT_CALLS", "0")  # whose extension is another entry
    package = arm_package(names=["gravity"])
    library = compile_library(package)
    sound = library.read_bytes()
    damage(library)

    assert compile_library(package) == library
    assert library.read_bytes() == sound
    assert not library.is_symlink()
    assert CompiledRobot(interface_of(package), library).gravity([0.1, 0.2, 0.3, 0.4]).shape == (4,)
    assert [path.name for path in fresh_cache.iterdir()] == [library.parent.name]


def test_a_compiler_that_makes_nothing_leaves_no_entry(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """`true` succeeds at everything; so does a program that knows a compiler's macros and writes no file."""
    lazy = tmp_path / "lazy"
    lazy.write_text("#!/bin/sh\necho '#define __STDC__ 1'\n")
    lazy.chmod(0o755)
    package = arm_package(names=["gravity"])
    for command, complaint in (("true", "is no C compiler"), (str(lazy), "made no library.so")):
        monkeypatch.setenv("CC", command)
        with pytest.raises(ToolchainError, match=complaint):
            compile_library(package)
        assert not fresh_cache.exists() or list(fresh_cache.iterdir()) == []
    monkeypatch.delenv("CC")
    assert compile_library(package).stat().st_size > 0


def test_a_library_for_another_machine_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "library.so").write_bytes(b"\x7fELF" + bytes(200))
    with pytest.raises(ToolchainError, match="cannot be loaded") as caught:
        CompiledRobot(interface_of(arm_package(names=["gravity"])), tmp_path / "library.so")
    assert "CC" in str(caught.value.hint)


@pytest.mark.parametrize(
    ("command", "complaint"),
    [("gcc '", "is no command: No closing quotation"), ("./no-such-cc", "was not found")],
)
def test_a_cc_that_is_no_command(command: str, complaint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", command)
    with pytest.raises(ToolchainError, match=complaint) as caught:
        find_compiler()
    assert "\n" not in caught.value.message


def test_cc_may_have_options_and_spaces(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Also as a path from here: the compiler runs in a folder of its own."""
    folder = tmp_path / "my tools"
    folder.mkdir()
    (folder / "cc").write_text('#!/bin/sh\nexec gcc "$@"\n')
    (folder / "cc").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CC", "'my tools/cc' -DUNUSED -O2")
    assert compile_library(arm_package(names=["gravity"])).is_file()


def test_a_compiler_that_is_killed_says_so(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    dying = tmp_path / "dying"
    dying.write_text('#!/bin/sh\ncase "$*" in *-shared*) kill -9 $$;; esac\nexec gcc "$@"\n')
    dying.chmod(0o755)
    monkeypatch.setenv("CC", str(dying))
    with pytest.raises(ToolchainError, match="was killed by SIGKILL"):
        compile_library(arm_package(names=["gravity"]))
    assert list(fresh_cache.iterdir()) == []


def test_a_failing_source_stops_the_others(
    fresh_cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    failing = tmp_path / "failing"
    failing.write_text(
        f'#!/bin/sh\ncase "$*" in *"-c src"*) echo x >> {log}; sleep 0.2; exit 1;; esac\nexec gcc "$@"\n'
    )
    failing.chmod(0o755)
    monkeypatch.setenv("CC", str(failing))
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    package = arm_package()
    with pytest.raises(ToolchainError, match="failed with status 1"):
        compile_library(package)
    assert len(log.read_text().split()) < len(package.sources)
