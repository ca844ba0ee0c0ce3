"""Names of mutants that mutmut has made, some of them drawn with a fixed seed: `python tests/mutation/sampled.py 80`."""

from __future__ import annotations

import json
import random
import sys
from pathlib import Path

MADE = Path("mutants")
"""mutmut's folder: beside each mutated file, NAME.py.meta holds the names of its mutants."""
SEED = 12


def names() -> list[str]:
    """All mutants' names, in order."""
    metas = sorted(MADE.rglob("*.meta"))
    return [name for meta in metas for name in sorted(json.loads(meta.read_text())["exit_code_by_key"])]


if __name__ == "__main__":
    made = names()
    print(*sorted(random.Random(SEED).sample(made, min(int(sys.argv[1]), len(made)))), sep="\n")
