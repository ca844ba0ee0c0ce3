"""Packages' manifests: JSON edits, and forged entries that point out of the folder."""

from __future__ import annotations

import json
from random import Random

from mutate_bytes import mutate_bytes, mutate_lines
from mutate_tree import mutate_tree

OUTSIDE = "@OUTSIDE@"
"""Stands for the absolute path of a folder beside the package (target_packages.py)."""

FORGED = (
    *("../outside/arm/victim.h", "include/arm/victim.h", f"{OUTSIDE}/arm/victim.h", "src/linked.c"),
    *(
        "src/../../outside/arm/victim.h",
        "src/foreign.c",
        "include",
        "include/..",
        "test/a.c",
        "src",
        ".",
        "",
        "/",
    ),
    *(
        "./Makefile",
        "src//b.c",
        "SRC/b.c",
        "manifest.json",
        "README.md",
        "src/a\u0000b.c",
        "src/é.c",
        "a" * 5000,
    ),
)


def mutate_package(data: bytes, rng: Random) -> bytes:
    kind = rng.random()
    if kind < 0.1:
        return mutate_bytes(data, rng)
    if kind < 0.25:
        return mutate_lines(data, rng)
    try:
        manifest = json.loads(data)
    except (ValueError, RecursionError):
        return mutate_lines(data, rng)
    if (
        kind < 0.65
        and isinstance(manifest, dict)
        and isinstance(manifest.get("files"), dict)
        and manifest["files"]
    ):
        digests = list(manifest["files"].values())
        for _ in range(rng.randint(1, 3)):
            manifest["files"][rng.choice(FORGED)] = rng.choice(digests)
    else:
        manifest = mutate_tree(manifest, rng)
    return _json(manifest)


def _json(value: object) -> bytes:
    try:
        return json.dumps(value).encode()
    except ValueError:
        return b"{}"
