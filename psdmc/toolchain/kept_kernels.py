"""Kernels kept in the compile cache: a model is lowered once for its options and this version of psdmc."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

import numpy as np

from psdmc.errors import InternalError, ToolchainError
from psdmc.functions import SIGNATURES
from psdmc.program.kernel import Kernel
from psdmc.program.kernel_json import kernels_from_json, kernels_to_json
from psdmc.toolchain.cache import cache_key, cached

KERNELS = "kernels.json"

DECIDES = ("dynamics", "functions", "lower", "model", "program", "recipes", "robot", "target")
"""Folders of psdmc whose files the result of a lowering depends on, beside the modules at psdmc's top level."""


def lowered_once(parts: Sequence[str], lower: Callable[[], dict[str, Kernel]]) -> dict[str, Kernel]:
    """The kernels that `lower` returns, from the compile cache where an equal call was made before.

    parts  all that the result depends on besides psdmc's own sources: the model's hash, the options

    Where the cache cannot be used, `lower` is called and nothing is kept.
    """
    made: dict[str, Kernel] = {}

    def build(folder: Path) -> None:
        made.update(lower())
        (folder / KERNELS).write_text(kernels_to_json(made), encoding="utf-8")

    key = cache_key({}, ("kernels", *sources_digests(), *parts))
    try:
        kept = cached(key, build, [KERNELS]) / KERNELS
        return made or kernels_from_json(kept.read_text(encoding="utf-8"), SIGNATURES)
    except (ToolchainError, InternalError, OSError):
        return made or lower()


@cache
def sources_digests() -> tuple[str, ...]:
    """NumPy's version and the digest of the files that lowering runs, so that an edited psdmc lowers again."""
    root = resources.files("psdmc")
    modules = [file for file in root.iterdir() if file.name.endswith(".py")]
    return (np.__version__, digest([*modules, *(root / folder for folder in DECIDES)]))


def digest(places: Iterable[Traversable]) -> str:
    """SHA-256 of the names and contents of these files, and of all files in these folders and the folders within them."""
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
