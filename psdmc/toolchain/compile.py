"""Keeps compiled libraries and interfaces in the compile cache: an equal `compile` only loads them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

import numpy as np

from psdmc.backends.c.back_end import library_files
from psdmc.backends.c.package import PackageView
from psdmc.errors import InternalError, ToolchainError
from psdmc.functions import BY_ROWS, SIGNATURES
from psdmc.program.kernel import THETA_ROWS, Kernel, by_rows, takes_gravity
from psdmc.program.kernel_json import kernels_from_json, kernels_to_json
from psdmc.program.signature import Signature
from psdmc.target.presets import NATIVE
from psdmc.target.target import Target
from psdmc.toolchain.cache import cache_key, cached, found
from psdmc.toolchain.compiler_command import Compiler, find_compiler, run
from psdmc.toolchain.interface import Interface, interface_from_json, interface_of, interface_to_json
from psdmc.version import psdmc_version

INTERFACE = "interface.json"


def compiled_once(
    parts: Sequence[str], make: Callable[[], PackageView], target: Target = NATIVE
) -> tuple[Interface, Path]:
    """Return the interface and the shared library of a package. They come from the compile cache if an equal call was
    made before. Else `make` generates the package, which is then compiled.

    parts   everything that the package depends on except psdmc's own sources: the model's hash, the options
    target  the target of the package

    Raises the errors of `make` and `compile_library`. If the library is missing or altered, the interface is not used.
    """
    made: list[tuple[Interface, Path]] = []

    def build(folder: Path) -> None:
        interface, library = _made(make())
        made.append((interface, library))
        (folder / INTERFACE).write_text(interface_to_json(interface, library.parent.name), encoding="utf-8")

    decides = (*sources_digests(), *_emission(), *find_compiler(target).identity, repr(target), *parts)
    key = cache_key({}, ("interface", *decides))
    entry = cached(key, build, [INTERFACE])
    return made[0] if made else _opened(entry) or _made(make())


@cache
def _emission() -> tuple[str, ...]:
    """psdmc's version and the digest of the files that turn kernels into C and C into a library."""
    from importlib.metadata import version  # here: emission, which compiles nothing, does not wait for it

    root = resources.files("psdmc")
    files = digest([root / "backends", root / "toolchain", resources.files("psdmc.templates")])
    return (psdmc_version(), version("jinja2"), files)


def _opened(entry: Path) -> tuple[Interface, Path] | None:
    """The contents of an entry; None where it cannot be read or its library is missing."""
    try:
        interface, key = interface_from_json((entry / INTERFACE).read_text(encoding="utf-8"))
    except (InternalError, OSError, UnicodeDecodeError):
        return None
    folder = found(key)
    return None if folder is None else (interface, folder / LIBRARY)


def _made(package: PackageView) -> tuple[Interface, Path]:
    return interface_of(package), compile_library(package)


LIBRARY = "library.so"


def compile_library(package: PackageView) -> Path:
    """Return the shared library of a package, from the cache or newly compiled.

    Raises ToolchainError if there is no compiler, if it fails or makes no library, or if the cache cannot be written
    or is writable by other users.
    """
    files = library_files(package)
    compiler = find_compiler(package.options.target)
    key = cache_key(files, (*compiler.identity, package.info.psdmc_version))
    return cached(key, lambda own: _build(package, files, compiler, own), [LIBRARY]) / LIBRARY


def _build(package: PackageView, files: dict[str, str], compiler: Compiler, folder: Path) -> None:
    """Compile each source, several at a time, and link them."""
    for path, text in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8", newline="\n")
    commands = [
        [*compiler.command, "-std=c99", *compiler.flags, "-Iinclude", "-c", source, "-o", _object(source)]
        for source in package.sources
    ]
    from concurrent.futures import ThreadPoolExecutor  # here: who compiles nothing does not wait for it

    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        list(pool.map(lambda words: run(words, package.robot, str(folder)), commands))
    finally:
        pool.shutdown(cancel_futures=True)
    objects = [_object(source) for source in package.sources]
    link = [*compiler.command, "-shared", "-o", LIBRARY, *objects, "-lm"]
    run(link, package.robot, str(folder))
    for name in objects:
        (folder / name).unlink(missing_ok=True)


def _object(source: str) -> str:
    return source.removesuffix(".c") + ".o"


KERNELS = "kernels.json"

DECIDES = ("dynamics", "friction", "functions", "lower", "model", "program", "recipes", "robot", "target")
"""Folders of psdmc whose files the result of a lowering depends on, beside the modules at psdmc's top level."""


def lowered_once(
    parts: Sequence[str], lower: Callable[[], dict[str, Kernel]], gravity_input: bool = False
) -> dict[str, Kernel]:
    """Return the generated programs (kernels) that the function `lower` computes. They come from the compile cache if
    an equal call was made before.

    parts          everything that the result depends on except psdmc's own sources: the model's hash, the options
    gravity_input  whether gravity is an input of the functions that depend on it

    If the cache cannot be used, `lower` is called and its result is not stored.
    """
    made: dict[str, Kernel] = {}

    def build(folder: Path) -> None:
        made.update(lower())
        (folder / KERNELS).write_text(kernels_to_json(made), encoding="utf-8")

    key = cache_key({}, ("kernels", *sources_digests(), *parts))
    try:
        kept = cached(key, build, [KERNELS]) / KERNELS
        return made or kernels_from_json(kept.read_text(encoding="utf-8"), _known(gravity_input))
    except (ToolchainError, InternalError, OSError):
        return made or lower()


@cache
def _known(gravity_input: bool) -> dict[str, Signature]:
    """The functions that kept kernels can be of."""
    if not gravity_input:
        return SIGNATURES | BY_ROWS
    found = {name: takes_gravity(each) for name, each in SIGNATURES.items()}
    return found | {f"{name}{THETA_ROWS}": by_rows(each) for name, each in found.items() if each.theta}


@cache
def sources_digests() -> tuple[str, ...]:
    """Return NumPy's version and a digest of psdmc's sources, on which cached programs depend."""
    root = resources.files("psdmc")
    modules = [file for file in root.iterdir() if file.name.endswith(".py")]
    return (np.__version__, digest([*modules, *(root / folder for folder in DECIDES)]))


def digest(places: Iterable[Traversable]) -> str:
    """Return a SHA-256 digest of names and contents of these files, and of all files in these folders."""
    found = hashlib.sha256()
    for name, content in _files("", places):
        found.update(repr((name, content)).encode())
    return found.hexdigest()


def _files(within: str, places: Iterable[Traversable]) -> Iterator[tuple[str, bytes]]:
    for place in sorted(places, key=lambda place: place.name):
        name = f"{within}/{place.name}"
        if place.is_file():
            yield name, place.read_bytes()
        elif place.name != "__pycache__":
            yield from _files(name, place.iterdir())
