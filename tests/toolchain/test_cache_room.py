"""The cache stays small and tidy: old entries and what killed builds left go, nothing else does."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from psdmc.errors import InputError
from psdmc.toolchain import cache_room
from psdmc.toolchain.cache import cached
from psdmc.toolchain.cache_room import cache_contents, cache_limit, clear_cache


def entry(letter: str, size: int = 1000, hours_ago: float = 0.0) -> Path:
    folder = cached(letter * 64, lambda own: (own / "library.so").write_bytes(b"x" * size) and None)
    then = time.time() - 3600 * hours_ago
    os.utime(folder / "entry.json", (then, then))
    return folder


def letters(own_cache: Path) -> str:
    return "".join(sorted(path.name[0] for path in own_cache.iterdir()))


def test_the_least_recently_used_go_first(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSDMC_CACHE_SIZE", "2500")
    for letter, age in (("a", 3), ("b", 2)):
        entry(letter, hours_ago=age)
    cached("a" * 64, lambda own: pytest.fail("a is there"))  # used now: b is the oldest
    entry("c")
    assert letters(own_cache) == "ac"


def test_what_was_just_used_stays_beyond_the_limit(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process may be about to open it."""
    monkeypatch.setenv("PSDMC_CACHE_SIZE", "1")
    for letter in "abc":
        entry(letter)
    assert letters(own_cache) == "abc"


@pytest.mark.parametrize("removing", ["making room", "clearing"])
def test_entries_that_another_process_removes_meanwhile(
    removing: str, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It had the lock between the listing of entries and their removal."""
    for letter, age in (("a", 3), ("b", 2)):
        entry(letter, hours_ago=age)
    held = cache_room.hold

    @contextmanager
    def hold_after_another(place: Path) -> Iterator[None]:
        shutil.rmtree(own_cache / ("a" * 64), ignore_errors=True)
        with held(place):
            yield

    monkeypatch.setattr(cache_room, "hold", hold_after_another)
    if removing == "clearing":
        clear_cache()
        assert letters(own_cache) == ""
        return
    monkeypatch.setenv("PSDMC_CACHE_SIZE", "1500")
    assert (entry("c") / "library.so").is_file()
    assert letters(own_cache) == "c"


def test_an_entry_larger_than_the_limit_is_served(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSDMC_CACHE_SIZE", "500")
    entry("a", hours_ago=1)
    assert (entry("b") / "library.so").is_file()
    assert letters(own_cache) == "b"


@pytest.mark.parametrize(("text", "size"), [("100", 100), ("2k", 2048), ("3M", 3 << 20), ("1G", 1 << 30)])
def test_the_size_in_bytes_or_with_a_unit(text: str, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSDMC_CACHE_SIZE", text)
    assert cache_limit() == size


@pytest.mark.parametrize("text", ["much", "-1", "1.5G", "10 MB", "٣"])
def test_a_size_that_is_none(text: str, monkeypatch: pytest.MonkeyPatch, own_cache: Path) -> None:
    monkeypatch.setenv("PSDMC_CACHE_SIZE", text)
    with pytest.raises(InputError, match="PSDMC_CACHE_SIZE is") as caught:
        entry("a")
    assert "500M" in str(caught.value.hint)


KILLED = """
import os, signal, sys
from psdmc.toolchain import cache_room
from psdmc.toolchain.cache import cached

def build(folder):
    (folder / "half").write_text("x")
    os.kill(os.getpid(), signal.SIGKILL)

cached("k" * 64, build)
"""


def test_what_a_killed_build_left_goes_with_the_next(own_cache: Path) -> None:
    subprocess.run([sys.executable, "-c", KILLED], check=False)
    left = sorted(path.name[:6] for path in own_cache.iterdir())
    assert left == [".build", ".turn-"], "the test wants a leftover"

    entry("a")
    assert letters(own_cache) == "a"


def test_a_build_under_way_stays(own_cache: Path) -> None:
    def outer(folder: Path) -> None:
        entry("b")
        assert folder.is_dir(), "another build took it for a dead one"
        (folder / "x").write_text("")

    cached("a" * 64, outer)
    assert letters(own_cache) == "ab"


def test_contents_and_clearing(own_cache: Path) -> None:
    assert (cache_contents().entries, cache_contents().size) == (0, 0)
    entry("a")
    entry("b", size=500)
    (own_cache / "mine.txt").write_text("keep")
    (own_cache / ".gone-0123456789abcdef").mkdir()

    assert (cache_contents().entries, cache_contents().size) == (2, 1500)
    assert clear_cache() == 2
    assert [path.name for path in own_cache.iterdir()] == ["mine.txt"]
    assert cache_contents().entries == 0
