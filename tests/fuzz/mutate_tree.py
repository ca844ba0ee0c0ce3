"""Mutations of plain values in lists and tables: what JSON and TOML hold."""

from __future__ import annotations

import copy
from random import Random
from typing import Any

from nasty import anything, near, text

Path = tuple[Any, ...]

DEEPEST = 40


def mutate_tree(value: Any, rng: Random, edits: int = 0) -> Any:
    """A deep copy with some nodes replaced, dropped, repeated, renamed or moved."""
    found = copy.deepcopy(value)
    for _ in range(edits or rng.choice((1, 1, 1, 2, 3))):
        found = _one_edit(found, rng)
    return found


def paths(value: Any) -> list[Path]:
    """Keys and indices that lead to every node below the root, down to DEEPEST levels."""
    found: list[Path] = []
    open_nodes: list[tuple[Path, Any]] = [((), value)]
    while open_nodes:
        here, node = open_nodes.pop()
        if len(here) == DEEPEST:
            continue
        items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        below = [((*here, key), inner) for key, inner in items]
        found += [path for path, _ in below]
        open_nodes += below
    return found


def at(value: Any, path: Path) -> Any:
    for key in path:
        value = value[key]
    return value


def _one_edit(value: Any, rng: Random) -> Any:
    known = paths(value)
    if not known:
        return anything(rng)
    path = rng.choice(known)
    parent, key = at(value, path[:-1]), path[-1]
    choice = rng.randrange(10)
    if choice < 4:
        parent[key] = _other(parent[key], rng)
    elif choice == 4:
        parent[key] = anything(rng)
    elif choice == 5:
        del parent[key]
    elif choice == 6:
        parent[key] = copy.deepcopy(at(value, rng.choice(known)))
    elif choice == 7 and isinstance(parent, dict):
        parent[text(rng)] = parent.pop(key) if rng.random() < 0.5 else anything(rng)
    elif isinstance(parent, list):
        times = rng.choice((1, 1, 1, 2, 50))
        parent[key:key] = [copy.deepcopy(parent[key]) for _ in range(times)]
    else:
        parent[key] = [parent[key]]
    return value


def _other(value: Any, rng: Random) -> Any:
    """A value of the same type, or of one that resembles it."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        word = near(repr(value), rng)
        try:
            return int(word) if isinstance(value, int) and rng.random() < 0.7 else float(word)
        except ValueError:
            return word
    if isinstance(value, str):
        return rng.choice(
            (text(rng), value + text(rng), value * 2, value[:-1], value.swapcase(), value + " ")
        )
    return anything(rng)
