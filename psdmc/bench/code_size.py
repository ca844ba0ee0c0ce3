"""Bytes of machine code of single functions, read from the symbols of a library that was compiled here."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

CODE = frozenset("tTwW")
"""nm's letters for functions."""


def code_sizes(library: Path) -> dict[str, int]:
    """Bytes of each function by its name. What a compiler splits off, `name.cold` and the like, counts as the function's.
    Empty where there is no GNU or LLVM nm: the column then stays empty."""
    nm = shutil.which("nm")
    if nm is None:
        return {}
    command = [nm, "--print-size", "--defined-only", str(library)]
    said = subprocess.run(command, capture_output=True, text=True, check=False, errors="replace").stdout
    found: dict[str, int] = {}
    for line in said.splitlines():
        words = line.split()
        if len(words) == 4 and words[2] in CODE:
            name = words[3].partition(".")[0]
            found[name] = found.get(name, 0) + int(words[1], 16)
    return found


def code_bytes(sizes: Mapping[str, int], belongs: Callable[[str], bool]) -> int | None:
    """Bytes of the functions that belong to one; None where none is known."""
    own = [size for name, size in sizes.items() if belongs(name)]
    return sum(own) if own else None
