"""Builds a generated C package with the package's build files, and runs the self-test of the package."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from psdmc.backends.manifest import edited_files
from psdmc.errors import InputError, ToolchainError
from psdmc.files import make_folder, refuse_foreign_folder, system_errors_at
from psdmc.progress import Progress, Step, silent
from psdmc.toolchain.compiler_command import attempt, failure, find_compiler

FAILED = ": FAILED"
SHOWN = 3
"""Failed checks that a message names."""

NOT_FOR_CMAKE = re.compile(r'["\\;:<>|?\x00-\x1f\x7f]|\[(?![^/]*\])')
"""Characters of a path with which CMake 3.25 and the Makefiles that it writes fail; of brackets an open one."""

UNFINISHED = ".psdmc-unfinished"
"""Marks a build folder while psdmc builds there, and after it was killed or failed."""

MARKS = (UNFINISHED, "CMakeCache.txt", "CMakeFiles", "compiled_by")
"""What psdmc, CMake and the package's Makefile first write into a build folder."""


def build_package(directory: str | Path, edited: bool = False, progress: Progress = silent) -> str:
    """Build the package in the folder `build` of `directory`, run the self-test of the package, and return the output
    of the tools.

    edited    True: build although files are missing or differ from what the command `emit-c` wrote
    progress  function that psdmc calls with the number of compiled files and their share

    The build uses CMake if it is installed, else make. Raises InputError if the folder holds no package, or an edited
    one. Raises ToolchainError if a tool is missing or fails.
    """
    root = Path(directory)
    _check_files(root, edited)
    compiler = find_compiler().command
    build = root / "build"
    for tool in ("cmake", "make"):
        if shutil.which(tool):
            if tool == "cmake":
                path = Path(os.path.abspath(root))
                found = NOT_FOR_CMAKE.search(path.as_posix().removeprefix(path.drive))
                if found:
                    raise InputError(
                        f"{root}: CMake cannot take {found[0]!r} in a folder's path",
                        "move the package to a folder without it, or build it with make in the package's folder",
                    )
            with _own_build(build), told(build, len(list((root / "src").glob("*.c"))) + 1, progress):
                return _with_cmake(root) if tool == "cmake" else _with_make(root, compiler)
    raise ToolchainError("neither cmake nor make was found", "install one (Debian: apt install cmake)")


def _check_files(root: Path, edited: bool) -> None:
    """InputError if files differ from the manifest, whose digests are from the check against the model."""
    found = edited_files(root)
    if found is None:
        fault = "no emitted package (no manifest.json of psdmc's)" if root.is_dir() else "no such folder"
        raise InputError(f"{root}: {fault}", "make a package with psdmc emit-c")
    if found and not edited:
        raise InputError(
            f"{root}: not as emit-c wrote it: {', '.join(found[:3])}{' ...' if len(found) > 3 else ''}",
            "emit it again, or build it all the same with --edited",
        )


@contextlib.contextmanager
def _own_build(folder: Path) -> Iterator[None]:
    """Hold the build folder, emptied first where an interrupted build left it: it may hold half an object file. InputError
    where it holds files and no build."""
    if not any((folder / mark).exists() for mark in MARKS):
        refuse_foreign_folder(folder, "move these files away: emitted packages are built there")
    with system_errors_at(folder):
        if (folder / UNFINISHED).is_file() and not folder.is_symlink():
            shutil.rmtree(folder)
        make_folder(folder)
        (folder / UNFINISHED).touch()
    yield
    (folder / UNFINISHED).unlink(missing_ok=True)


def _with_cmake(root: Path) -> str:
    """Build with CMake, which reads CC itself; returns its output."""
    source = os.path.abspath(root)  # CMake takes -a, ~ and a:b alone for other things
    build = os.path.join(source, "build")
    steps = [
        ["cmake", "-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=Release"],
        ["cmake", "--build", build, "--parallel"],
    ]
    built = "".join(_output(step, root) for step in steps)
    return built + _self_test(["ctest", "--test-dir", build, "--output-on-failure", "--verbose"], root)


def _with_make(root: Path, compiler: tuple[str, ...]) -> str:
    command = shlex.join(compiler).replace("$", "$$")
    make = ["make", "-C", str(root), f"CC={command}"]
    return _output([*make, "all"], root) + _self_test([*make, "check"], root)


def _output(words: list[str], root: Path) -> str:
    """The output of a program that writes into the package's folder. ToolchainError if it fails."""
    done = attempt(words, str(root))
    if done.returncode != 0:
        raise failure(words, str(root), done, root)
    return done.stdout


def _self_test(words: list[str], root: Path) -> str:
    """The self-test's output; ToolchainError with the checks that failed, or how it ended otherwise."""
    done = attempt(words, str(root))
    if done.returncode == 0:
        return done.stdout
    lines = (re.sub(r"^\d+: ", "", line.strip()) for line in done.stdout.splitlines())
    failed = list(dict.fromkeys(line.removesuffix(FAILED) for line in lines if line.endswith(FAILED)))
    if not failed:
        raise failure(words, str(root), done, root)
    first = "; ".join(failed[:SHOWN]) + ("; ..." if len(failed) > SHOWN else "")
    plural = "check" if len(failed) == 1 else "checks"
    raise ToolchainError(
        f"{root}: the self-test failed in {len(failed)} {plural}: {first}",
        "the code does not compute this robot here: look for changed files (psdmc emit-c writes them again) and for "
        f"compiler flags such as -ffast-math; run it to see everything: {shlex.join(words)}",
    )


def checks_of(report: str) -> str:
    """Return the summary of a package's self-test, such as '39 checks of 15 functions'."""
    found = re.findall(r": (\d+ checks of \d+ functions), 0 failed", report)
    return found[-1] if found else "nothing to check"


# How far a build is, by the object files that have come into its folder.
TICK = 0.25
"""s between two looks."""

OBJECTS = ("*.o", "*.obj")

FOLDERS = ("src", "test")
"""Of a package, as CMake names them in its build folder: objects elsewhere are of CMake's own trials."""


@contextmanager
def told(build: Path, files: int, progress: Progress) -> Iterator[None]:
    """Report the progress of a build until the block ends: how many of `files` object files exist below the folder
    `build`.

    Compilers print nothing while they work, so the files are counted. If an earlier build left its files, the time left
    is not known.
    """
    done, most = threading.Event(), 0

    def tell() -> None:
        nonlocal most
        most = max(most, min(files, _compiled(build)))
        progress(Step(f"building: {most} of {files} files", most / max(files, 1)))

    def watch() -> None:
        while not done.wait(TICK):
            tell()

    tell()
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def _compiled(build: Path) -> int:
    """Count the object files below `build`; 0 while the build takes a folder away."""
    with suppress(OSError):
        found = [path.parent for pattern in OBJECTS for path in build.rglob(pattern)]
        return sum(1 for folder in found if folder == build or folder.name in FOLDERS)
    return 0
