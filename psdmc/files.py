"""Writes a file completely or not at all, and reads a file of another program up to a stated size.

psdmc writes and reads all its files with these functions. It writes a file under a temporary name in the folder of the
file, flushes it to disk, and renames it. A reader sees the old content or the new, even if the writing is interrupted.
A process that is killed leaves its temporary file. The next process that writes into the folder recognises that file by
its name and its released lock, and removes it.

A device or a pipe may never end, and a file may grow while psdmc reads it. So psdmc counts the bytes that it reads
itself and does not rely on the size that the operating system states.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import stat
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from psdmc.errors import InputError, PsdmcError, ToolchainError

if sys.platform != "win32":
    import fcntl

_TEMPORARY = re.compile(r"\.psdmc-[0-9a-f]{16}\.part(\.[a-z]{1,8})?")

SHOWN = 3
"""Names that a message lists of a folder's."""

HEAD = 1 << 20
"""Bytes of a file in which psdmc looks for its own mark."""

PIECE = 1 << 20
"""Bytes that are asked for at once, so that memory grows with what is there and not with the limit."""

_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENOMEM, errno.EMFILE)
"""Errors of the disk: writing under another name would not help."""


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write `content` to one file. Text is encoded as UTF-8, and its line ends stay as they are.

    An existing file keeps its mode; a new file gets the mode that the umask allows. If `path` is a symbolic link, the
    target of the link is replaced. A path that is no regular file, such as /dev/null, is written to directly. Raises
    InputError if no file can be made at `path`, ToolchainError if the disk fails.
    """
    with whole_file(path) as temporary:
        _fill(temporary, content)


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path for the `with` statement of the caller, who writes one file there. After the statement, the
    temporary file is renamed to `path`; after an error, the temporary file is removed. Raises the same errors as
    write_whole."""
    with system_errors_at(path):
        target = Path(os.path.realpath(path)) if os.path.islink(path) else Path(path)
        if _is_stream(target):
            yield target
            return
        with _temporary(target) as own:
            yield own
            _settle(own, target)
            os.replace(own, target)
            _settle_folder(target.parent)


def write_together(root: Path, files: Mapping[str, str] | Mapping[str, str | bytes]) -> None:
    """Write several files that belong together. `files` maps each path, relative to the folder `root`, to the content
    of that file. The content of all files is on disk before the first file is renamed to its final name. The renames
    follow the order of `files`. If writing fails, folders that were made for the files are removed. Raises the same errors
    as write_whole."""
    with system_errors_at(root), contextlib.ExitStack() as all_of_them:
        ready = []
        for path, text in files.items():
            target = root / path
            for folder in missing_folders(target.parent):
                all_of_them.callback(remove_if_empty, folder)  # it keeps the files that were renamed into it
            target.parent.mkdir(parents=True, exist_ok=True)
            own = all_of_them.enter_context(_temporary(target))
            _fill(own, text)
            _settle(own, target)
            ready.append((own, target))
        for own, target in ready:
            os.replace(own, target)
        for folder in dict.fromkeys(target.parent for _, target in ready):
            _settle_folder(folder)


def make_folder(path: str | os.PathLike[str]) -> None:
    """Make a folder and its missing parent folders. Raises the same errors as write_whole."""
    with system_errors_at(path):
        Path(path).mkdir(parents=True, exist_ok=True)


def missing_folders(path: Path) -> list[Path]:
    """Return those of a folder and its parents that do not exist, parents first."""
    return [folder for folder in (*reversed(path.parents), path) if not folder.exists()]


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that has no files. Errors are ignored."""
    with contextlib.suppress(OSError):
        folder.rmdir()


def refuse_foreign_folder(path: str | os.PathLike[str], remedy: str) -> None:
    """Raise InputError if `path` is no folder, or a folder with files other than dot files. It may be missing."""
    with system_errors_at(path):
        try:
            found = sorted(name for name in os.listdir(path) if not name.startswith("."))
        except FileNotFoundError:
            return
    if found:
        more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
        raise InputError(
            f"{os.fspath(path)}: psdmc did not write the files in this folder: {', '.join(found[:SHOWN])}{more}",
            remedy,
        )


def refuse_foreign_file(path: str | os.PathLike[str], mark: str, remedy: str) -> None:
    """Raise InputError if psdmc did not write the file at `path`. psdmc wrote the file if its first HEAD (1 MiB) bytes
    contain `mark`, a text that psdmc puts into all files of this kind.

    Commands call this function for files that they write in addition to the file that the user named.
    """
    with system_errors_at(path):
        if not os.path.isfile(path):
            return
        with open(path, "rb") as file:
            is_own = mark.encode() in file.read(HEAD)
    if not is_own:
        raise InputError(f"{os.fspath(path)}: psdmc did not write this file and does not replace it", remedy)


def check_place(path: str | os.PathLike[str]) -> None:
    """Raise InputError if no file can be written at `path`. A command that computes for hours calls this function
    first, so that a wrong path is found at once."""
    target = Path(path)
    with system_errors_at(path):
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
        if not target.parent.is_dir():
            code = errno.ENOTDIR if target.parent.exists() else errno.ENOENT
            raise OSError(code, os.strerror(code), str(target.parent))
        if not os.access(target.parent, os.W_OK | os.X_OK) and not _is_stream(target):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target.parent))


@contextlib.contextmanager
def system_errors_at(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an OSError that is raised inside the `with` statement into an error of psdmc, whose hint suggests a remedy.
    The message names `path`, not a temporary file."""
    try:
        yield
    except OSError as error:
        raise unwritable(path, error) from error


def unwritable(path: str | os.PathLike[str], error: OSError) -> PsdmcError:
    """Return the error for a `path` that cannot be written. Its hint suggests another path or another disk."""
    what = f"{os.fspath(path)}: cannot be written: {error.strerror or error}"
    if error.errno == errno.EROFS:
        return ToolchainError(what, "write to another disk")
    if error.errno in _THE_DISK:
        return ToolchainError(what, "make room there, or write to another disk")
    if error.errno == errno.ENOTDIR:
        return InputError(what, "a file is in the place of a folder: give another folder")
    return InputError(what, "give a place that exists and that you may write to")


def _is_stream(target: Path) -> bool:
    """Whether the path is a device, a pipe or a socket, which renaming a file onto it would destroy."""
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


@contextlib.contextmanager
def _temporary(target: Path) -> Iterator[Path]:
    """An empty locked file beside `target`, removed at the end unless it was renamed."""
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    remove_leftovers(target.parent)
    handle, own = _locked_new_file(target)
    try:
        yield own
    finally:
        own.unlink(missing_ok=True)
        os.close(handle)


def _locked_new_file(target: Path) -> tuple[int, Path]:
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    suffix = target.suffix if re.fullmatch(r"\.[a-z]{1,8}", target.suffix) else ""
    while True:
        own = target.parent / f".psdmc-{secrets.token_hex(8)}.part{suffix}"
        handle = os.open(own, flags, 0o666)
        lock(handle)
        if sys.platform == "win32" or os.fstat(handle).st_nlink:
            return handle, own
        os.close(handle)  # another process removed it as a leftover before it was locked


def lock(handle: int, wait: bool = True) -> bool:
    """Lock the open file or folder `handle` against other processes. The lock lasts until the file is closed or the
    process ends. Return True if the lock was obtained.

    wait  True: wait while another process holds the lock; False: return False in this case
    """
    if sys.platform == "win32":
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        return False
    return True


def can_lock(handle: int) -> bool:
    """Return whether the file system of the open file `handle` supports locks. The answer is also True if another
    process holds a lock on this file."""
    if sys.platform == "win32":
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    fcntl.flock(handle, fcntl.LOCK_UN)
    return True


def unlock(handle: int) -> None:
    """Release the lock of the open file `handle`. Child processes that were forked since also lose the lock."""
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_UN)


def remove_leftovers(folder: Path) -> None:
    """Remove the temporary files that ended processes of psdmc left in a folder. Other files stay; errors are ignored."""
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            if _TEMPORARY.fullmatch(name):
                _remove_if_dead(folder / name)


def _remove_if_dead(path: Path) -> None:
    with contextlib.suppress(OSError):
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        try:
            if stat.S_ISREG(os.fstat(handle).st_mode) and lock(handle, wait=False):
                path.unlink()
        finally:
            os.close(handle)


def _fill(own: Path, content: str | bytes) -> None:
    own.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def _settle(own: Path, target: Path) -> None:
    """Write the file to the disk, with the mode that the old file had; a full disk raises here at the latest."""
    _flush(own, os.O_RDWR)
    with contextlib.suppress(FileNotFoundError):
        own.chmod(target.stat().st_mode & 0o777)


def _settle_folder(folder: Path) -> None:
    """Write the renaming to the disk, where the file system can; the file is whole in any case."""
    with contextlib.suppress(OSError):
        _flush(folder, os.O_RDONLY)


def _flush(path: Path, mode: int) -> None:
    handle = os.open(path, mode)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def read_file(
    path: str | os.PathLike[str], most: int, hint: str, begins: bytes = b"", name: str | None = None
) -> bytes:
    """Return the content of a file, pipe or device. Arguments and other errors are those of read_rest. Raises OSError
    if the file cannot be read."""
    with Path(path).open("rb") as file:
        named = name or os.fspath(path)
        if os.fstat(file.fileno()).st_size > most:
            raise _too_much(named, most, hint)
        return read_rest(file, most, named, hint, begins)


def read_rest(file: BinaryIO, most: int, name: str, hint: str, begins: bytes = b"") -> bytes:
    """Return the bytes that are left in an open file. The function reads at most one byte more than `most`.

    begins   expected first bytes; if the file begins with other bytes, only the first bytes of the file are returned

    Raises InputError, which calls the file `name`, if more than `most` bytes are left.
    """
    found = bytearray(_up_to(file, len(begins)))
    if found != begins:
        return bytes(found)
    while len(found) <= most:
        piece = file.read(min(PIECE, most + 1 - len(found)))
        if not piece:
            return bytes(found)
        found += piece
    raise _too_much(name, most, hint)


def _too_much(name: str, most: int, hint: str) -> InputError:
    return InputError(f"{name}: more than {in_words(most)}, which is the most that psdmc reads", hint)


def _up_to(file: BinaryIO, count: int) -> bytes:
    """So many bytes; fewer where the file ends."""
    found = b""
    while len(found) < count and (piece := file.read(count - len(found))):
        found += piece
    return found


def in_words(size: int) -> str:
    """Return a size in bytes as a text for messages, such as '64 MiB'."""
    for unit, bits in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if size >= 1 << bits and size % (1 << bits) == 0:
            return f"{size >> bits} {unit}"
    return f"{size:,} bytes"
