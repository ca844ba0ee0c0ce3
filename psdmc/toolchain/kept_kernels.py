"""Kernels kept in the compile cache: a model is lowered once for its options and this version of psdmc."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from psdmc.errors import InternalError, ToolchainError
from psdmc.functions import SIGNATURES
from psdmc.program.kernel import Kernel
from psdmc.program.kernel_json import kernels_from_json, kernels_to_json
from psdmc.toolchain.cache import cache_key, cached

KERNELS = "kernels.json"

DECIDES = ("dynamics", "functions", "lower", "model", "program", "recipes", "robot", "target")
"""Folders of psdmc whose sources the result of a lowering depends on."""


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
    """NumPy's version and the digests of the sources that lowering runs, so that an edited psdmc lowers again."""
    return (np.__version__, *digests(DECIDES))


def digests(folders: Sequence[str]) -> Iterator[str]:
    """The digests of the sources in psdmc's folders of these names."""
    root = Path(__file__).parent.parent
    for folder in folders:
        for path in sorted((root / folder).rglob("*.py")):
            yield hashlib.sha256(path.read_bytes()).hexdigest()
