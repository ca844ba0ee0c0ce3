"""Files whole or not at all: full disks, killed writers, modes, links and devices."""

from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from full_disk import files_of_at_most

from psdmc.errors import InputError, ToolchainError
from psdmc.files import check_place, remove_leftovers, whole_file, write_together, write_whole

TOO_LITTLE = 10_000


@pytest.fixture
def umask():
    """umask(mask): the process's, until the test ends."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_text_and_bytes_arrive(tmp_path: Path):
    write_whole(tmp_path / "text", "ä\n")
    write_whole(tmp_path / "bytes", b"\x00\r\n")

    assert (tmp_path / "text").read_bytes() == "ä\n".encode()
    assert (tmp_path / "bytes").read_bytes() == b"\x00\r\n"
    assert names(tmp_path) == ["bytes", "text"]


@pytest.mark.parametrize(("mask", "expected"), [(0o077, 0o600), (0o022, 0o644), (0o002, 0o664)])
def test_a_new_files_mode_is_the_umasks(mask: int, expected: int, tmp_path: Path, umask):
    umask(mask)
    write_whole(tmp_path / "new", "x")
    assert mode(tmp_path / "new") == expected


def test_an_existing_files_mode_stays(tmp_path: Path):
    (tmp_path / "secret").write_text("old")
    (tmp_path / "secret").chmod(0o600)
    write_whole(tmp_path / "secret", "new")
    assert mode(tmp_path / "secret") == 0o600


def test_a_link_stays_one(tmp_path: Path):
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    reader = subprocess.Popen(["cat", str(tmp_path / "pipe")], stdout=subprocess.PIPE)
    write_whole(tmp_path / "pipe", "through")
    assert reader.communicate(timeout=20)[0] == b"through"
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_full_device_is_the_machines_fault():
    with pytest.raises(ToolchainError, match="/dev/full: cannot be written: No space left"):
        write_whole("/dev/full", "x" * 100_000)
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@pytest.mark.parametrize("place", ["absent/file", "file/below", "folder"])
def test_a_wrong_place_is_the_inputs_fault(place: str, tmp_path: Path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    for refuse in (check_place, lambda path: write_whole(path, "x")):
        with pytest.raises(InputError, match="cannot be written") as caught:
            refuse(tmp_path / place)
        assert "\n" not in caught.value.message
    assert names(tmp_path) == ["file", "folder"]


def test_a_full_disk_leaves_the_old_file(tmp_path: Path):
    write_whole(tmp_path / "file", "old")
    with pytest.raises(ToolchainError, match="File too large") as caught, files_of_at_most(TOO_LITTLE):
        write_whole(tmp_path / "file", "x" * 20_000)
    assert "room" in str(caught.value.hint)
    assert (tmp_path / "file").read_text() == "old"
    assert names(tmp_path) == ["file"]


def test_files_that_belong_together_are_all_old_or_all_new(tmp_path: Path):
    write_together(tmp_path, {"a": "old", "sub/b": "old"})
    with pytest.raises(ToolchainError), files_of_at_most(TOO_LITTLE):
        write_together(tmp_path, {"a": "new", "sub/b": "x" * 20_000})
    assert [(tmp_path / name).read_text() for name in ("a", "sub/b")] == ["old", "old"]
    assert names(tmp_path) == ["a", "sub"]
    assert names(tmp_path / "sub") == ["b"]


def test_an_error_of_the_writer_leaves_the_old_file(tmp_path: Path):
    write_whole(tmp_path / "file", "old")

    def fail_half_way() -> None:
        with whole_file(tmp_path / "file") as own:
            own.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert (tmp_path / "file").read_text() == "old"
    assert names(tmp_path) == ["file"]


KILLED = """
import os, signal, sys
from psdmc.files import whole_file
with whole_file(sys.argv[1]) as own:
    own.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_writer_left_goes_with_the_next(tmp_path: Path):
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "file")], check=False)
    assert len(names(tmp_path)) == 1, "the test wants a leftover"
    assert names(tmp_path) != ["file"]

    write_whole(tmp_path / "other", "x")
    assert names(tmp_path) == ["other"]


def test_a_living_writers_file_and_foreign_ones_stay(tmp_path: Path):
    foreign = tmp_path / ".psdmc-notes.part"
    foreign.write_text("mine")
    (tmp_path / f".psdmc-{'0' * 16}.part").symlink_to(foreign)
    with whole_file(tmp_path / "file") as own:
        own.write_text("x")
        remove_leftovers(tmp_path)
        assert own.exists()
    assert foreign.read_text() == "mine"
    assert (tmp_path / f".psdmc-{'0' * 16}.part").is_symlink()


def test_a_temporary_file_taken_for_a_leftover_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Somebody tidies between the file's making and its locking."""
    from psdmc import files

    first = [True]
    lock = files.lock

    def late(handle: int, wait: bool = True) -> bool:
        if wait and first:
            first.clear()
            remove_leftovers(tmp_path)
        return lock(handle, wait)

    monkeypatch.setattr(files, "lock", late)
    write_whole(tmp_path / "file", "x")
    assert (tmp_path / "file").read_text() == "x"
    assert names(tmp_path) == ["file"]


def test_a_rename_that_fails_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(source: object, target: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(source), None, str(target))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(ToolchainError, match="file: cannot be written: No space left on device"):
        write_whole(tmp_path / "file", "x")
    assert names(tmp_path) == []
