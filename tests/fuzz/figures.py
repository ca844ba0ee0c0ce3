"""What a run found, as JSON and as a table."""

from __future__ import annotations

import json
import platform
import subprocess
from pathlib import Path

from recorder import KINDS, Find
from seeds import ROOT

Figures = dict[str, dict[str, float]]

LONGEST_SAID = 300
"""characters of a find's message in the JSON"""


def write_figures(path: Path, figures: Figures, finds: list[Find], run: dict[str, object]) -> None:
    """Per format: inputs, how many ran deep, how they ended, inputs per second; and every find. `run`: how it was done."""
    done = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    content = {
        "commit": done.stdout.strip(),
        "python": platform.python_version(),
        **run,
        "inputs": sum(int(row["inputs"]) for row in figures.values()),
        "formats": figures,
        "finds": [
            {
                "format": f.format,
                "kind": f.outcome.kind,
                "where": f.outcome.where,
                "said": f.outcome.said[:LONGEST_SAID],
            }
            for f in finds
        ],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def print_figures(figures: Figures, finds: list[Find]) -> None:
    names = ("inputs", "deep", *KINDS, "per_second")
    print(f"{'':12}" + "".join(f"{name:>16}" for name in names))
    for format, row in figures.items():
        print(f"{format:12}" + "".join(f"{row[name]:>16}" for name in names))
    print(f"{'all':12}{sum(int(row['inputs']) for row in figures.values()):>16}")
    for find in finds:
        print(
            f"find: {find.format}: {find.outcome.key}: {find.outcome.said[:120]!r}\n  {find.folder / 'input'}"
        )
