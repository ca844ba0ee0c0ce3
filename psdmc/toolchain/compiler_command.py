"""Finds the C compiler, determines its features, and runs it."""

from __future__ import annotations

import contextlib
import errno
import os
import shlex
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from psdmc.errors import ToolchainError
from psdmc.target.presets import NATIVE
from psdmc.target.target import ARITHMETIC, GCC_ONLY, Target

CANDIDATES = ("cc", "gcc", "clang")
FLAGS = ("-O3", *ARITHMETIC, "-fPIC")
SHOWN = 3
"""Missing CPU features that a message names."""
SECONDS = 600
"""Longest time in seconds of one run of the compiler."""
FULL = tuple(os.strerror(code) for code in (errno.ENOSPC, errno.EDQUOT))
"""What programs print when a disk is full, or the user's share of it."""
LEAST_ROOM = 1 << 20
"""Bytes. If less is free on its disk, a program failed for lack of space: CMake often does not print that."""


@dataclass(frozen=True, slots=True)
class Compiler:
    """A C compiler.

    command   the words that start it
    version   its version text, for cache keys
    portable  flags for every machine: FLAGS, and further ones for GCC
    flags     the portable flags, and those for the target or this machine's CPU
    target    macros that the compiler predefines with these flags; they name the CPU features
    """

    command: tuple[str, ...]
    version: str
    portable: tuple[str, ...]
    flags: tuple[str, ...]
    target: str

    @property
    def identity(self) -> tuple[str, ...]:
        """Return the properties of the compiler on which a compiled library depends. They are part of cache keys."""
        return (*self.command, self.version, self.target, *self.flags)


def find_compiler(target: Target = NATIVE) -> Compiler:
    """Return the compiler that the environment variable CC names, else the first of CANDIDATES, with its flags for a
    target.

    Raises ToolchainError if there is no compiler, if it does not accept the target's flags, or if this machine cannot
    run code for the target.
    """
    return _described(_command(os.environ.get("CC", "")), target)


def _command(wanted: str) -> tuple[str, ...]:
    if wanted.strip():
        # The words of CC, a path among them made absolute, as compilers run in folders of their own.
        hint = "set CC to a compiler, or unset it"
        try:
            program, *options = shlex.split(wanted)
        except ValueError as error:
            raise ToolchainError(f"C compiler {wanted!r} (from CC) is no command: {error}", hint) from None
        if not shutil.which(program):
            raise ToolchainError(f"C compiler {wanted!r} (from CC) was not found", hint)
        return (os.path.abspath(program) if os.path.dirname(program) else program, *options)
    for name in CANDIDATES:
        if shutil.which(name):
            return (name,)
    raise ToolchainError(
        f"no C compiler found (looked for {', '.join(CANDIDATES)})",
        "install one (Debian: apt install gcc) or set CC",
    )


@cache
def _described(command: tuple[str, ...], target: Target) -> Compiler:
    version = run([*command, "--version"], "C compiler")
    portable = (*FLAGS, *GCC_ONLY) if "Free Software Foundation" in version else FLAGS
    flags, macros = _native(command, portable, target.host_flags)
    if "__STDC__" not in macros:
        raise ToolchainError(
            f"{shlex.join(command)} is no C compiler: it predefines no macros",
            "set CC to a compiler, or unset it",
        )
    if target.flags:
        flags = (*portable, *target.flags)
        macros = _taken(command, flags, target)
        _check_runs_here(command, portable, macros, target)
    return Compiler(command, version, portable, flags, "\n".join(sorted(macros.splitlines())))


def _taken(command: tuple[str, ...], flags: tuple[str, ...], target: Target) -> str:
    """The macros that a compiler predefines for a target; ToolchainError where it knows no such target."""
    try:
        return _macros(command, flags)
    except ToolchainError:
        raise ToolchainError(
            f"target {target.name}: {shlex.join(command)} does not take {' '.join(target.flags)}",
            "compile makes code for this machine: choose a target that it is, or set CC; emit-c writes packages for others",
        ) from None


def _check_runs_here(
    command: tuple[str, ...], portable: tuple[str, ...], macros: str, target: Target
) -> None:
    """ToolchainError where a target has instructions that this machine's CPU, as the compiler detects it, does not
    have: running them would end the process."""
    here = _names(_native(command, portable, NATIVE.host_flags)[1])
    lacking = sorted(_names(macros) - _names(_macros(command, portable)) - here)
    if lacking:
        raise ToolchainError(
            f"target {target.name}: this machine's CPU lacks {', '.join(name.strip('_') for name in lacking[:SHOWN])}",
            "choose another target; emit-c writes packages for other machines",
        )


def _names(macros: str) -> set[str]:
    """Names of macros, except those about tuning."""
    names = {line.split()[1].partition("(")[0] for line in macros.splitlines() if line.startswith("#define ")}
    return {name for name in names if "tune" not in name}


def _native(
    command: tuple[str, ...], portable: tuple[str, ...], host_flags: tuple[str, ...]
) -> tuple[tuple[str, ...], str]:
    """Flags that the compiler accepts, with this CPU's if possible, and the macros that it predefines under them."""
    for native in host_flags:
        with contextlib.suppress(ToolchainError):
            return (*portable, native), _macros(command, (*portable, native))
    return portable, _macros(command, portable)


def _macros(command: tuple[str, ...], flags: tuple[str, ...]) -> str:
    return run([*command, *flags, "-dM", "-E", "-x", "c", os.devnull], "C compiler")


def run(words: Sequence[str], what: str, cwd: str | None = None) -> str:
    """Run a program and return its output. Raises ToolchainError with a line of errors if it fails."""
    done = attempt(words, what, cwd)
    if done.returncode != 0:
        raise failure(words, what, done, cwd)
    return done.stdout


def attempt(words: Sequence[str], what: str, cwd: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program and return the result, with any exit status. Raises ToolchainError if it fails to start or end."""
    try:
        return subprocess.run(
            words, cwd=cwd, capture_output=True, text=True, errors="replace", timeout=SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ToolchainError(
            f"{what}: {words[0]} could not be run: {error}",
            "check that the program works when it is started by hand",
        ) from error


def _is_full(folder: str | Path) -> bool:
    try:
        return shutil.disk_usage(folder).free < LEAST_ROOM
    except OSError:  # another program removed the folder meanwhile
        return False


def failure(
    words: Sequence[str], what: str, done: subprocess.CompletedProcess[str], folder: str | Path | None
) -> ToolchainError:
    """Return the error for a program that was killed or ended with a status other than 0.

    folder  where the program writes its files; None: unknown. The error says so if its disk is full
    """
    lines = [
        line.strip() for text in (done.stderr, done.stdout) for line in text.splitlines() if line.strip()
    ]
    no_space = [line for line in lines if any(text in line for text in FULL)]
    errors = [line for line in lines if "error" in line.lower()]
    complaint = [*no_space, *errors, *lines[-1:], "no message"][0]
    if no_space or (folder is not None and _is_full(folder)):
        return ToolchainError(
            f"{what}: no space left on the disk: {words[0]}: {complaint}",
            f"make room there and in {tempfile.gettempdir()}, then try again",
        )
    if done.returncode < 0:
        return ToolchainError(
            f"{what}: {words[0]} was killed by {_signal_name(-done.returncode)}",
            "is there memory enough? run it to see: " + shlex.join(words),
        )
    return ToolchainError(
        f"{what}: {words[0]} failed with status {done.returncode}: {complaint}",
        f"run it to see everything: {shlex.join(words)}",
    )


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
