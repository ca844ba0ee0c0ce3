"""Emitted sources -> a shared library, compiled once per content."""

from __future__ import annotations

import os
from pathlib import Path

from psdmc.backends.c.package import PackageView
from psdmc.backends.c.package_files import library_files
from psdmc.toolchain.cache import cache_key, cached
from psdmc.toolchain.compiler_command import Compiler, find_compiler, run

LIBRARY = "library.so"


def compile_library(package: PackageView) -> Path:
    """The shared library of a package, from the cache or compiled now.

    ToolchainError where there is no compiler, it fails or makes no library, or the cache cannot be written or is
    writable by other users.
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
    commands = [_compile_command(compiler, source) for source in package.sources]
    _run_all(commands, package.robot, folder)
    objects = [_object(source) for source in package.sources]
    link = [*compiler.command, "-shared", "-o", LIBRARY, *objects, "-lm"]
    run(link, package.robot, str(folder))
    for name in objects:
        (folder / name).unlink(missing_ok=True)


def _run_all(commands: list[list[str]], robot: str, folder: Path) -> None:
    """Run the commands, several at a time; after an error or Ctrl-C no further one is started."""
    from concurrent.futures import ThreadPoolExecutor  # here: who compiles nothing does not wait for it

    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        list(pool.map(lambda words: run(words, robot, str(folder)), commands))
    finally:
        pool.shutdown(cancel_futures=True)


def _compile_command(compiler: Compiler, source: str) -> list[str]:
    return [*compiler.command, "-std=c99", *compiler.flags, "-Iinclude", "-c", source, "-o", _object(source)]


def _object(source: str) -> str:
    return source.removesuffix(".c") + ".o"
