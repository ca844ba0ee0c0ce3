"""Whose libraries run: never those of a folder or an entry that somebody else owns or may write."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path

import pytest

from psdmc.errors import ToolchainError
from psdmc.toolchain.cache import cached
from psdmc.toolchain.cache_room import cache_directory

KEY = "a" * 64
NOBODY = 65534

as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")


def build(folder: Path) -> None:
    (folder / "library.so").write_text("ours")


def plant(own_cache: Path) -> Path:
    """A whole entry as psdmc makes it, with another's library inside."""

    def theirs(folder: Path) -> None:
        (folder / "library.so").write_text("theirs")

    return cached(KEY, theirs, ["library.so"])


def found() -> str:
    return (cached(KEY, build, ["library.so"]) / "library.so").read_text()


def test_the_folder_is_made_for_this_user_alone(own_cache: Path) -> None:
    assert found() == "ours"
    assert stat.S_IMODE(own_cache.stat().st_mode) == 0o700
    for path in own_cache.rglob("*"):
        assert not path.stat().st_mode & 0o022, path


def test_an_entry_is_for_this_user_alone_under_any_umask(own_cache: Path) -> None:
    before = os.umask(0)
    try:
        assert found() == "ours"
    finally:
        os.umask(before)
    written = list(own_cache.rglob("*"))
    assert "library.so" in [path.name for path in written]
    for path in (own_cache, *written):
        assert not path.stat().st_mode & 0o022, path


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o770, 0o702])
def test_a_folder_that_others_may_write_is_refused(mode: int, own_cache: Path) -> None:
    plant(own_cache)
    own_cache.chmod(mode)
    with pytest.raises(ToolchainError, match="may be written by other users") as caught:
        found()
    assert "chmod go-w" in str(caught.value.hint)
    own_cache.chmod(0o700)
    assert found() == "theirs", "the entry was as psdmc makes them: only the folder's mode was in the way"


@as_root
def test_a_folder_of_another_user_is_refused(own_cache: Path) -> None:
    plant(own_cache)
    os.chown(own_cache, NOBODY, NOBODY)
    with pytest.raises(ToolchainError, match="belongs to user 65534"):
        found()


def test_a_folder_below_one_that_everybody_may_write_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path / "open" / "cache"))
    with pytest.raises(ToolchainError, match=r"everybody may rename folders in .*/open"):
        found()


@as_root
@pytest.mark.parametrize("part", ["", "library.so", "entry.json"])
def test_an_entry_of_another_user_is_replaced(part: str, own_cache: Path) -> None:
    os.chown(plant(own_cache) / part, NOBODY, NOBODY)
    assert found() == "ours"
    assert (own_cache / KEY / part).stat().st_uid == 0


@pytest.mark.parametrize("part", ["", "library.so", "entry.json"])
def test_an_entry_that_others_may_write_is_replaced(part: str, own_cache: Path) -> None:
    (plant(own_cache) / part).chmod(0o777)
    assert found() == "ours"


@pytest.mark.parametrize("part", ["", "library.so", "entry.json"])
def test_a_link_to_another_entry_is_replaced(part: str, own_cache: Path, tmp_path: Path) -> None:
    entry = plant(own_cache)
    elsewhere = tmp_path / "elsewhere"
    (entry / part).rename(elsewhere)
    (entry / part).symlink_to(elsewhere)

    assert found() == "ours"
    assert elsewhere.exists(), "psdmc deleted through a link"


@pytest.mark.parametrize("named", ["../library.so", "here/../../library.so", "absolute"])
def test_an_entry_whose_seal_names_files_elsewhere_is_replaced(named: str, own_cache: Path) -> None:
    """With their right digests, so that nothing but the name is wrong."""
    entry = plant(own_cache)
    (entry / "here").mkdir(mode=0o700)
    outside = own_cache / "library.so"
    (entry / "library.so").rename(outside)
    seal = json.loads((entry / "entry.json").read_text())
    name = str(outside) if named == "absolute" else named
    seal["files"] = {name: seal["files"]["library.so"]}
    (entry / "entry.json").write_text(json.dumps(seal))

    assert found() == "ours"
    assert outside.read_text() == "theirs"


def test_a_file_where_an_entry_belongs_is_replaced(own_cache: Path) -> None:
    own_cache.mkdir(mode=0o700)
    (own_cache / KEY).write_text("no folder")
    assert found() == "ours"


def test_the_folder_itself_may_be_reached_by_a_link(
    tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(own_cache)
    (tmp_path / "link").symlink_to(own_cache)
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path / "link"))
    assert found() == "theirs"


def test_no_home_is_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PSDMC_CACHE_DIR")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def unknown() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", unknown)
    with pytest.raises(ToolchainError, match="HOME is not set") as caught:
        cache_directory()
    assert "PSDMC_CACHE_DIR" in str(caught.value.hint)


@pytest.mark.parametrize("home", ["", "relative"])
def test_a_home_that_is_no_folder_of_the_machine(home: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PSDMC_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/cache")
    monkeypatch.setenv("HOME", home)
    with pytest.raises(ToolchainError, match="HOME is not set"):
        cache_directory()


def test_a_relative_folder_is_made_absolute(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PSDMC_CACHE_DIR", "here")
    assert cache_directory() == tmp_path / "here"


def test_a_read_only_cache_serves_what_it_has(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may write anywhere, so that the refusal is played: as the system calls of a read-only disk."""
    plant(own_cache)

    def read_only(*given: object, **named: object) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("os.mkdir", read_only)
    monkeypatch.setattr("os.utime", read_only)
    monkeypatch.setattr(Path, "mkdir", lambda self, *a, **k: None if self.is_dir() else read_only())
    assert found() == "theirs"
    with pytest.raises(ToolchainError, match="cannot write to the compile cache: Read-only") as caught:
        cached("b" * 64, build)
    assert "PSDMC_CACHE_DIR" in str(caught.value.hint)


def test_a_full_disk_leaves_no_entry(own_cache: Path) -> None:
    def full(folder: Path) -> None:
        (folder / "half").write_text("x")
        raise OSError(28, "No space left on device")

    with pytest.raises(ToolchainError, match="compile cache: No space left on device"):
        cached(KEY, full)
    assert list(own_cache.iterdir()) == []
    assert found() == "ours"
