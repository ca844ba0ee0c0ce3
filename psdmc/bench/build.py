"""Compile what the benchmark needs, once: results are kept by the content of everything that went in."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

OPTIMISED = ("-O3", "-march=native", "-DNDEBUG")
"""Flags of every contestant that is compiled here."""

COUNTED = ("-O3", "-march=x86-64-v3", "-DNDEBUG")
"""The same for counting instructions: valgrind knows no AVX-512."""

LONGEST_BUILD = 900.0
"""s; a compiler that takes longer is stopped, and its rival shown as not built."""


class BuildFailed(Exception):
    """A rival could not be built; the message says why, in a line."""


def cache_directory() -> Path:
    """$PSDMC_CACHE_DIR, or the user's cache."""
    chosen = os.environ.get("PSDMC_CACHE_DIR")
    if chosen:
        return Path(chosen) / "bench"
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "psdmc" / "bench"


def built(
    product: str,
    command: Sequence[str],
    sources: Mapping[str, str],
    depends: Sequence[str] = (),
    environment: Mapping[str, str] | None = None,
) -> Path:
    """Path of the file `product` that `command` makes in a folder holding `sources`.

    command      argument list; runs only where no earlier result has the same content
    sources      file name to text
    depends      whatever else decides the result, such as versions of libraries
    environment  variables added to the command's

    BuildFailed where the command is missing, fails or makes no such file.
    """
    key = _key(product, command, sources, depends)
    home = cache_directory() / key
    if not (home / product).is_file():
        _build(home, product, command, sources, environment or {})
    return home / product


def compiler(language: str = "c++") -> str:
    """The C or C++ compiler: $CC or $CXX, else what the machine calls one. BuildFailed where there is none."""
    variable, names = ("CXX", ("g++", "c++", "clang++")) if language == "c++" else ("CC", ("gcc", "cc", "clang"))
    chosen = os.environ.get(variable)
    found = next((path for name in ([chosen] if chosen else names) if (path := shutil.which(name))), None)
    if found is None:
        raise BuildFailed(f"no {language.upper()} compiler on this machine")
    return found


@lru_cache
def version_of(program: str) -> str:
    """The first line that a program says about its version."""
    try:
        answer = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=60, check=False)
    except OSError:
        return "unknown"
    return (answer.stdout.splitlines() or ["unknown"])[0]


@lru_cache
def processor_features() -> str:
    """What -march=native depends on, as the kernel states it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return os.uname().machine
    kept = ("model name", "flags", "Features", "CPU part")
    return "\n".join(sorted({line for line in lines if line.startswith(kept)}))


def _key(product: str, command: Sequence[str], sources: Mapping[str, str], depends: Sequence[str]) -> str:
    parts = [product, *command, version_of(command[0]), processor_features(), *depends]
    parts += [part for name in sorted(sources) for part in (name, sources[name])]
    digest = hashlib.sha256("\0".join(parts).encode())
    return f"{Path(product).stem}-{digest.hexdigest()[:24]}"


def _build(
    home: Path, product: str, command: Sequence[str], sources: Mapping[str, str], environment: Mapping[str, str]
) -> None:
    """In a private folder first: two processes may want the same thing, and half a result must not be found."""
    home.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=home.parent) as private:
        for name, text in sources.items():
            (Path(private) / name).write_text(text)
        _run(command, private, environment)
        if not (Path(private) / product).is_file():
            raise BuildFailed(f"{Path(command[0]).name} made no {product}")
        home.mkdir(exist_ok=True)
        for file in sorted(Path(private).iterdir()):
            os.replace(file, home / file.name)


def _run(command: Sequence[str], folder: str, environment: Mapping[str, str]) -> None:
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=LONGEST_BUILD,
            check=False,
        )
    except OSError as error:
        raise BuildFailed(f"{command[0]}: {error.strerror}") from error
    except subprocess.TimeoutExpired:
        raise BuildFailed(f"{Path(command[0]).name} took more than {LONGEST_BUILD:.0f} s") from None
    if done.returncode != 0:
        lines = done.stderr.splitlines()
        told = next((line for line in lines if "error" in line.lower()), (lines or ["no message"])[-1])
        raise BuildFailed(f"{Path(command[0]).name}: {told.strip()[:300]}")
