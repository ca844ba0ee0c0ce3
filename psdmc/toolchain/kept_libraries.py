"""Compiled libraries with their interfaces kept in the compile cache: an equal call of `compile` only opens one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from importlib import resources
from pathlib import Path

from psdmc.backends.c.package import PackageView
from psdmc.errors import InternalError
from psdmc.target.native import NATIVE
from psdmc.target.target import Target
from psdmc.toolchain.cache import cache_key, cached, found
from psdmc.toolchain.compile import LIBRARY, compile_library
from psdmc.toolchain.compiler_command import find_compiler
from psdmc.toolchain.interface import Interface, interface_from_json, interface_of, interface_to_json
from psdmc.toolchain.kept_kernels import digest, sources_digests
from psdmc.version import psdmc_version

INTERFACE = "interface.json"


def compiled_once(
    parts: Sequence[str], make: Callable[[], PackageView], target: Target = NATIVE
) -> tuple[Interface, Path]:
    """Interface and shared library of the package that `make` returns, from the cache where an equal call was made
    before.

    parts   all that the package depends on besides psdmc's own sources: the model's hash, the options
    target  the package's

    Raises what `make` and `compile_library` raise. An interface whose library is missing or altered is not used.
    """
    made: list[tuple[Interface, Path]] = []

    def build(folder: Path) -> None:
        package = make()
        library = compile_library(package)
        made.append((interface_of(package), library))
        (folder / INTERFACE).write_text(interface_to_json(made[0][0], library.parent.name), encoding="utf-8")

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
