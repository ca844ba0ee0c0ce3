"""psdmc's command line: in this process, for speed; in a fork of it, as a process of its own that need not load
everything again; or in one that Python starts, as a user types it."""

from __future__ import annotations

import contextlib
import importlib
import os
import signal
import subprocess
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import NoReturn

import pytest

from psdmc.cli import main

SECONDS = 300
NOT_ENDED = 99
"""Exit status of a forked command that ended by no SystemExit: what a user would see as a traceback is in its error
output."""

READ_AT_START = ("PYTHON", "LC_", "LANG", "OPENBLAS_", "OMP_")
"""How environment variables begin that Python and its libraries read once, when they start."""

LOADED = (
    "pinocchio",
    "psdmc.cli.boundary",
    "psdmc.cli.tables",
    "psdmc.compiler",
    "psdmc.robot.mujoco_reading",
    "psdmc.toolchain.build_package",
    "psdmc.verification.check",
)
"""Modules that commands load late: they are loaded before a fork, or each fork would load them again."""


def typed(*words: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """`psdmc WORDS` in a process of its own: a fork of this one, or, where the environment asks for what is decided when
    Python starts, a new one."""
    if any(name.startswith(READ_AT_START) for name in environment):
        return started(*words, cwd=cwd, **environment)
    _load()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if child == 0:
            become(words, cwd, environment, out.fileno(), err.fileno())
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said = [_whole(stream.fileno()) for stream in (out, err)]
    return subprocess.CompletedProcess(["psdmc", *map(str, words)], code, *said)


def started(*words: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """`psdmc WORDS` in a process that Python starts, with all that this decides: imports, locale, seed of hashes."""
    return subprocess.run(
        [sys.executable, "-m", "psdmc", *map(str, words)],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        encoding=environment.get("PYTHONIOENCODING", "utf-8"),
        timeout=SECONDS,
        check=False,
    )


def status(*words: object) -> int:
    """Exit status of `psdmc WORDS` in this process."""
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    code = left.value.code
    return code if isinstance(code, int) else int(code is not None)


def files_in(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def become(
    words: Iterable[object], cwd: Path | None, environment: Mapping[str, str], out: int, err: int
) -> NoReturn:
    """Run `psdmc WORDS` in this forked process and end it; its outputs go to two file descriptors."""
    code = NOT_ENDED
    try:
        signal.alarm(SECONDS)
        os.environ.update(environment)
        os.chdir(cwd or ".")
        with open(os.devnull, "rb") as nothing:
            os.dup2(nothing.fileno(), 0)
        os.dup2(out, 1)
        os.dup2(err, 2)
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115  as long as the process
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
        _warn_as_python_does()
        main([str(word) for word in words])
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _warn_as_python_does() -> None:
    """Undo pytest's collection of warnings: what a user would see stands in the error output."""
    warnings.resetwarnings()
    for ignored in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
        warnings.simplefilter("ignore", ignored, append=True)

    def shown(message: object, category: object, filename: object, lineno: object, *more: object) -> None:
        print(f"{filename}:{lineno}: {message}", file=sys.stderr)

    warnings.showwarning = shown  # type: ignore[assignment]


@cache
def _load() -> None:
    for name in LOADED:
        importlib.import_module(name)


def _whole(stream: int) -> str:
    return os.pread(stream, os.fstat(stream).st_size, 0).decode("utf-8")
